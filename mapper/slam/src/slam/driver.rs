//! The run from start to end.

use std::ops::ControlFlow;
use std::thread;
use std::time::Instant;

use mba_adjust::bundle::{BorrowedBundleState, BundleAdjustment, BundleState, MapModel, MappedFrame};
use mba_io::checkpoint::load;
use mba_io::dataset::Dataset;
use mba_io::output::OutputFolder;
use mba_map::map::MapKind;
use mba_tracker::TrackerConfig;

use super::back_end::{BackEnd, keyframe_images, keyframes};
use super::messages::link;
use super::progress::SlamProgress;
use super::saved::{Counts, Keeper, MapperParts, RefiningParts, Saved, SavedKeyframe, Saving, identity};
use super::settings::{Arrival, SlamSettings};
use super::{SlamError, front_end};
use crate::mapping::{Checkpoint, Finish, MapError, MapProgress, Running, sensor};
use crate::run::{
    CHECKPOINT_FILE, RunSettings, RunWriter, SlamFigures, Summary, TrackRecord, trajectory_figures,
};
use crate::self_calibration::depth_lag_of_tracked;
use crate::tracking::{TrackingError, tracker_config, upright_world};

/// Tracks and maps `dataset` at the same time into the RUN folder `out`. With `resume`, a run in lock step goes on from the
/// checkpoint in `out` if there is one. `describe` becomes the settings of the run; `observe` is called after every frame
/// and every step of the refinement, and says whether to go on.
///
/// # Errors
/// See [`SlamError`]. What was done before stays in `out`, and an earlier run until two frames were found.
pub fn run_slam(
    dataset: &Dataset,
    settings: &SlamSettings,
    out: OutputFolder,
    resume: bool,
    describe: RunSettings,
    mut observe: impl FnMut(SlamProgress) -> ControlFlow<()>,
) -> Result<Summary, SlamError> {
    let config = tracker_config(dataset, &settings.tracking());
    config.validate().map_err(TrackingError::Camera)?;
    // Without images the size of the camera is a mere claim, for which no memory is taken.
    if !dataset.has_images() {
        return Err(MapError::NoDepth.into());
    }
    // Frames that come by their times do not come again.
    let keeps = settings.arrival == Arrival::LockStep;
    let path = out.path().join(CHECKPOINT_FILE);
    let identity = identity(dataset, settings);
    let saved: Option<Saved> =
        if resume && keeps && path.is_file() { Some(load(&path, &identity)?) } else { None };
    let keeper = keeps.then(|| Keeper::new(path, identity, settings.checkpoint_interval));
    let writer = RunWriter::create(out, describe)?;
    let run = SlamRun { dataset, settings, config };
    let refinement = match saved {
        None => run.grow(writer, keeper, None, &mut observe)?,
        Some(Saved::Growing { mapper, state }) => {
            run.grow(writer, keeper, Some((*mapper, state)), &mut observe)?
        }
        Some(Saved::Refining { parts, state }) => run.restore_refinement(writer, keeper, *parts, state)?,
    };
    run.refine(refinement, observe)
}

/// What does not change in a run.
struct SlamRun<'a> {
    dataset: &'a Dataset,
    settings: &'a SlamSettings,
    config: TrackerConfig,
}

/// A map that has grown over all frames, before or in its refinement.
struct Refinement {
    bundle: BundleAdjustment,
    writer: RunWriter,
    keeper: Option<Keeper>,
    figures: SlamFigures,
    /// What a part that was stopped had come to: steps of its schedule, figures, and map and paths.
    stopped: Option<(usize, Running, BundleState)>,
    started: Instant,
    /// Seconds of the run before `started`.
    earlier: f64,
}

impl SlamRun<'_> {
    /// Tracks and maps all frames, or those that were left when a run was stopped.
    fn grow(
        &self,
        mut writer: RunWriter,
        keeper: Option<Keeper>,
        stopped: Option<(MapperParts, BundleState)>,
        observe: &mut impl FnMut(SlamProgress) -> ControlFlow<()>,
    ) -> Result<Refinement, SlamError> {
        let Self { dataset, settings, config } = self;
        let started = Instant::now();
        if stopped.is_none() {
            dataset.warnings().iter().for_each(|warning| writer.record_mut().warn(warning.to_string()));
        }
        let mut back_end = BackEnd::new(dataset, config, settings, (writer, keeper));
        let earlier = stopped.as_ref().map_or(0.0, |(parts, _)| parts.seconds);
        let replay = match stopped {
            Some((parts, state)) => back_end.restore(dataset, parts, state)?,
            None => None,
        };
        // Two threads: the tracker ends when the data set does or nobody listens, the mapper when no frame comes.
        let (tracker_link, mapper_link) = link();
        thread::scope(|scope| {
            let tracking =
                scope.spawn(|| front_end::run(dataset, config, settings.arrival, tracker_link, replay));
            let mapped = back_end.run(mapper_link, observe);
            let tracked = tracking.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            mapped?;
            tracked.map_err(|error| match error {
                TrackingError::Checkpoint(error) => error.into(),
                error => SlamError::from(error),
            })
        })?;
        let live_seconds = earlier + started.elapsed().as_secs_f64();
        // The whole map is known only now.
        back_end.find_lost(dataset);
        let disagreement = back_end.disagreement();
        let (mut grown, mut writer, figures, keeper) = back_end.finish();
        if let Some(lag) = depth_lag_of_tracked(dataset, disagreement) {
            writer.record_mut().warn(lag.to_string());
        }
        self.stand_upright(&mut grown.bundle, writer.record_mut());
        if grown.bundle.map.is_empty() {
            return Err(MapError::NoDepth.into());
        }
        let figures = SlamFigures {
            live_frames_per_second: dataset.len() as f64 / live_seconds,
            tracked_ate_m: trajectory_figures(writer.record().exposures(), dataset)
                .map(|figures| figures.ate_m.rmse),
            ..figures
        };
        Ok(Refinement { bundle: grown.bundle, writer, keeper, figures, stopped: None, started, earlier })
    }

    /// Moves map and run into a world that stands upright, if it is known which way is up. A field cannot be turned.
    fn stand_upright(&self, bundle: &mut BundleAdjustment, track: &mut TrackRecord) {
        let upright = upright_world(self.dataset, track.exposures(), track.frames(), self.settings.up);
        let Some((upright_from_world, how)) = upright.filter(|_| self.settings.kind == MapKind::Gaussians)
        else {
            return;
        };
        let upright = |frame: &MappedFrame| upright_from_world.compose(&frame.state.path.mid());
        let poses: Vec<_> = bundle.frames.iter().map(upright).collect();
        bundle.move_keyframes(&poses);
        track.move_world(|_| upright_from_world);
        track.set_upright(how);
    }

    /// The refinement that a run was stopped in.
    fn restore_refinement(
        &self,
        mut writer: RunWriter,
        keeper: Option<Keeper>,
        parts: RefiningParts,
        state: BundleState,
    ) -> Result<Refinement, SlamError> {
        let sensor = sensor(self.dataset);
        let images = keyframe_images(self.dataset, &parts.keyframes)?;
        let keyframes = keyframes(&sensor, &parts.keyframes, &images)?;
        let settings = self.settings.mapping().bundle();
        let both = keyframes.into_iter().zip(&state.frames);
        let frames = both.map(|(keyframe, state)| MappedFrame { keyframe, state: state.clone() }).collect();
        let mut bundle = BundleAdjustment::new(self.dataset.simd(), sensor, settings, frames);
        bundle.set_max_gaussians(parts.max_gaussians);
        writer.restore(parts.rows)?;
        let Counts { frames_on_map, late_frames, relocalisations } = parts.counts;
        let figures = SlamFigures {
            frames_on_map,
            late_frames,
            relocalisations,
            loops: parts.loops,
            retired_keyframes: parts.retired,
            live_frames_per_second: parts.live_frames_per_second,
            tracked_ate_m: parts.tracked_ate_m,
            ..SlamFigures::default()
        };
        let stopped = Some((parts.schedule_steps, parts.running, state));
        let (started, earlier) = (Instant::now(), parts.seconds);
        Ok(Refinement { bundle, writer, keeper, figures, stopped, started, earlier })
    }

    /// Refines the map and all paths together, and writes everything.
    fn refine(
        &self,
        refinement: Refinement,
        mut observe: impl FnMut(SlamProgress) -> ControlFlow<()>,
    ) -> Result<Summary, SlamError> {
        let Refinement { mut bundle, mut writer, keeper, figures, stopped, started, earlier } = refinement;
        // A run that is stopped from here on has a map, and poses to evaluate.
        writer.replace_earlier()?;
        writer.write_map(stopped.as_ref().map_or(&bundle.map, |(_, _, state)| &state.map))?;
        writer.flush()?;
        let (dataset, mapping) = (self.dataset, self.settings.mapping());
        let (exposures, records) = (writer.record().exposures(), writer.record().frames());
        let (finish, running) = match stopped {
            None => (Finish::new(dataset, &mut bundle, exposures, records, &mapping)?, Running::default()),
            Some((steps, running, state)) => {
                let finish = Finish::resume(dataset, &mut bundle, exposures, records, (&mapping, steps))?;
                bundle.restore(state);
                (finish, running)
            }
        };
        let seconds = || earlier + started.elapsed().as_secs_f64();
        let parts = refining_parts(&bundle, &writer, &figures);
        let keep = |state: BorrowedBundleState<'_>, running: Running| match &keeper {
            Some(keeper) => {
                let parts = RefiningParts { running, seconds: seconds(), ..parts.clone() };
                keeper.write(&Saving::Refining { parts: &parts, state })
            }
            None => Ok(()),
        };
        let checkpoint =
            keeper.as_ref().map(|keeper| Checkpoint { interval: keeper.interval(), keep: &keep });
        let observe = |progress: MapProgress| {
            observe(SlamProgress::Refinement { position: progress.position, psnr: progress.psnr })
        };
        let finished = finish.run(bundle, writer, (running, checkpoint, seconds), observe, |summary| {
            let frames_per_second = dataset.len() as f64 / seconds();
            summary.slam = Some(SlamFigures { frames_per_second, ..figures });
        });
        finished.map_err(|error| match error {
            MapError::Stopped => SlamError::Stopped,
            other => other.into(),
        })
    }
}

/// What a checkpoint of the refinement holds besides map, paths and figures of the steps, none of which have begun.
fn refining_parts(bundle: &BundleAdjustment, writer: &RunWriter, figures: &SlamFigures) -> RefiningParts {
    let SlamFigures { frames_on_map, late_frames, relocalisations, .. } = *figures;
    RefiningParts {
        rows: writer.record().rows(),
        keyframes: bundle.frames.iter().map(|frame| SavedKeyframe::from(&frame.keyframe)).collect(),
        max_gaussians: bundle.max_gaussians(),
        schedule_steps: bundle.schedule().steps(),
        running: Running::default(),
        counts: Counts { frames_on_map, late_frames, relocalisations },
        loops: figures.loops,
        retired: figures.retired_keyframes,
        live_frames_per_second: figures.live_frames_per_second,
        tracked_ate_m: figures.tracked_ate_m,
        seconds: 0.0,
    }
}
