//! A stretch of the recording that is tracked again and again.

use std::ops::Range;

use mba_tracker::geometry::RigidTransform;
use mba_tracker::trajectory::ExposureTrajectory;
use mba_tracker::{FrameResult, FrameStatus, SimdLevel, Tracker, TrackerConfig};

use crate::dataset::{Dataset, RgbdFrame};
use crate::tracking::{TrackingOptions, tracker_config, tracker_view};

/// What is supposed about the camera while the window is tracked.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Guess {
    /// Exposure time of each frame of the data set, seconds.
    pub(super) exposures: Vec<f64>,
    /// Time from the first row of colour to the last, seconds.
    pub(super) readout: f64,
    /// Added to the timestamps of depth, seconds.
    pub(super) depth_delay: f64,
    /// Factor on the focal lengths on record.
    pub(super) focal_scale: f64,
}

impl Guess {
    /// What is on record, or usual where nothing is.
    pub(super) fn of(dataset: &Dataset) -> Self {
        Self {
            exposures: (0..dataset.len()).map(|index| dataset.exposure_seconds(index)).collect(),
            readout: dataset.calibration().readout.readout_seconds().unwrap_or(0.0),
            depth_delay: 0.0,
            focal_scale: 1.0,
        }
    }
}

/// What tracking found out about one frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tracked {
    /// Index in the data set.
    pub(super) index: usize,
    /// Mid exposure, seconds.
    pub(super) timestamp: f64,
    /// Whether it was aligned at all.
    pub(super) is_found: bool,
    /// Pose at mid exposure.
    pub(super) world_from_mid: RigidTransform,
    /// Poses at the ends of the exposure.
    pub(super) world_from_camera: ExposureTrajectory,
    /// Frame that it was aligned with.
    pub(super) reference: usize,
    /// Brightness relative to that frame.
    pub(super) gain: f64,
    /// Robust photometric residual, standard deviations of the nominal noise.
    pub(super) residual: f64,
}

/// Tracks frames of `dataset` with a supposed camera.
pub(super) fn config(dataset: &Dataset, options: &TrackingOptions, guess: &Guess) -> TrackerConfig {
    let mut config = tracker_config(dataset, options);
    config.readout.colour = guess.readout;
    config.readout.depth_apart |= guess.depth_delay != 0.0;
    config.camera.fx *= guess.focal_scale;
    config.camera.fy *= guess.focal_scale;
    config
}

/// Tracks whatever `frames` gives with `config`; frames that cannot be used are left out.
pub(super) fn track<T: std::borrow::Borrow<RgbdFrame>>(
    frames: impl Iterator<Item = T>,
    config: &TrackerConfig,
    guess: &Guess,
) -> Vec<Tracked> {
    let mut memory = vec![0; config.workspace_len()];
    let Ok(mut tracker) = Tracker::new(config, SimdLevel::new(), &mut memory) else { return Vec::new() };
    let mut found: Vec<Tracked> = Vec::new();
    for image in frames {
        let image = image.borrow();
        let Ok(mut view) = tracker_view(image) else { continue };
        view.exposure = guess.exposures.get(image.index).copied().unwrap_or(image.exposure_seconds);
        view.depth_timestamp += guess.depth_delay;
        let Ok(result) = tracker.track(&view) else { continue };
        if let Some(revision) = &result.revision
            && let Some(revised) = found.get_mut(revision.index)
        {
            revised.world_from_camera = revision.world_from_camera;
            revised.world_from_mid = revision.world_from_mid;
        }
        found.push(Tracked::of(image, &result, found.get(result.reference_index)));
    }
    found
}

impl Tracked {
    /// The tracker counts the frames it was given, so its reference is looked up.
    fn of(image: &RgbdFrame, result: &FrameResult, reference: Option<&Self>) -> Self {
        Self {
            index: image.index,
            timestamp: image.timestamp,
            is_found: result.status != FrameStatus::Lost,
            world_from_mid: result.world_from_mid,
            world_from_camera: result.world_from_camera,
            reference: reference.map_or(image.index, |reference| reference.index),
            gain: f64::from(result.brightness.gain),
            residual: f64::from(result.residual),
        }
    }
}

/// Frames in memory.
#[derive(Debug)]
pub(super) struct Window {
    frames: Vec<RgbdFrame>,
}

impl Window {
    /// Decodes the frames of `range`; unreadable ones are left out.
    pub(super) fn read(dataset: &Dataset, range: Range<usize>) -> Self {
        Self { frames: range.filter_map(|index| dataset.frame(index).ok()).collect() }
    }

    /// The frame with this index of the data set; none if it is not in the window or was unreadable.
    pub(super) fn frame(&self, index: usize) -> Option<&RgbdFrame> {
        let place = self.frames.binary_search_by_key(&index, |frame| frame.index).ok()?;
        self.frames.get(place)
    }

    /// Tracks the window with a supposed camera.
    pub(super) fn track(&self, dataset: &Dataset, options: &TrackingOptions, guess: &Guess) -> Vec<Tracked> {
        track(self.frames.iter(), &config(dataset, options, guess), guess)
    }
}
