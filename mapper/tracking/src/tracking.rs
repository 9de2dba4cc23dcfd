//! Tracking a whole data set into a RUN folder.

mod saved;
mod upright;

use std::ops::ControlFlow;
use std::time::Instant;

use mba_io::dataset::{Dataset, FrameReadError, RgbdFrame};
use mba_io::trajectory_file::TimedExposure;
use mba_tracker::error::{ConfigError, FrameError as TrackError};
use mba_tracker::geometry::RigidTransform;
use mba_tracker::image::{ColourView, DepthView, PixelFormat};
use mba_tracker::trajectory::ExposureTrajectory;
use mba_tracker::{
    Doubt, Frame, FrameResult, GyroReading, Readout, ReferenceMode, Revision, Tracker, TrackerConfig,
};

use crate::run::{FrameRecord, FrameStatus, Reason, RunError, RunWriter};
pub use crate::uncertainty::Measured;
use crate::uncertainty::Uncertainty;
use mba_io::checkpoint::CheckpointError;
pub use saved::TrackingCheckpoint;
pub use upright::upright_world;

/// What can be chosen about the tracker; everything else follows from the data set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackingOptions {
    /// Whether motion during the exposure is modelled.
    pub blur: bool,
    /// Upper bound of virtual views per exposure; `None` for the tracker's own.
    pub virtual_views: Option<usize>,
    /// Where the sharp reference comes from.
    pub reference: ReferenceMode,
    /// Whether the depth map of each frame takes part.
    pub depth_term: bool,
}

impl Default for TrackingOptions {
    fn default() -> Self {
        Self { blur: true, virtual_views: None, reference: ReferenceMode::Deblurred, depth_term: true }
    }
}

/// Why tracking a data set stopped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrackingError {
    /// The data set's camera cannot be tracked with.
    #[error("the tracker cannot use this camera: {0}")]
    Camera(ConfigError),
    /// Whoever watches asked for it; the folder is up to date.
    #[error("stopped on request")]
    Stopped,
    /// The results cannot be written.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A checkpoint cannot be written, or gone on from.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

/// What is known of a tracked recording beside its run.
#[derive(Clone, Debug)]
pub struct Tracked {
    /// How far picture and depth contradict each other in the median frame, see [`FrameResult::disagreement`].
    pub disagreement: f64,
    /// What each frame of the data set was aligned with.
    pub measured: Vec<Measured>,
}

/// The tracker's configuration for a data set.
#[must_use]
pub fn tracker_config(dataset: &Dataset, options: &TrackingOptions) -> TrackerConfig {
    reduced_tracker_config(dataset, options, 0)
}

/// The tracker's configuration for the frames of a data set with their resolution halved `level` times.
pub fn reduced_tracker_config(dataset: &Dataset, options: &TrackingOptions, level: usize) -> TrackerConfig {
    let calibration = dataset.calibration();
    let metres_per_unit = (1.0 / calibration.depth_scale) as f32;
    let camera = calibration.camera.at_level(level);
    let mut config = TrackerConfig::new(camera, metres_per_unit, calibration.response.inverse());
    config.vignetting = dataset.vignetting();
    config.region = dataset.region_with_source().at_level(level);
    config.reference = options.reference;
    config.align.blur = options.blur;
    config.align.depth_term = options.depth_term;
    // What is unknown is taken for zero: a run that claims nothing about rows is that of a global shutter.
    config.readout = Readout {
        colour: calibration.readout.readout_seconds().unwrap_or(0.0),
        depth: calibration.depth_readout_seconds,
        depth_apart: depth_is_apart(dataset),
        bands: Readout::GLOBAL.bands,
    };
    config.align.max_views =
        options.virtual_views.unwrap_or(config.align.max_views).min(config.align.max_views);
    config
}

/// Time between colour and depth, seconds, that moves nothing: a tenth of a pixel at the speed of a shaking hand.
const SAME_TIME: f64 = 1e-3;

/// Whether any depth image was taken at another time than its colour image.
fn depth_is_apart(dataset: &Dataset) -> bool {
    let apart = |index| (dataset.depth_timestamp(index) - dataset.timestamp(index)).abs();
    (0..dataset.len()).any(|index| apart(index) > SAME_TIME)
}

/// Tracks every frame of `dataset` in order and pushes it to `run`; `observe` is called after each with its record
/// and says whether to go on.
///
/// A frame that cannot be read or used is skipped: it keeps the pose before it, counts as lost, and `run` gets a
/// warning that says why. Nothing here depends on threads; the times are of the tracker alone, without reading images.
///
/// # Errors
/// See [`TrackingError`]; what was tracked before stays in `run`.
pub fn track_dataset(
    dataset: &Dataset,
    options: &TrackingOptions,
    run: &mut RunWriter,
    observe: impl FnMut(&FrameRecord) -> ControlFlow<()>,
) -> Result<(), TrackingError> {
    track_and_keep(dataset, options, run, None, observe).map(|_| ())
}

/// As [`track_dataset`], with checkpoints: the run goes on from the one that was read, if there is one, and ends as if it
/// had never been stopped. One is written from time to time, and when `observe` asks for an end.
///
/// # Errors
/// As [`track_dataset`].
pub fn track_and_keep(
    dataset: &Dataset,
    options: &TrackingOptions,
    run: &mut RunWriter,
    mut checkpoint: Option<&mut TrackingCheckpoint>,
    mut observe: impl FnMut(&FrameRecord) -> ControlFlow<()>,
) -> Result<Tracked, TrackingError> {
    let config = tracker_config(dataset, options);
    config.validate().map_err(TrackingError::Camera)?;
    // Without images the size of the camera is a mere claim, for which no memory is taken.
    let has_images = dataset.has_images();
    let mut memory = vec![0; if has_images { config.workspace_len() } else { 0 }];
    let tracker = has_images.then(|| Tracker::new(&config, dataset.simd(), &mut memory)).transpose();
    let mut tracker = tracker.map_err(TrackingError::Camera)?;
    let mut uncertainty = Uncertainty::default();
    let first = match (&mut checkpoint, &mut tracker) {
        (Some(checkpoint), Some(tracker)) => checkpoint.restore(tracker, &mut uncertainty, run)?,
        _ => 0,
    };
    // The tracker counts the frames it was given, the run those of the data set.
    let was_given =
        |(index, record): (usize, &FrameRecord)| (record.reason != Some(Reason::Skipped)).then_some(index);
    let mut given: Vec<usize> = run.record().frames().iter().enumerate().filter_map(was_given).collect();
    for index in first..dataset.len() {
        let record = match track_frame(tracker.as_mut(), dataset, index, given.last().copied()) {
            Ok((result, ms)) => {
                // A checkpoint may have a revision of a frame that it does not have.
                if let Some(revision) = &result.revision
                    && let Some(revised) = given.get(revision.index)
                {
                    revise(dataset, run, *revised, revision);
                }
                given.push(index);
                let record = FrameRecord { sigma_m: uncertainty.add(&result), ..record(&result, ms) };
                run.push(timed_result(&result), record)?;
                record
            }
            Err(reason) => {
                run.record_mut().warn(format!("frame {index} skipped: {reason}"));
                let (exposure, record) = held(dataset.timestamp(index), run.record().exposures().last());
                run.push_skipped(exposure, record)?;
                record
            }
        };
        let is_stopped = observe(&record).is_break();
        if is_stopped {
            run.flush()?;
        }
        if let (Some(checkpoint), Some(tracker)) = (&mut checkpoint, &mut tracker)
            && (is_stopped || checkpoint.is_due(index + 1 == dataset.len()))
        {
            checkpoint.write(tracker, &uncertainty, run)?;
        }
        if is_stopped {
            return Err(TrackingError::Stopped);
        }
    }
    let mut covariances = vec![None; dataset.len()];
    for (&index, covariance) in given.iter().zip(uncertainty.covariances()) {
        covariances[index] = covariance;
    }
    run.record_mut().set_covariances(covariances);
    Ok(Tracked {
        disagreement: uncertainty.disagreement(),
        measured: by_frame(dataset.len(), &given, &uncertainty),
    })
}

/// What each of `frames` frames was aligned with, of which the tracker was `given` some.
fn by_frame(frames: usize, given: &[usize], uncertainty: &Uncertainty) -> Vec<Measured> {
    let mut measured: Vec<Measured> =
        (0..frames).map(|reference| Measured { reference, ..Measured::default() }).collect();
    for (&index, of_frame) in given.iter().zip(uncertainty.measured(given)) {
        measured[index] = of_frame;
    }
    measured
}

/// Replaces what `run` has of frame `index`.
fn revise(dataset: &Dataset, run: &mut RunWriter, index: usize, revision: &Revision) {
    let Revision { world_from_camera, world_from_mid, blur, index: _ } = revision;
    run.record_mut().revise(
        index,
        timed(dataset.timestamp(index), world_from_camera, world_from_mid),
        f64::from(*blur),
    );
}

/// Why one frame was skipped.
#[derive(Debug, thiserror::Error)]
enum SkipReason {
    #[error(transparent)]
    Unreadable(#[from] FrameReadError),
    #[error(transparent)]
    Unusable(#[from] TrackError),
    #[error("there were no images when the data set was opened")]
    NoImages,
}

fn track_frame(
    tracker: Option<&mut Tracker<'_>>,
    dataset: &Dataset,
    index: usize,
    previous: Option<usize>,
) -> Result<(FrameResult, f64), SkipReason> {
    let image = dataset.frame(index)?;
    let tracker = tracker.ok_or(SkipReason::NoImages)?;
    let mut frame = tracker_view(&image)?;
    add_gyroscope(&mut frame, dataset, previous);
    let begin = Instant::now();
    let result = tracker.track(&frame)?;
    Ok((result, begin.elapsed().as_secs_f64() * 1e3))
}

/// The three poses of an exposure whose ends are those of `path`.
pub fn timed(timestamp: f64, path: &ExposureTrajectory, world_from_mid: &RigidTransform) -> TimedExposure {
    TimedExposure { timestamp, start: path.start, mid: *world_from_mid, end: path.end }
}

/// The three poses of a tracked frame.
pub fn timed_result(result: &FrameResult) -> TimedExposure {
    timed(result.timestamp, &result.world_from_camera, &result.world_from_mid)
}

/// A frame as the tracker takes it.
///
/// # Errors
/// When an image has no pixels, or not as many values as width and height say.
pub fn tracker_view(image: &RgbdFrame) -> Result<Frame<'_>, TrackError> {
    // Images of a data set have no padding: a row is as long as its pixels.
    let (width, height) = (image.width, image.height);
    Ok(Frame {
        timestamp: image.timestamp,
        exposure: image.exposure_seconds,
        depth_timestamp: image.depth_timestamp,
        colour: ColourView::new(&image.rgb, width, height, 3 * width, PixelFormat::Rgb8)?,
        depth: DepthView::new(&image.depth, width, height, width)?,
        angular_velocity: None,
        gyro: None,
        expected_path: None,
    })
}

/// Half of the time over which the turning around mid exposure is averaged, seconds: a few samples of a telephone's
/// gyroscope, and less than a hand needs to change direction.
const GYRO_HALF_WINDOW: f64 = 0.006;

/// Gives a frame what the data set's gyroscope, if there is one, says of the turning around it and since frame `previous`.
pub fn add_gyroscope(frame: &mut Frame, dataset: &Dataset, previous: Option<usize>) {
    let Some(imu) = dataset.imu() else { return };
    let time = frame.timestamp;
    frame.angular_velocity =
        previous.and_then(|index| imu.mean_angular_velocity(dataset.timestamp(index), time));
    let before = imu.mean_angular_velocity(time - GYRO_HALF_WINDOW, time);
    let after = imu.mean_angular_velocity(time, time + GYRO_HALF_WINDOW);
    frame.gyro = before.zip(after).map(|(before, after)| GyroReading {
        angular_velocity: (before + after) * 0.5,
        angular_acceleration: (after - before) / GYRO_HALF_WINDOW,
    });
}

/// What is recorded of a frame that took `ms` milliseconds.
pub fn record(result: &FrameResult, ms: f64) -> FrameRecord {
    // Counts of the table have 32 bits.
    let count = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    FrameRecord {
        timestamp: result.timestamp,
        status: result.status,
        keyframe: u8::from(result.is_keyframe),
        ms,
        blur_px: f64::from(result.blur),
        virtual_views: count(result.virtual_views),
        iterations: count(result.iterations),
        residual: f64::from(result.residual),
        inliers: f64::from(result.inliers),
        gain: f64::from(result.brightness.gain),
        sigma_m: None,
        reason: result.doubt.map(reason),
    }
}

fn reason(doubt: Doubt) -> Reason {
    match doubt {
        Doubt::Blind => Reason::Blind,
        Doubt::NoStart => Reason::NoStart,
        Doubt::NoMatch => Reason::NoMatch,
        Doubt::Speed => Reason::Speed,
        Doubt::Brightness => Reason::Brightness,
        Doubt::Inliers => Reason::Inliers,
        Doubt::Residual => Reason::Residual,
        Doubt::FoundAgain => Reason::FoundAgain,
    }
}

/// The stand-in for a frame without a result: a camera that stays where it was.
pub fn held(timestamp: f64, last: Option<&TimedExposure>) -> (TimedExposure, FrameRecord) {
    let pose = last.map_or_else(RigidTransform::identity, |exposure| exposure.mid);
    let exposure = TimedExposure { timestamp, start: pose, mid: pose, end: pose };
    let record = FrameRecord {
        reason: Some(Reason::Skipped),
        ..FrameRecord::without_figures(timestamp, FrameStatus::Lost)
    };
    (exposure, record)
}
