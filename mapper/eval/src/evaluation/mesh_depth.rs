//! How well two meshes agree in what cameras see of them.

use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use mba_mesh::{Mesh, depth_image};

/// Why the depth of meshes cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshDepthError {
    /// One of them is a cloud of points, which has no depth between them.
    #[error("the {0} mesh has no triangles")]
    NoTriangles(&'static str),
    /// No view shows the reference.
    #[error("the reference is in none of {views} views")]
    NothingSeen {
        /// Number of views.
        views: usize,
    },
}

/// Figures of merit of what cameras see of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeshDepthFigures {
    /// Number of views.
    pub views: usize,
    /// Depth L1: mean absolute difference of depth in centimetres over the pixels of all views at which both meshes have
    /// a surface; absent if there are none.
    pub l1_cm: Option<f64>,
    /// Share (0 to 1) of the pixels with a surface of the reference at which the estimate has one too.
    pub covered_share: f64,
}

/// Compares the depth of an estimated mesh with that of a reference, both in metres in one frame, the world of
/// `world_from_camera`: the poses of the views, all taken with `camera`. Pixels at which only one of the meshes has a
/// surface do not contribute to the difference.
///
/// # Errors
/// [`MeshDepthError`] for meshes without triangles, and for a reference that is in none of the views.
pub fn evaluate_mesh_depth(
    reference: &Mesh,
    estimate: &Mesh,
    camera: &PinholeCamera,
    world_from_camera: &[RigidTransform],
) -> Result<MeshDepthFigures, MeshDepthError> {
    for (name, mesh) in [("reference", reference), ("estimated", estimate)] {
        if mesh.triangles.is_empty() {
            return Err(MeshDepthError::NoTriangles(name));
        }
    }
    // The same renderer for both, so that what it leaves out is left out of both.
    let compare =
        |pose| ViewSums::new(&depth_image(reference, camera, pose), &depth_image(estimate, camera, pose));
    // Sums are added in the order of the views, whatever the number of threads.
    let of_views: Vec<ViewSums> = world_from_camera.par_iter().map(compare).collect();
    let sums = of_views.iter().fold(ViewSums::default(), ViewSums::plus);
    let views = world_from_camera.len();
    if sums.reference == 0 {
        return Err(MeshDepthError::NothingSeen { views });
    }
    Ok(MeshDepthFigures {
        views,
        l1_cm: (sums.both > 0).then(|| 100.0 * sums.difference / sums.both as f64),
        covered_share: sums.both as f64 / sums.reference as f64,
    })
}

/// Sums over the pixels of views.
#[derive(Clone, Copy, Debug, Default)]
struct ViewSums {
    /// Pixels with a surface of the reference.
    reference: u64,
    /// Those of them with one of the estimate.
    both: u64,
    /// Of absolute differences there, metres.
    difference: f64,
}

impl ViewSums {
    fn new(reference: &[f64], estimate: &[f64]) -> Self {
        let seen = reference.iter().zip(estimate).filter(|(reference, _)| **reference > 0.0);
        seen.fold(Self::default(), |sums, (reference, estimate)| {
            let both = *estimate > 0.0;
            let difference = if both { (estimate - reference).abs() } else { 0.0 };
            sums.plus(&Self { reference: 1, both: u64::from(both), difference })
        })
    }

    fn plus(self, other: &Self) -> Self {
        Self {
            reference: self.reference + other.reference,
            both: self.both + other.both,
            difference: self.difference + other.difference,
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 40, height: 30, fx: 35.0, fy: 35.0, cx: 19.5, cy: 14.5 };

    /// A wall of constant z, from `left` to x = 8 and 8 m up and down.
    fn wall(left: f32, z: f32) -> Mesh {
        Mesh {
            vertices: vec![[left, -8.0, z], [8.0, -8.0, z], [8.0, 8.0, z], [left, 8.0, z]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        }
    }

    fn at(x: f64, z: f64) -> RigidTransform {
        RigidTransform::new(UnitQuaternion::identity(), Vector3::new(x, 0.0, z))
    }

    #[test]
    fn parallel_planes_are_as_far_apart_as_they_are_head_on() {
        for (z, expected) in [(2.02, 2.0), (1.98, 2.0), (2.0, 0.0)] {
            let views = [at(0.0, 0.0), at(0.5, 1.0)];
            let figures = evaluate_mesh_depth(&wall(-8.0, 2.0), &wall(-8.0, z), &CAMERA, &views).unwrap();
            assert!((figures.l1_cm.unwrap() - expected).abs() < 1e-4, "{figures:?}");
            assert_eq!((figures.views, figures.covered_share), (2, 1.0));
        }
    }

    /// Both walls in one mesh.
    fn walls(one: &Mesh, other: &Mesh) -> Mesh {
        let moved = other.triangles.iter().map(|corners| corners.map(|corner| corner + 4));
        Mesh {
            vertices: [&one.vertices[..], &other.vertices[..]].concat(),
            triangles: one.triangles.iter().copied().chain(moved).collect(),
            ..Mesh::default()
        }
    }

    #[test]
    fn pixels_weigh_alike_and_only_where_both_have_a_surface() {
        let reference = walls(&wall(-8.0, 2.0), &wall(-8.0, 4.0));
        let estimate = walls(&wall(0.0, 2.25), &wall(0.0, 4.5));
        // The first sees the near walls, of the estimate's in half of its 1200 pixels. The second, between near and far
        // ones, sees the far ones everywhere. The third looks past all of them.
        let views = [at(0.0, 0.0), at(3.0, 2.5), at(90.0, 0.0)];
        let figures = evaluate_mesh_depth(&reference, &estimate, &CAMERA, &views).unwrap();
        let expected = (600.0 * 25.0 + 1200.0 * 50.0) / 1800.0;
        assert!((figures.l1_cm.unwrap() - expected).abs() < 1e-9, "{figures:?}");
        assert_eq!((figures.views, figures.covered_share), (3, 0.75));
        let figures = evaluate_mesh_depth(&reference, &estimate, &CAMERA, &[at(-3.0, 0.0)]).unwrap();
        assert_eq!(figures, MeshDepthFigures { views: 1, l1_cm: None, covered_share: 0.0 });
    }

    #[test]
    fn figures_do_not_depend_on_the_number_of_threads() {
        let views: Vec<_> = (0..9).map(|k| at(0.1 * f64::from(k), 0.07 * f64::from(k * k % 5))).collect();
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| evaluate_mesh_depth(&wall(-1.0, 2.0), &wall(0.3, 2.1), &CAMERA, &views))
        };
        assert!(with(1).is_ok_and(|one| with(3) == Ok(one)));
    }

    #[test]
    fn what_cannot_be_seen_is_refused() {
        let cloud = Mesh { triangles: Vec::new(), ..wall(-8.0, 2.0) };
        let message = |reference: &Mesh, estimate: &Mesh, views: &[RigidTransform]| {
            evaluate_mesh_depth(reference, estimate, &CAMERA, views).unwrap_err().to_string()
        };
        let mesh = wall(-8.0, 2.0);
        assert_eq!(message(&cloud, &mesh, &[at(0.0, 0.0)]), "the reference mesh has no triangles");
        assert_eq!(message(&mesh, &cloud, &[at(0.0, 0.0)]), "the estimated mesh has no triangles");
        assert_eq!(message(&mesh, &mesh, &[at(0.0, 5.0)]), "the reference is in none of 1 views");
        assert_eq!(message(&mesh, &mesh, &[]), "the reference is in none of 0 views");
    }
}
