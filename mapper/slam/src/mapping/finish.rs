//! From a map that has grown frame by frame to a finished RUN folder.

use std::ops::ControlFlow;
use std::time::Instant;

use mba_adjust::bundle::{BundleAdjustment, DepthSource, MappedFrame, Schedule};
use mba_io::dataset::Dataset;
use mba_io::trajectory_file::TimedExposure;
use mba_map::map::MapKind;

use super::driver::{Adjustment, BUDGET_RESERVE, Checkpoint, Conclusion, Running};
use super::other_frames::Fit;
use super::prepare::Frames;
use super::{MapError, MapProgress, MapSettings};
use crate::run::{FrameRecord, RunWriter, Summary};

/// Work per keyframe, in virtual views of full resolution.
const EFFORT: f64 = 24.0;

/// What a step costs besides its views, in views.
const STEP_COST: f64 = 3.0;

/// Fewest steps.
const LEAST_STEPS: usize = 60;

/// The refinement of all keyframes together and what follows.
pub(crate) struct Finish<'a> {
    dataset: &'a Dataset,
    settings: &'a MapSettings,
    frames: Frames,
}

impl<'a> Finish<'a> {
    /// Repairs the exposures of all frames, tells the keyframes what their neighbours suggest, fills what no depth map
    /// showed, and starts the schedule.
    pub(crate) fn new(
        dataset: &'a Dataset,
        bundle: &mut BundleAdjustment,
        exposures: &[TimedExposure],
        records: &[FrameRecord],
        settings: &'a MapSettings,
    ) -> Result<Self, MapError> {
        let frames = Frames::of(dataset, exposures, records, settings.continuity)?;
        for k in 0..bundle.frames.len() {
            let keyframe = &mut bundle.frames[k].keyframe;
            keyframe.prior = frames.priors[keyframe.index];
            bundle.seed_from(k, DepthSource::Completed);
        }
        bundle.change_density();
        bundle.set_schedule(schedule(bundle));
        Ok(Self { dataset, settings, frames })
    }

    /// Goes on with a refinement that was stopped after it had begun with a schedule of so many steps: the keyframes are
    /// told the same, map and paths are left to the caller.
    pub(crate) fn resume(
        dataset: &'a Dataset,
        bundle: &mut BundleAdjustment,
        exposures: &[TimedExposure],
        records: &[FrameRecord],
        (settings, schedule_steps): (&'a MapSettings, usize),
    ) -> Result<Self, MapError> {
        let frames = Frames::of(dataset, exposures, records, settings.continuity)?;
        for MappedFrame { keyframe, .. } in &mut bundle.frames {
            keyframe.prior = frames.priors[keyframe.index];
        }
        bundle.set_schedule(match settings.kind {
            MapKind::Gaussians => Schedule::finish(schedule_steps),
            MapKind::Field => Schedule::field(bundle.frames.len()),
        });
        Ok(Self { dataset, settings, frames })
    }

    /// Refines, fits the frames between keyframes, and writes everything. `earlier` is what a part of the refinement
    /// that was stopped had come to, `seconds` the time of the run so far; `more` completes the summary.
    pub(crate) fn run(
        self,
        mut bundle: BundleAdjustment,
        writer: RunWriter,
        (earlier, checkpoint, seconds): (Running, Option<Checkpoint<'_>>, impl Fn() -> f64),
        mut observe: impl FnMut(MapProgress) -> ControlFlow<()>,
        more: impl FnOnce(&mut Summary),
    ) -> Result<Summary, MapError> {
        let budget = self.settings.time_budget.map(|budget| budget.as_secs_f64() * (1.0 - BUDGET_RESERVE));
        let adjustment = Adjustment { budget, checkpoint, started: Instant::now(), earlier: earlier.seconds };
        let mut running = earlier;
        adjustment.run(&mut bundle, &mut running, &mut observe)?;
        running.seconds = seconds();
        let Self { dataset, settings, frames } = self;
        Conclusion { dataset, frames, settings, fit: Fit::Doubtful, part: None }
            .write(bundle, writer, running, more)
    }
}

/// The schedule of a map that has grown. A field learns with many cheap steps, as many as from nothing.
fn schedule(bundle: &BundleAdjustment) -> Schedule {
    match bundle.map.kind() {
        MapKind::Gaussians => Schedule::finish(steps(bundle)),
        MapKind::Field => Schedule::field(bundle.frames.len()),
    }
}

/// Steps of the schedule: the effort of all keyframes, of which each step takes what its views cost.
fn steps(bundle: &BundleAdjustment) -> usize {
    let plan = Schedule::finish(1).plan(0.0, false);
    let keyframes = bundle.frames.len();
    let cost: f64 = (0..keyframes).map(|k| bundle.views(k, &plan) as f64 + STEP_COST).sum();
    let mean_cost = cost / keyframes.max(1) as f64;
    ((EFFORT * keyframes as f64 / mean_cost) as usize).max(LEAST_STEPS)
}
