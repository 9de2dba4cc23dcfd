//! Absolute and relative trajectory error.

use mba_tracker::geometry::{RigidTransform, so3};
use nalgebra::Vector3;
use thiserror::Error;

use mba_io::statistics::{Statistics, share_within};
use mba_io::trajectory_file::TimedPose;

use super::{AlignmentError, DEFAULT_MAX_DT, Match, Similarity, TrajectoryAlignment, align, associate};

/// A frame whose position error is at most this many metres counts as good: one bad frame can decide an RMSE, it
/// cannot decide this share.
pub const GOOD_FRAME_METRES: f64 = 0.02;

/// How a trajectory is compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectoryOptions {
    /// Freedom given to the estimate.
    pub alignment: TrajectoryAlignment,
    /// Largest time difference of a matched pair, seconds.
    pub max_dt: f64,
}

impl Default for TrajectoryOptions {
    fn default() -> Self {
        Self { alignment: TrajectoryAlignment::Se3, max_dt: DEFAULT_MAX_DT }
    }
}

/// Why two trajectories cannot be compared.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum TrajectoryError {
    /// Fewer than two pairs.
    #[error("only {matched} of {estimate} estimated poses have a reference pose within {max_dt} s")]
    TooFewMatches {
        /// Pairs found.
        matched: usize,
        /// Poses in the estimate.
        estimate: usize,
        /// The tolerance, seconds.
        max_dt: f64,
    },
    /// The pairs exist but do not determine the alignment.
    #[error(transparent)]
    Alignment(#[from] AlignmentError),
    /// A pose is not finite.
    #[error("a matched pose is not finite")]
    NotFinite,
}

/// The comparison of two trajectories. Lengths in metres, angles in radians.
#[derive(Clone, Debug, PartialEq)]
pub struct TrajectoryEvaluation {
    /// The matched pairs, ascending in time.
    pub matches: Vec<Match>,
    /// What the estimate was aligned with.
    pub reference_from_estimate: Similarity,
    /// Distance between reference and aligned estimate, one per match.
    pub position_errors: Vec<f64>,
    /// Absolute trajectory error: the figures of `position_errors` (`evo_ape --pose_relation trans_part`).
    pub ate: Statistics,
    /// Share (0 to 1) of `position_errors` up to [`GOOD_FRAME_METRES`].
    pub share_within_2cm: f64,
    /// Translation of the relative pose error between successive matches (`evo_rpe --delta 1 --delta_unit f`).
    pub rpe_translation: Statistics,
    /// Rotation angle of the same relative pose error.
    pub rpe_rotation: Statistics,
    /// The relative pose error from the first to the last match: what a trajectory has drifted by its end.
    pub end_drift: RigidTransform,
    /// Share (0 to 1) of the reference poses that have a match.
    pub reference_coverage: f64,
    /// Share (0 to 1) of the estimated poses that have a match.
    pub estimate_coverage: f64,
}

/// Compares `estimate` with `reference`, both ascending in time.
///
/// Definitions as in Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems", IROS 2012, and the `evo`
/// package.
///
/// # Errors
/// See [`TrajectoryError`].
pub fn evaluate_trajectory(
    reference: &[TimedPose],
    estimate: &[TimedPose],
    options: &TrajectoryOptions,
) -> Result<TrajectoryEvaluation, TrajectoryError> {
    // 1. Pairs of poses, by time.
    let matches = associate(&stamps(reference), &stamps(estimate), options.max_dt);
    if matches.len() < 2 {
        let (matched, estimate) = (matches.len(), estimate.len());
        return Err(TrajectoryError::TooFewMatches { matched, estimate, max_dt: options.max_dt });
    }
    let truth: Vec<RigidTransform> =
        matches.iter().map(|m| reference[m.reference].world_from_camera).collect();
    let found: Vec<RigidTransform> = matches.iter().map(|m| estimate[m.estimate].world_from_camera).collect();
    // 2. The estimate in the world of the reference: where its own world lies is nobody's error.
    let reference_from_estimate = align(&positions(&truth), &positions(&found), options.alignment)?;
    let found: Vec<_> = found.iter().map(|pose| reference_from_estimate.transform_pose(pose)).collect();

    // 3. Absolute errors (ATE), and relative ones from pose to pose (RPE), which no alignment changes.
    let position_errors: Vec<f64> =
        truth.iter().zip(&found).map(|(t, f)| (t.translation - f.translation).norm()).collect();
    let steps = relative_errors(&truth, &found);
    let lengths: Vec<f64> = steps.iter().map(|e| e.translation.norm()).collect();
    let angles: Vec<f64> = steps.iter().map(|e| so3::log(&e.rotation).norm()).collect();
    // 4. What the whole way has drifted: the relative error of its ends.
    let ends = |poses: &[RigidTransform]| [poses[0], poses[poses.len() - 1]];
    let end_drift = relative_errors(&ends(&truth), &ends(&found))[0];
    let figures = |errors: &[f64]| Statistics::of(errors).ok_or(TrajectoryError::NotFinite);
    Ok(TrajectoryEvaluation {
        ate: figures(&position_errors)?,
        share_within_2cm: share_within(&position_errors, GOOD_FRAME_METRES),
        rpe_translation: figures(&lengths)?,
        rpe_rotation: figures(&angles)?,
        end_drift,
        reference_coverage: matches.len() as f64 / reference.len() as f64,
        estimate_coverage: matches.len() as f64 / estimate.len() as f64,
        matches,
        reference_from_estimate,
        position_errors,
    })
}

/// `(truth_i^-1 truth_j)^-1 (found_i^-1 found_j)` for successive i, j.
fn relative_errors(truth: &[RigidTransform], found: &[RigidTransform]) -> Vec<RigidTransform> {
    let step = |pair: &[RigidTransform]| pair[0].inverse().compose(&pair[1]);
    truth.windows(2).zip(found.windows(2)).map(|(t, f)| step(t).inverse().compose(&step(f))).collect()
}

fn stamps(poses: &[TimedPose]) -> Vec<f64> {
    poses.iter().map(|pose| pose.timestamp).collect()
}

fn positions(poses: &[RigidTransform]) -> Vec<Vector3<f64>> {
    poses.iter().map(|pose| pose.translation).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    /// Corners of a unit square in the plane z = 0, walked once, looking along z.
    fn square() -> Vec<TimedPose> {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let pose = |(k, c): (usize, &[f64; 2])| TimedPose {
            timestamp: k as f64,
            world_from_camera: RigidTransform::new(UnitQuaternion::identity(), Vector3::new(c[0], c[1], 0.0)),
        };
        corners.iter().enumerate().map(pose).collect()
    }

    fn evaluate(estimate: &[TimedPose], alignment: TrajectoryAlignment) -> TrajectoryEvaluation {
        evaluate_trajectory(&square(), estimate, &TrajectoryOptions { alignment, max_dt: 0.01 }).unwrap()
    }

    #[test]
    fn symmetric_error_of_a_square_in_closed_form() {
        // Alternate corners are raised and lowered by h: no rigid motion helps, every error is h; each step is wrong
        // by 2h.
        let h = 0.015;
        let mut estimate = square();
        for (k, pose) in estimate.iter_mut().enumerate() {
            pose.world_from_camera.translation.z = if k % 2 == 0 { h } else { -h };
        }
        let e = evaluate(&estimate, TrajectoryAlignment::Se3);
        for figure in [e.ate.rmse, e.ate.mean, e.ate.median, e.ate.min, e.ate.max] {
            assert!((figure - h).abs() < 1e-12, "{figure}");
        }
        assert!(e.ate.std < 1e-12);
        assert!((e.rpe_translation.rmse - 2.0 * h).abs() < 1e-12);
        // The first is raised and the last lowered.
        assert!((e.end_drift.translation.norm() - 2.0 * h).abs() < 1e-12);
        assert_eq!(e.share_within_2cm, 1.0);
    }

    #[test]
    fn scale_is_absorbed_by_sim3_only() {
        // A square of side 1.2 around the same centre: each corner is off by 0.1 sqrt(2), each step by 0.2.
        let mut estimate = square();
        for pose in &mut estimate {
            pose.world_from_camera.translation *= 1.2;
        }
        let rigid = evaluate(&estimate, TrajectoryAlignment::Se3);
        assert!((rigid.ate.rmse - 0.1 * 2f64.sqrt()).abs() < 1e-12);
        assert!((rigid.rpe_translation.median - 0.2).abs() < 1e-12);
        let scaled = evaluate(&estimate, TrajectoryAlignment::Sim3);
        assert!(scaled.ate.max < 1e-12);
        assert!((scaled.reference_from_estimate.scale - 1.0 / 1.2).abs() < 1e-12);
        assert!(scaled.rpe_translation.max < 1e-12);
    }

    #[test]
    fn no_alignment_compares_coordinates() {
        let mut estimate = square();
        for pose in &mut estimate {
            pose.world_from_camera.translation += Vector3::new(0.0, 0.3, 0.4);
        }
        assert!((evaluate(&estimate, TrajectoryAlignment::None).ate.mean - 0.5).abs() < 1e-12);
        assert!(evaluate(&estimate, TrajectoryAlignment::Se3).ate.max < 1e-12);
    }

    #[test]
    fn rotation_error_is_counted_per_step() {
        // A drift of 0.02 rad per frame about the optical axis.
        let mut estimate = square();
        for (k, pose) in estimate.iter_mut().enumerate() {
            pose.world_from_camera.rotation = so3::exp(&Vector3::new(0.0, 0.0, 0.02 * k as f64));
        }
        let e = evaluate(&estimate, TrajectoryAlignment::None);
        assert_eq!(e.ate.max, 0.0);
        assert!((e.rpe_rotation.mean - 0.02).abs() < 1e-12 && e.rpe_rotation.std < 1e-12);
    }

    #[test]
    fn coverage_counts_both_sides() {
        let mut estimate = square();
        estimate.remove(1);
        estimate.push(TimedPose { timestamp: 77.0, ..estimate[0] });
        let e = evaluate(&estimate, TrajectoryAlignment::None);
        assert_eq!((e.reference_coverage, e.estimate_coverage), (0.75, 0.75));
    }

    #[test]
    fn too_few_matches_name_the_numbers() {
        let mut late = square();
        late.iter_mut().for_each(|pose| pose.timestamp += 0.5);
        let error = evaluate_trajectory(&square(), &late, &TrajectoryOptions::default()).unwrap_err();
        assert_eq!(error.to_string(), "only 0 of 4 estimated poses have a reference pose within 0.01 s");
    }
}
