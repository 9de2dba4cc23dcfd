//! The run from start to end.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use mba_adjust::bundle::{BorrowedBundleState, BundleAdjustment, BundleState, MapModel};
use mba_io::checkpoint::{CheckpointError, Fingerprint, Identity, load, save};
use mba_io::dataset::Dataset;
use mba_io::output::OutputFolder;
use mba_io::trajectory_file::TimedExposure;
use mba_map::map::MapSize;
use serde::{Deserialize, Serialize};

use super::choice::choose_keyframes;
use super::other_frames::{AllFrames, Fit, Fitted, all_exposures};
use super::part::{MapPart, MappedKeyframe, MappedPart, mapped_keyframes};
use super::prepare::{self, Frames};
use super::{MapError, MapSettings, output, picture_figures};
use crate::run::{CHECKPOINT_FILE, MapFigures, Merit, Run, RunSettings, RunWriter, Summary, plausibility};
use crate::self_calibration::contradictions;

/// Share of the time budget that is for seeding, the frames between keyframes, and writing.
pub(super) const BUDGET_RESERVE: f64 = 0.1;

/// Layout of the checkpoint's content, and of the schedule that a map goes on with: a position in another one means another step.
const CHECKPOINT_VERSION: u32 = 5;

/// Memory of the smoothed loss, steps.
const SMOOTHING: f64 = 50.0;

/// Where a run stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapProgress {
    /// Share of the adjustment that is done, 0 to 1.
    pub position: f64,
    /// Steps so far.
    pub steps: usize,
    /// Size of the map now.
    pub size: MapSize,
    /// Loss, mean of the last steps.
    pub loss: f64,
    /// PSNR of blurred renderings against captured frames in dB, of the mean square of the last steps.
    pub psnr: f64,
}

/// All that is needed to go on.
#[derive(Deserialize)]
struct Saved {
    state: BundleState,
    running: Running,
}

/// The same as it is written.
#[derive(Serialize)]
struct Saving<'a> {
    state: BorrowedBundleState<'a>,
    running: Running,
}

/// What the driver keeps of the steps: seconds for the map so far, and smoothed figures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Running {
    pub(super) seconds: f64,
    loss: f64,
    mean_square: f64,
}

impl Running {
    fn add(&mut self, loss: f64, mean_square: f64, steps: usize) {
        let share = 1.0 / (steps as f64).clamp(1.0, SMOOTHING);
        self.loss += share * (loss - self.loss);
        self.mean_square += share * (mean_square - self.mean_square);
    }
}

/// Maps `dataset` from the poses of `run` into the RUN folder `out`. With `resume`, goes on from the checkpoint in
/// `out` if there is one. `describe` becomes the settings of the new run; `observe` is called after every step and says
/// whether to go on.
///
/// # Errors
/// See [`MapError`]. What was done before stays in `out`, and an earlier run until it is known that there will be a map.
pub fn map_dataset(
    dataset: &Dataset,
    run: &Run,
    settings: &MapSettings,
    out: OutputFolder,
    resume: bool,
    describe: RunSettings,
    observe: impl FnMut(MapProgress) -> ControlFlow<()>,
) -> Result<Summary, MapError> {
    let work = Work { dataset, run, settings, part: None };
    work.map(out, resume, describe, observe).map(|(summary, _)| summary)
}

/// As [`map_dataset`], of a part of the run only: the map of its keyframes, and poses of its frames. All other frames are
/// moved along with the keyframe next to them, and there are no figures that need the whole.
///
/// # Errors
/// As [`map_dataset`], and [`MapError::NoKeyframe`] for a part without keyframes.
pub fn map_part(
    (dataset, run): (&Dataset, &Run),
    settings: &MapSettings,
    part: &MapPart,
    out: OutputFolder,
    resume: bool,
    describe: RunSettings,
    observe: impl FnMut(MapProgress) -> ControlFlow<()>,
) -> Result<MappedPart, MapError> {
    let work = Work { dataset, run, settings, part: Some(part) };
    let (summary, keyframes) = work.map(out, resume, describe, observe)?;
    Ok(MappedPart { summary, keyframes })
}

/// What is mapped, and how.
struct Work<'a> {
    dataset: &'a Dataset,
    run: &'a Run,
    settings: &'a MapSettings,
    part: Option<&'a MapPart>,
}

impl Work<'_> {
    fn map(
        &self,
        out: OutputFolder,
        resume: bool,
        describe: RunSettings,
        mut observe: impl FnMut(MapProgress) -> ControlFlow<()>,
    ) -> Result<(Summary, Vec<MappedKeyframe>), MapError> {
        let Self { dataset, run, settings, part } = *self;
        let started = Instant::now();
        let mut frames = Frames::new(dataset, run, settings.continuity)?;
        let identity = self.identity();
        let checkpoint = out.path().join(CHECKPOINT_FILE);
        let saved: Option<Saved> =
            if resume && checkpoint.is_file() { Some(load(&checkpoint, &identity)?) } else { None };
        let chosen = match part {
            Some(part) => part.keyframes.clone(),
            None => choose_keyframes(&frames.records, settings.max_keyframes),
        };
        let mut bundle = prepare::bundle(dataset, &mut frames, &chosen, settings)?;
        let mut running = Running::default();
        match saved {
            Some(saved) => {
                bundle.restore(saved.state);
                running = saved.running;
            }
            None => bundle.seed(),
        }
        if bundle.map.is_empty() {
            return Err(MapError::NoDepth);
        }
        // Not before it is known that there will be a map: this replaces an earlier one.
        let mut writer = RunWriter::create(out, describe)?;
        // The map is made in the world of the run.
        run.summary.upright.into_iter().for_each(|upright| writer.record_mut().set_upright(upright));
        output::push_tracked(&mut writer, &frames)?;
        let earlier = running.seconds;
        let budget = settings.time_budget.map(|budget| budget.as_secs_f64() * (1.0 - BUDGET_RESERVE));
        let keep = |state: BorrowedBundleState<'_>, running: Running| {
            save(&checkpoint, &identity, &Saving { state, running })
        };
        let checkpoint = Checkpoint { interval: settings.checkpoint_interval, keep: &keep };
        let adjustment = Adjustment { budget, checkpoint: Some(checkpoint), started, earlier };
        adjustment.run(&mut bundle, &mut running, &mut observe)?;
        running.seconds = adjustment.seconds();
        let mapped = mapped_keyframes(&bundle, &frames);
        let conclusion = Conclusion { dataset, frames, settings, fit: Fit::Tracked, part };
        Ok((conclusion.write(bundle, writer, running, |_| ())?, mapped))
    }

    /// What a checkpoint has to agree with.
    fn identity(&self) -> Identity {
        let Self { dataset, run, settings, part } = *self;
        let decisive = settings.decisive();
        Identity {
            program: Fingerprint::of(&(env!("CARGO_PKG_VERSION"), CHECKPOINT_VERSION)),
            dataset: dataset_fingerprint(dataset),
            trajectory: run.fingerprint(),
            settings: match part {
                None => Fingerprint::of(&decisive),
                Some(part) => Fingerprint::of(&(decisive, part)),
            },
            simd: Fingerprint::of_simd(dataset.simd()),
        }
    }
}

/// What is left to do when the map is finished.
pub(super) struct Conclusion<'a> {
    pub(super) dataset: &'a Dataset,
    pub(super) frames: Frames,
    pub(super) settings: &'a MapSettings,
    pub(super) fit: Fit,
    /// What of the run was mapped; `None` for all of it.
    pub(super) part: Option<&'a MapPart>,
}

impl Conclusion<'_> {
    /// Poses of the frames between keyframes, repairs of what is left, and all files. `more` completes the summary.
    pub(super) fn write(
        mut self,
        mut bundle: BundleAdjustment,
        mut writer: RunWriter,
        running: Running,
        more: impl FnOnce(&mut Summary),
    ) -> Result<Summary, MapError> {
        let started = Instant::now();
        let dataset = self.dataset;
        self.frames.warnings.drain(..).for_each(|warning| writer.record_mut().warn(warning));
        // Frames between keyframes follow; then what does not fit its neighbours is repaired.
        let fitted = Fitted { fit: self.fit, part: self.part };
        let AllFrames { exposures: refined, predicted } =
            all_exposures(dataset, &mut bundle, &self.frames, self.settings, fitted);
        let in_place =
            |(index, (exposure, _)): (usize, &(TimedExposure, f64))| self.frames.in_place(index, exposure);
        let exposures: Vec<_> = refined.iter().enumerate().map(in_place).collect();
        let (exposures, repairs) = self.frames.repair(dataset, &exposures)?;
        repairs.into_iter().for_each(|repair| writer.record_mut().warn(repair));
        if self.part.is_none() {
            let contradictions = contradictions(dataset, &exposures, writer.record().frames());
            contradictions.into_iter().for_each(|found| writer.record_mut().warn(found.to_string()));
        }
        output::write(&mut writer, dataset, &mut bundle, &exposures, &refined)?;
        // Figures need the files, and close the summary.
        let pictures = match self.part {
            None => picture_figures::of_bundle(dataset, &bundle, writer.folder(), &exposures),
            Some(_) => MapFigures::default(),
        };
        let figures = MapFigures {
            gaussians: bundle.map.size().gaussians(),
            map_file_bytes: writer.map_bytes(),
            iterations: bundle.progress().steps,
            seconds: running.seconds + started.elapsed().as_secs_f64(),
            peak_memory_bytes: output::peak_memory_bytes(),
            loss: running.loss,
            keyframes: bundle.frames.len(),
            predicted_frames: predicted.frames,
            predicted_psnr: predicted.psnr(),
            ..pictures
        };
        // Against the truth, where it is on record.
        // A part is not aligned with the truth by the frames that it has not seen.
        let merit = self.part.map_or_else(|| Merit::of(&exposures, dataset), |_| Merit::default());
        let plausibility = plausibility(&exposures, writer.record().frames(), dataset);
        let summary = writer.finish(|summary| {
            summary.plausibility = plausibility;
            summary.trajectory = merit.trajectory;
            summary.blur = merit.blur;
            summary.map = Some(figures);
            more(summary);
        })?;
        Ok(summary)
    }
}

/// The loop of steps and what belongs to it.
pub(super) struct Adjustment<'a> {
    /// Seconds for it; `None` for the steps of the schedule.
    pub(super) budget: Option<f64>,
    pub(super) checkpoint: Option<Checkpoint<'a>>,
    pub(super) started: Instant,
    /// Seconds that earlier parts of the run took.
    pub(super) earlier: f64,
}

/// How the state is kept while the loop runs.
#[derive(Clone, Copy)]
pub(crate) struct Checkpoint<'a> {
    /// Time between two checkpoints.
    pub(crate) interval: Duration,
    /// Writes one.
    pub(crate) keep: &'a Keep<'a>,
}

/// Writes a checkpoint of a bundle and of what the loop keeps besides.
type Keep<'a> = dyn Fn(BorrowedBundleState<'_>, Running) -> Result<(), CheckpointError> + 'a;

impl Adjustment<'_> {
    pub(super) fn run(
        &self,
        bundle: &mut BundleAdjustment,
        running: &mut Running,
        observe: &mut impl FnMut(MapProgress) -> ControlFlow<()>,
    ) -> Result<(), MapError> {
        // The first checkpoint follows the first step: reading the frames is not to be lost either.
        let mut last_saved: Option<Instant> = None;
        while bundle.progress().position < 1.0 {
            let steps = bundle.progress().scheduled_steps + 1;
            let report = bundle.step(self.budget.is_some(), |schedule| match self.budget {
                None => steps as f64 / schedule.steps().max(1) as f64,
                Some(budget) => self.seconds() / budget,
            });
            let Some(report) = report else { break };
            running.add(report.terms.total(), report.terms.mean_square, steps);
            let flow = observe(MapProgress {
                position: bundle.progress().position.min(1.0),
                steps: bundle.progress().steps,
                size: bundle.map.size(),
                loss: running.loss,
                psnr: -10.0 * running.mean_square.log10(),
            });
            let is_due = |interval| last_saved.is_none_or(|saved| saved.elapsed() >= interval);
            if let Some(checkpoint) = &self.checkpoint
                && (flow.is_break() || is_due(checkpoint.interval))
            {
                self.save(checkpoint, bundle, running)?;
                last_saved = Some(Instant::now());
            }
            if flow.is_break() {
                return Err(MapError::Stopped);
            }
        }
        // Frames between keyframes and files take time too; a run that is killed there does not repeat the steps.
        self.checkpoint.iter().try_for_each(|checkpoint| self.save(checkpoint, bundle, running))
    }

    /// Time for the map so far, earlier parts of the run included.
    pub(super) fn seconds(&self) -> f64 {
        self.earlier + self.started.elapsed().as_secs_f64()
    }

    fn save(
        &self,
        checkpoint: &Checkpoint<'_>,
        bundle: &BundleAdjustment,
        running: &Running,
    ) -> Result<(), MapError> {
        let running = Running { seconds: self.seconds(), ..*running };
        Ok((checkpoint.keep)(bundle.state(), running)?)
    }
}

/// What a data set is, wherever it lies: it may move between two parts of a run.
pub(crate) fn dataset_fingerprint(dataset: &Dataset) -> Fingerprint {
    Fingerprint::of_dataset(dataset)
}
