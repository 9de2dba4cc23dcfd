//! Continuity of a recorded run.

use mba_adjust::continuity::{
    Continuity, ContinuityError, ContinuityFrame, ContinuitySettings, Evidence, PoseNoise, repair_by_evidence,
};
use mba_io::statistics::quantile;
use mba_io::trajectory_file::TimedExposure;
use mba_raster::exposure::motion_of;
use mba_tracker::trajectory::ExposureTrajectory;

use crate::run::{FrameRecord, FrameStatus};

/// How much less exactly a frame is known that was aligned with few inliers or a large residual.
const WEAK_FACTOR: f64 = 3.0;

/// Exposures of a run after [`repair_run`].
#[derive(Clone, Debug, PartialEq)]
pub struct RepairedRun {
    /// One per frame; those that were kept are the given ones, bit for bit.
    pub exposures: Vec<TimedExposure>,
    /// What was done.
    pub continuity: Continuity,
}

/// Repairs the exposures of a run: one exposure, one record and one exposure time (seconds) per frame, in order of time.
///
/// Lost frames measure nothing. The noise of the others is what is typical of tracked frames, more for weak ones and
/// for those with a residual above the usual. What the frames show has the last word, as in [`repair_by_evidence`];
/// frames with the status ok are trusted.
///
/// # Errors
/// As [`repair`](mba_adjust::continuity::repair), and [`ContinuityError::Lengths`].
pub fn repair_run(
    exposures: &[TimedExposure],
    records: &[FrameRecord],
    exposure_seconds: &[f64],
    settings: &ContinuitySettings,
    evidence: &Evidence<'_>,
) -> Result<RepairedRun, ContinuityError> {
    let frames = run_frames(exposures, records, exposure_seconds)?;
    let continuity = repair_by_evidence(&frames, settings, evidence)?;
    let exposures = exposures
        .iter()
        .zip(&continuity.exposures)
        .map(|(given, repaired)| if motion_of(given) == *repaired { *given } else { timed(given, repaired) })
        .collect();
    Ok(RepairedRun { exposures, continuity })
}

/// The frames of a run as [`repair`](mba_adjust::continuity::repair) and [`predict_motions`](mba_adjust::continuity::predict_motions) take them.
///
/// # Errors
/// [`ContinuityError::Lengths`].
pub fn run_frames(
    exposures: &[TimedExposure],
    records: &[FrameRecord],
    exposure_seconds: &[f64],
) -> Result<Vec<ContinuityFrame>, ContinuityError> {
    let lengths = [exposures.len(), records.len(), exposure_seconds.len()];
    if lengths != [exposures.len(); 3] {
        let [exposures, records, seconds] = lengths;
        return Err(ContinuityError::Lengths { exposures, records, seconds });
    }
    // Noise is relative to what is usual in this run: the scale of residuals depends on the scene.
    let residuals: Vec<f64> = records.iter().map(|record| record.residual).collect();
    let usual_residual = quantile(&residuals, 0.5).unwrap_or(0.0);
    let given = exposures.iter().zip(records).zip(exposure_seconds);
    let frame = |((exposure, record), &exposure_seconds): ((&TimedExposure, _), _)| ContinuityFrame {
        timestamp: exposure.timestamp,
        exposure_seconds,
        world_from_camera: motion_of(exposure),
        noise: noise(exposure, record, usual_residual),
        trusted: record.status == FrameStatus::Ok,
    };
    Ok(given.map(frame).collect())
}

fn noise(exposure: &TimedExposure, record: &FrameRecord, usual_residual: f64) -> Option<PoseNoise> {
    let by_status = match record.status {
        FrameStatus::Ok => 1.0,
        FrameStatus::Weak => WEAK_FACTOR,
        FrameStatus::Lost => return None,
    };
    // NaN where there is none, or one by zero.
    let by_residual = (record.residual / usual_residual).clamp(1.0, WEAK_FACTOR);
    let by_residual = if by_residual.is_nan() { 1.0 } else { by_residual };
    Some(PoseNoise::typical(&motion_of(exposure)).scaled(f64::max(by_status, by_residual)))
}

/// A swap leaves the middle where it was, so it is taken from the new ends only if they moved.
fn timed(given: &TimedExposure, repaired: &ExposureTrajectory) -> TimedExposure {
    let mid = if motion_of(given).reversed() == *repaired { given.mid } else { repaired.mid() };
    TimedExposure { timestamp: given.timestamp, start: repaired.start, mid, end: repaired.end }
}
