//! Alignment of two trajectories by positions and orientations.

use mba_io::trajectory_file::TimedPose;
use mba_tracker::geometry::RigidTransform;
use nalgebra::{Matrix3, Vector3};
use thiserror::Error;

use super::alignment::nearest_rotation;
use super::association::associate;

/// Why two trajectories cannot be aligned.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum PoseAlignmentError {
    /// No pose has a counterpart.
    #[error("none of {poses} estimated poses has a reference pose within {max_dt} s")]
    NoMatch {
        /// Estimated poses.
        poses: usize,
        /// Largest time difference that was allowed, seconds.
        max_dt: f64,
    },
    /// The relative rotations differ from their mean by a right angle or more on average, so that it means nothing.
    #[error("the orientations of the matched poses contradict each other")]
    Contradictory,
}

/// How an estimated trajectory lies in the frame of a reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseAlignment {
    /// From the estimate's world to the reference's.
    pub reference_from_estimate: RigidTransform,
    /// Number of matched poses.
    pub matches: usize,
    /// Root mean square of the angles that are left between the orientations, radians.
    pub rotation_rms: f64,
    /// Root mean square of the distances that are left between the positions, metres.
    pub translation_rms: f64,
}

/// Aligns `estimate` with `reference`, both ascending in time; poses at most `max_dt` seconds apart are matched.
///
/// The rotation is the chordal mean of the relative rotations of all matches (Hartley et al., "Rotation averaging",
/// IJCV 2013), the translation the mean difference of positions after it. Unlike [`super::align`], which
/// uses positions alone, this is well determined for a camera that hardly moves, from one match on.
///
/// # Errors
/// See [`PoseAlignmentError`].
pub fn align_poses(
    reference: &[TimedPose],
    estimate: &[TimedPose],
    max_dt: f64,
) -> Result<PoseAlignment, PoseAlignmentError> {
    let times = |poses: &[TimedPose]| poses.iter().map(|pose| pose.timestamp).collect::<Vec<_>>();
    let matches = associate(&times(reference), &times(estimate), max_dt);
    if matches.is_empty() {
        return Err(PoseAlignmentError::NoMatch { poses: estimate.len(), max_dt });
    }
    let pairs = || {
        let pose = |poses: &[TimedPose], index: usize| poses[index].world_from_camera;
        matches.iter().map(move |m| (pose(reference, m.reference), pose(estimate, m.estimate)))
    };
    let count = matches.len() as f64;
    // The rotation that is nearest to the mean of all relative rotations, in the sense of chords.
    let correlation: Matrix3<f64> =
        pairs().map(|(r, e)| r.rotation_matrix() * e.rotation_matrix().transpose()).sum();
    let (rotation, trace) =
        nearest_rotation(&(correlation / count)).map_err(|_| PoseAlignmentError::Contradictory)?;
    // The mean over the matches of 1 + 2 cos(angle to the mean).
    if trace <= 1.0 {
        return Err(PoseAlignmentError::Contradictory);
    }
    // With the rotation known, the translation that leaves the least squares is a mean.
    let translation =
        pairs().map(|(r, e)| r.translation - rotation * e.translation).sum::<Vector3<f64>>() / count;
    let reference_from_estimate = RigidTransform { rotation, translation };
    // What is left between a pair: translation in the first three numbers, rotation in the last three.
    let left = |(r, e): (RigidTransform, RigidTransform)| reference_from_estimate.compose(&e).tangent_to(&r);
    let rms = |first: usize| {
        (pairs().map(|pair| left(pair).fixed_rows::<3>(first).norm_squared()).sum::<f64>() / count).sqrt()
    };
    Ok(PoseAlignment {
        reference_from_estimate,
        matches: matches.len(),
        rotation_rms: rms(3),
        translation_rms: rms(0),
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    fn pose(timestamp: f64, turn: [f64; 3], position: [f64; 3]) -> TimedPose {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
        TimedPose { timestamp, world_from_camera: RigidTransform::new(rotation, position.into()) }
    }

    /// A camera that looks about and moves along a line by three centimetres.
    fn short_path() -> Vec<TimedPose> {
        (0..4).map(f64::from).map(|k| pose(k, [0.1 * k, -0.2, 0.3], [0.01 * k, 0.0, 1.0])).collect()
    }

    fn known() -> RigidTransform {
        pose(0.0, [2.0, -1.5, 0.4], [4.0, -5.0, 6.0]).world_from_camera
    }

    fn moved(poses: &[TimedPose]) -> Vec<TimedPose> {
        let carry = |p: &TimedPose| TimedPose {
            world_from_camera: known().compose(&p.world_from_camera),
            timestamp: p.timestamp + 0.004,
        };
        poses.iter().map(carry).collect()
    }

    #[test]
    fn a_path_that_positions_leave_undetermined_is_aligned() {
        for poses in [short_path(), short_path()[..1].to_vec()] {
            let found = align_poses(&moved(&poses), &poses, 0.01).unwrap();
            assert!(found.reference_from_estimate.tangent_to(&known()).norm() < 1e-12, "{found:?}");
            assert_eq!(found.matches, poses.len());
            assert!(found.rotation_rms < 1e-7 && found.translation_rms < 1e-12, "{found:?}");
        }
    }

    #[test]
    fn errors_are_averaged() {
        // Opposite turns about the camera's own axis and opposite shifts leave the means where they are.
        let mut reference = moved(&short_path());
        for (pose, sign) in reference.iter_mut().zip([1.0, -1.0, -1.0, 1.0]) {
            let error = [0.03 * sign, 0.0, 0.0, 0.0, 0.0, 0.0];
            pose.world_from_camera = pose.world_from_camera.perturbed(&error.into());
            let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.02 * sign, 0.0));
            pose.world_from_camera.rotation = turn * pose.world_from_camera.rotation;
        }
        let found = align_poses(&reference, &short_path(), 0.01).unwrap();
        assert!(found.reference_from_estimate.tangent_to(&known()).norm() < 1e-9, "{found:?}");
        assert!((found.rotation_rms - 0.02).abs() < 1e-9 && (found.translation_rms - 0.03).abs() < 1e-9);
    }

    #[test]
    fn without_matches_or_without_mean_there_is_an_error() {
        let error = align_poses(&moved(&short_path()), &short_path(), 0.001).unwrap_err();
        assert_eq!(error.to_string(), "none of 4 estimated poses has a reference pose within 0.001 s");
        let half_turns = [[0.0; 3], [core::f64::consts::PI, 0.0, 0.0], [0.0, core::f64::consts::PI, 0.0]];
        let all = half_turns.into_iter().chain([[0.0, 0.0, core::f64::consts::PI]]);
        let turned: Vec<_> = all.zip(0..4).map(|(turn, k)| pose(f64::from(k), turn, [0.0; 3])).collect();
        let still: Vec<_> = (0..4).map(|k| pose(f64::from(k), [0.0; 3], [0.0; 3])).collect();
        assert_eq!(align_poses(&turned, &still, 0.01), Err(PoseAlignmentError::Contradictory));
    }
}
