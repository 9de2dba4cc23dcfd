//! Figures of merit of a run: against the ground truth of its data set, and without it.

use mba_io::dataset::{Dataset, survey};
use mba_io::trajectory_file::{TimedExposure, TimedPose};

use mba_eval::evaluation::{
    BlurFigures, DEFAULT_MAX_DT, MotionPlausibility, TrajectoryFigures, TrajectoryOptions, evaluate_blur,
    evaluate_trajectory, motion_plausibility,
};

use super::{FrameRecord, FrameStatus};

/// Frames from which the median depth of a data set is taken.
const SAMPLED_FRAMES: usize = 16;

/// What the ground truth of a data set says about estimated exposures; each part is absent without the truth for it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Merit {
    /// Trajectory errors after SE(3) alignment.
    pub trajectory: Option<TrajectoryFigures>,
    /// Errors of the motion within the exposure.
    pub blur: Option<BlurFigures>,
}

impl Merit {
    /// Compares `exposures` with the ground truth of `dataset`; what cannot be compared, e.g. because two frames do
    /// not determine an alignment, stays absent.
    #[must_use]
    pub fn of(exposures: &[TimedExposure], dataset: &Dataset) -> Self {
        Self { trajectory: trajectory_figures(exposures, dataset), blur: blur(exposures, dataset) }
    }
}

/// Trajectory errors after SE(3) alignment; none without a ground truth that can be compared.
#[must_use]
pub fn trajectory_figures(exposures: &[TimedExposure], dataset: &Dataset) -> Option<TrajectoryFigures> {
    let poses: Vec<TimedPose> = exposures.iter().map(mid_pose).collect();
    let evaluation = evaluate_trajectory(dataset.ground_truth(), &poses, &TrajectoryOptions::default());
    evaluation.ok().map(|evaluation| TrajectoryFigures::from(&evaluation))
}

/// Whether the motions within exposures are possible; none without any depth, at which they would be seen.
#[must_use]
pub fn plausibility(
    exposures: &[TimedExposure],
    records: &[FrameRecord],
    dataset: &Dataset,
) -> Option<MotionPlausibility> {
    let depth = survey(dataset, SAMPLED_FRAMES).median_depth?;
    let is_found = |k: usize| records.get(k).is_some_and(|record| record.status != FrameStatus::Lost);
    Some(motion_plausibility(exposures, is_found, &dataset.calibration().camera, depth))
}

/// The pose at mid exposure.
#[must_use]
pub fn mid_pose(exposure: &TimedExposure) -> TimedPose {
    TimedPose { timestamp: exposure.timestamp, world_from_camera: exposure.mid }
}

fn blur(exposures: &[TimedExposure], dataset: &Dataset) -> Option<BlurFigures> {
    let truth = dataset.ground_truth_exposures();
    if truth.is_empty() {
        return None;
    }
    let depth = survey(dataset, SAMPLED_FRAMES).median_depth?;
    let camera = &dataset.calibration().camera;
    Some(BlurFigures::from(&evaluate_blur(truth, exposures, DEFAULT_MAX_DT, camera, depth)))
}
