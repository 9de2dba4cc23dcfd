//! A recording from its first frame to its last.

use std::ops::ControlFlow;
use std::time::Instant;

use mba_io::dataset::{Dataset, RgbdFrame};
use mba_io::trajectory_file::TimedExposure;
use mba_tracker::error::FrameError as TrackError;
use mba_tracker::geometry::PinholeCamera;
use mba_tracker::{FrameResult, Tracker, TrackerConfig};

use super::KnownMap;
use crate::run::{FrameRecord, FrameStatus, LocalisationFigures, Reason, RunError, RunWriter};
use crate::slam::SharpView;
use crate::tracking::{add_gyroscope, held, record, timed, timed_result, tracker_view};

/// Why [`localise`] stopped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LocaliseError {
    /// The data set's camera cannot be tracked with.
    #[error("the tracker cannot use this camera: {0}")]
    Camera(mba_tracker::error::ConfigError),
    /// Whoever watches asked for it; the folder is up to date.
    #[error("stopped on request")]
    Stopped,
    /// The results cannot be written.
    #[error(transparent)]
    Run(#[from] RunError),
}

/// Finds every frame of `dataset` in `map` and pushes it to `run`, with poses in the world of the map; `observe` is called
/// after each and says whether to go on. A frame that cannot be found is lost. The result does not depend on threads.
///
/// # Errors
/// See [`LocaliseError`]; what was found before stays in `run`.
pub fn localise(
    dataset: &Dataset,
    config: &TrackerConfig,
    map: &mut KnownMap<'_>,
    run: &mut RunWriter,
    mut observe: impl FnMut() -> ControlFlow<()>,
) -> Result<LocalisationFigures, LocaliseError> {
    let mut memory = vec![0; config.workspace_len()];
    let tracker = Tracker::new(config, dataset.simd(), &mut memory).map_err(LocaliseError::Camera)?;
    let figures = LocalisationFigures { places: map.places(), ..LocalisationFigures::default() };
    let camera = dataset.calibration().camera;
    let mut localiser =
        Localiser { dataset, camera, tracker, map, given: Vec::new(), state: State::Unknown, figures };
    for index in 0..dataset.len() {
        localiser.take(index, run)?;
        if observe().is_break() {
            run.flush()?;
            return Err(LocaliseError::Stopped);
        }
    }
    localiser.recover_lost(run);
    Ok(localiser.figures)
}

/// What is known of the camera's place.
#[derive(Clone, Copy)]
enum State {
    /// Nothing yet.
    Unknown,
    /// The last frame that was found, and whether it can be trusted.
    Found(TimedExposure, bool),
    /// The frame before was lost; the last one that was found.
    Lost(TimedExposure),
}

struct Localiser<'a, 'm, 's> {
    dataset: &'a Dataset,
    camera: PinholeCamera,
    tracker: Tracker<'m>,
    map: &'a mut KnownMap<'s>,
    /// Index in the data set of every frame that the tracker was given.
    given: Vec<usize>,
    state: State,
    figures: LocalisationFigures,
}

impl Localiser<'_, '_, '_> {
    /// Finds one frame and pushes it.
    fn take(&mut self, index: usize, run: &mut RunWriter) -> Result<(), RunError> {
        let begin = Instant::now();
        let timestamp = self.dataset.timestamp(index);
        let image = match self.dataset.frame(index) {
            Ok(image) => image,
            Err(reason) => return skip(index, timestamp, &reason.to_string(), run),
        };
        match self.find(index, &image) {
            Ok(Some(result)) => {
                if let Some(revision) = &result.revision
                    && let Some(revised) = self.given.get(revision.index)
                {
                    let time = self.dataset.timestamp(*revised);
                    let exposure = timed(time, &revision.world_from_camera, &revision.world_from_mid);
                    run.record_mut().revise(*revised, exposure, f64::from(revision.blur));
                }
                self.given.push(index);
                let exposure = timed_result(&result);
                self.state = match (result.status, self.state) {
                    (FrameStatus::Lost, State::Unknown) => State::Unknown,
                    (FrameStatus::Lost, State::Found(last, _) | State::Lost(last)) => State::Lost(last),
                    (status, _) => State::Found(exposure, status == FrameStatus::Ok),
                };
                run.push(exposure, record(&result, begin.elapsed().as_secs_f64() * 1e3))
            }
            Ok(None) => {
                let (exposure, record) = held(timestamp, run.record().exposures().last());
                let ms = begin.elapsed().as_secs_f64() * 1e3;
                run.push(exposure, FrameRecord { ms, reason: Some(Reason::NoMatch), ..record })
            }
            Err(reason) => skip(index, timestamp, &reason.to_string(), run),
        }
    }

    /// Tracks a frame from where the camera was before, or from the place that it is recognised in; none where the camera has
    /// been in no place of the map so far.
    fn find(&mut self, index: usize, image: &RgbdFrame) -> Result<Option<FrameResult>, TrackError> {
        match self.state {
            State::Unknown => {
                let Some(view) = self.map.find(image) else { return Ok(None) };
                // Nothing that was tried before counts.
                self.tracker.reset();
                self.given.clear();
                self.start_from(&view)?;
            }
            State::Lost(_) => {
                if let Some(view) = self.map.find(image) {
                    self.start_from(&view)?;
                }
            }
            State::Found(last, is_trusted) => {
                if let Some(view) = self.map.view(&last.mid).filter(|_| is_trusted) {
                    self.tracker.set_reference(&view.reference(&self.camera)?)?;
                    self.figures.frames_on_map += 1;
                }
            }
        }
        let mut frame = tracker_view(image)?;
        let previous = index.checked_sub(1).filter(|previous| self.given.last() == Some(previous));
        add_gyroscope(&mut frame, self.dataset, previous);
        self.tracker.track(&frame).map(Some)
    }

    /// Lets the tracker go on at a place that was recognised.
    fn start_from(&mut self, view: &SharpView) -> Result<(), TrackError> {
        let start = view.start_from.unwrap_or(view.world_from_camera);
        self.tracker.relocate(&view.reference(&self.camera)?, &start)?;
        self.figures.recognised += 1;
        self.figures.frames_on_map += 1;
        Ok(())
    }

    /// Looks for lost frames around where those after them and before them were found.
    fn recover_lost(&mut self, run: &mut RunWriter) {
        let frames = run.record().frames().len();
        for index in (0..frames).rev() {
            self.recover(index, Some(index + 1).filter(|beside| *beside < frames), run);
        }
        for index in 0..frames {
            self.recover(index, index.checked_sub(1), run);
        }
    }

    /// Looks for frame `index`, if it is lost, around the frame `beside` it, if that is not lost.
    fn recover(&mut self, index: usize, beside: Option<usize>, run: &mut RunWriter) {
        let is_lost = |index: usize| run.record().frames()[index].status == FrameStatus::Lost;
        let Some(beside) = beside.filter(|beside| is_lost(index) && !is_lost(*beside)) else { return };
        let pose = run.record().exposures()[beside].mid;
        let Ok(image) = self.dataset.frame(index) else { return };
        let found = self.map.find_near(&image, &pose).and_then(|view| view.start_from);
        if let Some(pose) = found {
            run.record_mut().recover(index, &pose);
            self.figures.recovered += 1;
        }
    }
}

/// Pushes a frame that could not be tried.
fn skip(index: usize, timestamp: f64, reason: &str, run: &mut RunWriter) -> Result<(), RunError> {
    run.record_mut().warn(format!("frame {index} skipped: {reason}"));
    let (exposure, record) = held(timestamp, run.record().exposures().last());
    run.push_skipped(exposure, record)
}
