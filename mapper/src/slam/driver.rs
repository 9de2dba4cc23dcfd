//! The run from start to end.

use std::ops::ControlFlow;
use std::thread;
use std::time::Instant;

use super::back_end::BackEnd;
use super::messages::link;
use super::settings::SlamSettings;
use super::{SlamError, front_end};
use crate::bundle::MapSize;
use crate::dataset::Dataset;
use crate::mapping::{Finish, MapError, MapProgress};
use crate::output::OutputFolder;
use crate::run::{RunSettings, RunWriter, SlamFigures, Summary, trajectory_figures};
use crate::tracking::{TrackingError, tracker_config};

/// Where a run stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SlamProgress {
    /// Frames come in.
    Frames {
        /// Frames so far.
        frames: usize,
        /// Keyframes of the map.
        keyframes: usize,
        /// How large the map is.
        map: MapSize,
        /// Loops that were closed.
        loops: usize,
    },
    /// The last frame was seen, all of the map is refined.
    Refinement {
        /// Share that is done, 0 to 1.
        position: f64,
        /// PSNR of blurred renderings against captured frames in dB.
        psnr: f64,
    },
}

/// Tracks and maps `dataset` at the same time into the RUN folder `out`. `describe` becomes the settings of the run;
/// `observe` is called after every frame and every step of the refinement, and says whether to go on.
///
/// # Errors
/// See [`SlamError`]. What was done before stays in `out`, and an earlier run until two frames were found.
pub fn run_slam(
    dataset: &Dataset,
    settings: &SlamSettings,
    out: OutputFolder,
    describe: RunSettings,
    mut observe: impl FnMut(SlamProgress) -> ControlFlow<()>,
) -> Result<Summary, SlamError> {
    let started = Instant::now();
    let config = tracker_config(dataset, &settings.tracking());
    config.validate().map_err(TrackingError::Camera)?;
    let mut writer = RunWriter::create(out, describe)?;
    dataset.warnings().iter().for_each(|warning| writer.warn(warning.to_string()));
    let mut back_end = BackEnd::new(dataset, &config, settings, writer);
    let (tracker_link, mapper_link) = link();
    thread::scope(|scope| {
        let tracking = scope.spawn(|| front_end::run(dataset, &config, settings.arrival, tracker_link));
        let mapped = back_end.run(mapper_link, &mut observe);
        let tracked = tracking.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        mapped?;
        Ok::<_, SlamError>(tracked?)
    })?;
    let live_seconds = started.elapsed().as_secs_f64();
    back_end.find_lost(dataset);
    let (grown, mut writer, figures) = back_end.finish();
    let mut bundle = grown.bundle;
    if bundle.state.map.is_empty() {
        return Err(MapError::NoDepth.into());
    }
    let frames = dataset.len() as f64;
    let figures = SlamFigures {
        live_frames_per_second: frames / live_seconds,
        tracked_ate_m: trajectory_figures(writer.exposures(), dataset).map(|figures| figures.ate_m.rmse),
        ..figures
    };
    // A run that is stopped from here on has a map, and poses to evaluate.
    writer.replace_earlier()?;
    writer.write_map(&bundle.state.map)?;
    writer.flush()?;
    let mapping = settings.mapping();
    let finish = Finish::new(dataset, &mut bundle, writer.exposures(), writer.frames(), &mapping)?;
    let observe = |progress: MapProgress| {
        observe(SlamProgress::Refinement { position: progress.position, psnr: progress.psnr })
    };
    let finished = finish.run(bundle, writer, started, observe, |summary| {
        let frames_per_second = frames / started.elapsed().as_secs_f64();
        summary.slam = Some(SlamFigures { frames_per_second, ..figures });
    });
    finished.map_err(|error| match error {
        MapError::Stopped => SlamError::Stopped,
        other => other.into(),
    })
}
