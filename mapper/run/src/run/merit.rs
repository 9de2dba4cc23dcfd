//! Figures of merit of a run whose data set has ground truth.

use mba_io::dataset::{Dataset, survey};
use mba_io::trajectory_file::{TimedExposure, TimedPose};

use mba_eval::evaluation::{
    BlurFigures, DEFAULT_MAX_DT, TrajectoryFigures, TrajectoryOptions, evaluate_blur, evaluate_trajectory,
};

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
