//! What a map is seeded from.

use mba_raster::sensor::Observation;
use mba_tracker::geometry::RigidTransform;

/// Where the depth of new Gaussians comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DepthSource {
    /// Pixels with a depth only.
    Measured,
    /// Pixels without a depth get one from their surroundings.
    Completed,
}

/// What a keyframe shows, and from where.
#[derive(Clone, Copy, Debug)]
pub struct SeedView<'a> {
    /// Index in the data set.
    pub index: usize,
    /// What was captured, at full resolution.
    pub seen: &'a Observation,
    /// The pose at mid exposure.
    pub world_from_camera: RigidTransform,
    /// Gain on the map's light that gives what was captured.
    pub gain: f32,
    /// Where depth comes from.
    pub source: DepthSource,
}
