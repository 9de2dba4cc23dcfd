//! Pose graphs: keyframe poses that agree best with measured motions between them.
//!
//! Odometry between neighbours drifts; a recognised place says how far. Nodes are `world_from_keyframe`, an edge is a
//! measured `from_from_to` with its standard deviations. [`PoseGraph::optimise`] minimises the squared whitened
//! disagreement of all edges with the method of Levenberg and Marquardt and a sparse factorisation; the first node stays where it is.
//!
//! A recognised place can be a mistake. Edges marked robust are therefore kept or rejected, by graduated
//! non-convexity with truncated least squares (Yang, Antonante, Tzoumas and Carlone, 2020): such an edge is kept if
//! that disturbs the others less than its rejection costs.
//!
//! ```
//! use mba_adjust::pose_graph::{PoseGraph, PoseGraphEdge, PoseGraphSettings};
//! use mba_tracker::geometry::RigidTransform;
//! use nalgebra::Vector3;
//!
//! let step = |x: f64| RigidTransform { translation: Vector3::new(x, 0.0, 0.0), ..RigidTransform::identity() };
//! let edge = |from, to, x: f64| PoseGraphEdge {
//!     from, to, from_from_to: step(x), translation_sigma: 0.01, rotation_sigma: 0.01, robust: false,
//! };
//! let mut graph = PoseGraph {
//!     world_from_keyframe: vec![step(0.0), step(1.0), step(2.0)],
//!     edges: vec![edge(0, 1, 1.0), edge(1, 2, 1.0), edge(2, 0, -2.03)],
//! };
//! graph.optimise(&PoseGraphSettings::default())?;
//! // Three edges of equal weight share 3 cm.
//! assert!((graph.world_from_keyframe[2].translation.x - 2.02).abs() < 1e-6);
//! # Ok::<(), mba_adjust::pose_graph::PoseGraphError>(())
//! ```

mod edge;
mod error;
mod kernel;
mod optimise;
mod settings;
mod system;
#[cfg(test)]
mod tests;

pub use edge::PoseGraphEdge;
pub use error::PoseGraphError;
pub use settings::{PoseGraphReport, PoseGraphSettings};

use mba_tracker::geometry::RigidTransform;

/// Keyframe poses and measured motions between them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PoseGraph {
    /// Poses of the nodes. The first one is held; so are those that no chain of edges connects with it.
    pub world_from_keyframe: Vec<RigidTransform>,
    /// Measurements, in any order; several between the same nodes are several measurements.
    pub edges: Vec<PoseGraphEdge>,
}
