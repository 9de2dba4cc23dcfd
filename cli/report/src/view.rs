//! What a report shows of a run, prepared for drawing.

use mba_mapper::dataset::{Dataset, survey};
use mba_mapper::evaluation::{TrajectoryOptions, evaluate_trajectory};
use mba_mapper::exposure::{blur_length, motion_of};
use mba_mapper::run::{FrameStatus, Run, mid_pose};
use mba_mapper::trajectory_file::{TimedExposure, TimedPose};
use mba_tracker::geometry::RigidTransform;
use nalgebra::Vector3;

/// Frames from which the median depth is taken.
const SAMPLED_FRAMES: usize = 16;

/// Curves of a run. Times are in seconds since the first frame.
#[derive(Clone, Debug, Default)]
pub struct RunView {
    /// Estimated camera poses, aligned with the truth where there is one.
    pub estimate: Vec<RigidTransform>,
    /// True positions while the estimate lasts.
    pub truth: Vec<Vector3<f64>>,
    /// (time, position error in metres).
    pub errors: Vec<(f64, f64)>,
    /// (time, blur length in pixels) of the estimate; NaN for lost frames.
    pub blur: Vec<(f64, f64)>,
    /// The same of the true exposures.
    pub true_blur: Vec<(f64, f64)>,
    /// (time, tracking time in milliseconds).
    pub milliseconds: Vec<(f64, f64)>,
    /// Times and indices of the lost frames.
    pub lost: Vec<(f64, usize)>,
}

impl RunView {
    /// Collects the curves; without `dataset` there is no truth to show.
    #[must_use]
    pub fn new(run: &Run, dataset: Option<&Dataset>) -> Self {
        let start = run.exposures.first().map_or(0.0, |e| e.timestamp);
        let is_lost = |k: usize| run.frames.get(k).is_some_and(|f| f.status == FrameStatus::Lost);
        let blur =
            |(k, px): (usize, f64)| (run.frames[k].timestamp - start, if is_lost(k) { f64::NAN } else { px });
        let mut view = Self {
            estimate: run.exposures.iter().map(|e| e.mid).collect(),
            blur: run.frames.iter().map(|f| f.blur_px).enumerate().map(blur).collect(),
            milliseconds: run.frames.iter().map(|f| (f.timestamp - start, f.ms)).collect(),
            lost: (0..run.exposures.len())
                .filter(|k| is_lost(*k))
                .map(|k| (run.exposures[k].timestamp - start, k))
                .collect(),
            ..Self::default()
        };
        if let Some(dataset) = dataset {
            view.add_truth(run, dataset, start);
            view.add_blur(run, dataset, start);
        }
        view
    }

    fn add_truth(&mut self, run: &Run, dataset: &Dataset, start: f64) {
        let poses: Vec<TimedPose> = run.exposures.iter().map(mid_pose).collect();
        let truth = dataset.ground_truth();
        // A run too short or too straight to be aligned is shown without truth.
        let Ok(evaluation) = evaluate_trajectory(truth, &poses, &TrajectoryOptions::default()) else {
            return;
        };
        let aligned = evaluation.reference_from_estimate.transform_trajectory(&poses);
        self.estimate = aligned.iter().map(|pose| pose.world_from_camera).collect();
        self.errors = evaluation
            .matches
            .iter()
            .zip(&evaluation.position_errors)
            .map(|(m, error)| (poses[m.estimate].timestamp - start, *error))
            .collect();
        let end = poses.last().map_or(start, |pose| pose.timestamp);
        let within = |t: f64| t >= start - 0.05 && t <= end + 0.05;
        self.truth = truth
            .iter()
            .filter(|pose| within(pose.timestamp))
            .map(|pose| pose.world_from_camera.translation)
            .collect();
    }

    /// Replaces the tracker's own blur lengths by those of its motions at the median depth, the measure that the true
    /// motions have too.
    fn add_blur(&mut self, run: &Run, dataset: &Dataset, start: f64) {
        let truth = dataset.ground_truth_exposures();
        let Some(depth) = (!truth.is_empty()).then(|| survey(dataset, SAMPLED_FRAMES).median_depth).flatten()
        else {
            return;
        };
        let camera = &dataset.calibration().camera;
        let length = |e: &TimedExposure| (e.timestamp - start, blur_length(&motion_of(e), camera, depth));
        let end = run.exposures.last().map_or(start, |e| e.timestamp);
        self.true_blur = truth.iter().filter(|e| e.timestamp <= end + 0.05).map(length).collect();
        self.blur = run.exposures.iter().map(length).collect();
        for (_, k) in &self.lost {
            self.blur[*k].1 = f64::NAN;
        }
    }
}
