//! The figures of an evaluation in the form that files and `--json` carry.

use mba_io::statistics::Statistics;
use serde::{Deserialize, Serialize};

use super::{BlurEvaluation, TrajectoryEvaluation};

/// Figures of merit of a trajectory; the unit is part of the name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrajectoryFigures {
    /// Number of matched pairs.
    pub matches: usize,
    /// Share (0 to 1) of the reference poses that have a match.
    pub reference_coverage: f64,
    /// Share (0 to 1) of the estimated poses that have a match.
    pub estimate_coverage: f64,
    /// Scale that the alignment found; 1 unless it was Sim(3).
    pub scale: f64,
    /// Absolute trajectory error.
    pub ate_m: Statistics,
    /// Share (0 to 1) of the matches whose position is off by at most 2 cm.
    pub share_within_2cm: f64,
    /// Relative pose error from frame to frame, translation.
    pub rpe_translation_m: Statistics,
    /// Relative pose error from frame to frame, rotation.
    pub rpe_rotation_deg: Statistics,
    /// Relative pose error from the first to the last frame, translation; 0 in runs of old versions.
    #[serde(default)]
    pub end_drift_m: f64,
    /// Its rotation angle.
    #[serde(default)]
    pub end_drift_deg: f64,
}

impl From<&TrajectoryEvaluation> for TrajectoryFigures {
    fn from(evaluation: &TrajectoryEvaluation) -> Self {
        Self {
            matches: evaluation.matches.len(),
            reference_coverage: evaluation.reference_coverage,
            estimate_coverage: evaluation.estimate_coverage,
            scale: evaluation.reference_from_estimate.scale,
            ate_m: evaluation.ate,
            share_within_2cm: evaluation.share_within_2cm,
            rpe_translation_m: evaluation.rpe_translation,
            rpe_rotation_deg: evaluation.rpe_rotation.scaled(1f64.to_degrees()),
            end_drift_m: evaluation.end_drift.translation.norm(),
            end_drift_deg: evaluation.end_drift.rotation.angle().to_degrees(),
        }
    }
}

/// Figures of merit of the motion within the exposure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BlurFigures {
    /// Number of compared exposures.
    pub frames: usize,
    /// Those with more true blur than [`super::MIN_TRUE_BLUR_PX`].
    pub blurred_frames: usize,
    /// Mean true blur length of all compared frames.
    pub mean_reference_px: f64,
    /// Mean estimated blur length of all compared frames.
    pub mean_estimate_px: f64,
    /// Median relative error of the blur length over the blurred frames; absent without any.
    pub median_relative_error: Option<f64>,
    /// Share (0 to 1) of the blurred frames with the right direction of time; absent without any.
    pub direction_share: Option<f64>,
}

impl From<&BlurEvaluation> for BlurFigures {
    fn from(evaluation: &BlurEvaluation) -> Self {
        let frames = &evaluation.frames;
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / frames.len().max(1) as f64;
        Self {
            frames: frames.len(),
            blurred_frames: evaluation.blurred_frames,
            mean_reference_px: mean(&mut frames.iter().map(|f| f.reference_px)),
            mean_estimate_px: mean(&mut frames.iter().map(|f| f.estimate_px)),
            median_relative_error: evaluation.median_relative_error,
            direction_share: evaluation.direction_share,
        }
    }
}
