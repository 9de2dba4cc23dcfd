//! Least-squares alignment of two point lists.

use mba_tracker::geometry::RigidTransform;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use thiserror::Error;

use mba_io::trajectory_file::TimedPose;

/// Singular values below this share of the largest count as zero; text files with nine decimals of a straight
/// path stay below it, any bend of a real path stays far above.
const RANK_TOLERANCE: f64 = 1e-14;

/// Which freedom the estimate is given before it is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum TrajectoryAlignment {
    /// Compare coordinates as they are.
    None,
    /// Rotation and translation (`evo_ape -a`).
    #[default]
    Se3,
    /// Rotation, translation and one scale (`evo_ape -as`).
    Sim3,
}

/// Why two point lists cannot be aligned.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum AlignmentError {
    /// Three points are needed.
    #[error("{found} matched poses are too few for an alignment, which needs at least 3")]
    TooFewPoints {
        /// Number of points given.
        found: usize,
    },
    /// A coordinate is infinite or NaN.
    #[error("matched pose {index} has a coordinate that is not finite")]
    NotFinite {
        /// Index of the first such pair.
        index: usize,
    },
    /// All points of one list coincide or lie on one line: the rotation is undetermined.
    #[error("the matched positions stand still or lie on one straight line, so no rotation aligns them")]
    Degenerate,
}

/// A similarity `reference_from_estimate`: `x_reference = scale * R x_estimate + p`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    /// Factor from the estimate's unit of length to the reference's; positive.
    pub scale: f64,
    /// R.
    pub rotation: UnitQuaternion<f64>,
    /// p in the reference's unit of length.
    pub translation: Vector3<f64>,
}

impl Similarity {
    /// The similarity that changes nothing.
    #[must_use]
    pub fn identity() -> Self {
        Self { scale: 1.0, rotation: UnitQuaternion::identity(), translation: Vector3::zeros() }
    }

    /// Maps a point of the estimate's frame into the reference's.
    #[must_use]
    pub fn transform_point(&self, x_estimate: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * x_estimate * self.scale + self.translation
    }

    /// Maps a pose `estimate_from_camera` to `reference_from_camera`: the camera keeps its own unit of length.
    #[must_use]
    pub fn transform_pose(&self, estimate_from_camera: &RigidTransform) -> RigidTransform {
        RigidTransform {
            rotation: self.rotation * estimate_from_camera.rotation,
            translation: self.transform_point(&estimate_from_camera.translation),
        }
    }

    /// The trajectory in the reference's frame.
    #[must_use]
    pub fn transform_trajectory(&self, estimate: &[TimedPose]) -> Vec<TimedPose> {
        let moved = |pose: &TimedPose| TimedPose {
            timestamp: pose.timestamp,
            world_from_camera: self.transform_pose(&pose.world_from_camera),
        };
        estimate.iter().map(moved).collect()
    }
}

/// The similarity that minimises the squared distances between `reference[i]` and the mapped `estimate[i]`
/// (Umeyama, "Least-squares estimation of transformation parameters between two point patterns", PAMI 1991,
/// equations 34 to 43). Never a reflection.
///
/// # Errors
/// See [`AlignmentError`]; [`TrajectoryAlignment::None`] always succeeds.
///
/// # Panics
/// When the lists differ in length.
pub fn align(
    reference: &[Vector3<f64>],
    estimate: &[Vector3<f64>],
    alignment: TrajectoryAlignment,
) -> Result<Similarity, AlignmentError> {
    assert_eq!(reference.len(), estimate.len(), "points to align come in pairs");
    if alignment == TrajectoryAlignment::None {
        return Ok(Similarity::identity());
    }
    check_points(reference, estimate)?;
    let count = reference.len() as f64;
    let reference_mean = reference.iter().sum::<Vector3<f64>>() / count;
    let estimate_mean = estimate.iter().sum::<Vector3<f64>>() / count;
    let pairs =
        || reference.iter().map(|x| x - reference_mean).zip(estimate.iter().map(|y| y - estimate_mean));
    let covariance = pairs().map(|(x, y)| x * y.transpose()).sum::<Matrix3<f64>>() / count;
    // Umeyama: the rotation from the covariance of both, then the scale that goes with it.
    let (rotation, scaled_trace) = nearest_rotation(&covariance)?;
    let scale = match alignment {
        TrajectoryAlignment::Sim3 => {
            scaled_trace / (pairs().map(|(_, y)| y.norm_squared()).sum::<f64>() / count)
        }
        _ => 1.0,
    };
    Ok(Similarity { scale, rotation, translation: reference_mean - rotation * estimate_mean * scale })
}

fn check_points(reference: &[Vector3<f64>], estimate: &[Vector3<f64>]) -> Result<(), AlignmentError> {
    if reference.len() < 3 {
        return Err(AlignmentError::TooFewPoints { found: reference.len() });
    }
    let finite = |p: &Vector3<f64>| p.iter().all(|v| v.is_finite());
    match reference.iter().zip(estimate).position(|(x, y)| !finite(x) || !finite(y)) {
        Some(index) => Err(AlignmentError::NotFinite { index }),
        None => Ok(()),
    }
}

/// The rotation R that maximises `tr(R covariance^T)` and that maximum.
pub(super) fn nearest_rotation(
    covariance: &Matrix3<f64>,
) -> Result<(UnitQuaternion<f64>, f64), AlignmentError> {
    let svd = covariance.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return Err(AlignmentError::Degenerate) };
    let d = svd.singular_values;
    // Written so that NaN fails too. The values are sorted in descending order.
    let two_directions = d[1] > RANK_TOLERANCE * d[0] && d[0] > 0.0;
    if !two_directions {
        return Err(AlignmentError::Degenerate);
    }
    let sign = if u.determinant() * v_t.determinant() < 0.0 { -1.0 } else { 1.0 };
    let r = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t;
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(r));
    Ok((rotation, d[0] + d[1] + sign * d[2]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> Vec<Vector3<f64>> {
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.2], [1.0, 2.0, -0.3], [0.0, 2.5, 1.0], [-1.0, 0.5, 2.0]]
            .map(Vector3::from)
            .to_vec()
    }

    #[test]
    #[should_panic(expected = "points to align come in pairs")]
    fn points_without_a_partner_are_refused() {
        let _ = align(&points(), &points()[1..], TrajectoryAlignment::Sim3);
    }

    fn known() -> Similarity {
        Similarity {
            scale: 2.5,
            rotation: UnitQuaternion::from_euler_angles(0.3, -1.2, 2.9),
            translation: Vector3::new(4.0, -5.0, 6.0),
        }
    }

    fn assert_close(found: &Similarity, expected: &Similarity) {
        assert!((found.scale - expected.scale).abs() < 1e-12, "scale {}", found.scale);
        assert!(found.rotation.angle_to(&expected.rotation) < 1e-7, "rotation {}", found.rotation);
        assert!((found.translation - expected.translation).norm() < 1e-12, "{}", found.translation);
    }

    #[test]
    fn recovers_a_known_similarity() {
        let reference: Vec<_> = points().iter().map(|p| known().transform_point(p)).collect();
        assert_close(&align(&reference, &points(), TrajectoryAlignment::Sim3).unwrap(), &known());
    }

    #[test]
    fn recovers_a_rigid_motion_of_a_planar_path() {
        let planar: Vec<_> = points().iter().map(|p| Vector3::new(p.x, p.y, 0.0)).collect();
        let rigid = Similarity { scale: 1.0, ..known() };
        let reference: Vec<_> = planar.iter().map(|p| rigid.transform_point(p)).collect();
        assert_close(&align(&reference, &planar, TrajectoryAlignment::Se3).unwrap(), &rigid);
    }

    #[test]
    fn a_mirrored_list_is_answered_by_a_rotation() {
        let mirrored: Vec<_> = points().iter().map(|p| Vector3::new(p.x, p.y, -p.z)).collect();
        let found = align(&mirrored, &points(), TrajectoryAlignment::Se3).unwrap();
        assert!((found.rotation.to_rotation_matrix().matrix().determinant() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn undetermined_cases_are_errors() {
        let line: Vec<_> = (0..9).map(|k| Vector3::new(0.3, -0.7, 1.1) * f64::from(k)).collect();
        let spot = vec![Vector3::new(1.0, 2.0, 3.0); 5];
        assert_eq!(align(&line, &line, TrajectoryAlignment::Se3), Err(AlignmentError::Degenerate));
        assert_eq!(align(&points(), &spot, TrajectoryAlignment::Sim3), Err(AlignmentError::Degenerate));
        let two = &points()[..2];
        assert_eq!(align(two, two, TrajectoryAlignment::Se3), Err(AlignmentError::TooFewPoints { found: 2 }));
        let mut broken = points();
        broken[3].y = f64::NAN;
        assert_eq!(
            align(&points(), &broken, TrajectoryAlignment::Se3),
            Err(AlignmentError::NotFinite { index: 3 })
        );
    }
}
