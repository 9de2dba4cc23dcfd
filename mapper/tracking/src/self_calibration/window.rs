//! A stretch of the recording that is tracked again and again.

use std::borrow::Borrow;
use std::ops::Range;

use mba_io::dataset::{Dataset, RgbdFrame};
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::trajectory::ExposureTrajectory;
use mba_tracker::{FrameResult, FrameStatus, SimdLevel, Tracker, TrackerConfig};
use rayon::prelude::*;

use super::reduced::{reduced, usual_level};
use super::robust::median;
use crate::tracking::{TrackingOptions, reduced_tracker_config, tracker_view};

/// What is supposed about the camera while the window is tracked.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Guess {
    /// Exposure time of each frame of the data set, seconds.
    pub(super) exposures: Vec<f64>,
    /// Time from the first row of colour to the last, seconds.
    pub(super) readout: f64,
    /// The same of depth.
    pub(super) depth_readout: f64,
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
            depth_readout: dataset.calibration().depth_readout_seconds,
            depth_delay: 0.0,
            focal_scale: 1.0,
        }
    }
}

/// What is supposed, and what tracking a window with it found.
#[derive(Clone, Debug)]
pub(super) struct Probe {
    pub(super) guess: Guess,
    pub(super) tracked: Vec<Tracked>,
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

/// Tracks whatever `frames` gives with `config` and the instructions `simd`; frames that cannot be used are left out.
fn track<T: Borrow<RgbdFrame>>(
    simd: SimdLevel,
    frames: impl Iterator<Item = T>,
    config: &TrackerConfig,
    guess: &Guess,
) -> Vec<Tracked> {
    let mut memory = vec![0; config.workspace_len()];
    let Ok(mut tracker) = Tracker::new(config, simd, &mut memory) else { return Vec::new() };
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

/// Frames of a window, at the most, and windows of a long recording of which the liveliest is taken.
const WINDOW: usize = 60;
const CANDIDATES: usize = 5;

/// Frames that are decoded together.
const CHUNK: usize = 32;

/// A data set and how it is tracked.
#[derive(Clone, Copy, Debug)]
pub(super) struct Recording<'a> {
    pub(super) dataset: &'a Dataset,
    pub(super) options: &'a TrackingOptions,
}

/// Resolution of the frames that are tracked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Resolution {
    /// As they were recorded, or not much more than 640 pixels wide.
    Fine,
    /// A quarter of those pixels: faster, for large motions.
    Coarse,
}

impl<'a> Recording<'a> {
    /// Decodes the frames of `range`, their resolution halved `level` times; unreadable ones are left out.
    pub(super) fn read(&self, range: Range<usize>, level: usize) -> Vec<RgbdFrame> {
        let read = |index| Some(reduced(self.dataset.frame(index).ok()?, level));
        range.into_par_iter().filter_map(read).collect()
    }

    /// Tracks `frames`, whose resolution was halved `level` times, with a supposed camera.
    pub(super) fn track(&self, frames: &[RgbdFrame], level: usize, guess: &Guess) -> Vec<Tracked> {
        track(self.dataset.simd(), frames.iter(), &self.config(level, guess), guess)
    }

    /// Tracks the whole data set at coarse resolution; only a few frames are in memory at a time.
    pub(super) fn track_everything(&self, guess: &Guess) -> Vec<Tracked> {
        let (frames, level) = (self.dataset.len(), self.level(Resolution::Coarse));
        let chunk = |start: usize| self.read(start..frames.min(start + CHUNK), level);
        let images = (0..frames).step_by(CHUNK).flat_map(chunk);
        track(self.dataset.simd(), images, &self.config(level, guess), guess)
    }

    /// The stretch of the recording that turns most, tracked at coarse resolution.
    pub(super) fn liveliest(&self, guess: Guess) -> (Window<'a>, Probe) {
        let stretches = stretches(self.dataset.len());
        if let [whole] = &stretches[..] {
            let window = Window::read(*self, whole.clone());
            let probe = window.probe(Resolution::Coarse, guess);
            return (window, probe);
        }
        let level = self.level(Resolution::Coarse);
        let track =
            |range: Range<usize>| (self.track(&self.read(range.clone(), level), level, &guess), range);
        let tracked: Vec<(Vec<Tracked>, Range<usize>)> = stretches.into_iter().map(track).collect();
        let best = tracked.into_iter().max_by(|a, b| liveliness(&a.0).total_cmp(&liveliness(&b.0)));
        let (tracked, range) = best.unwrap_or_default();
        (Window::read(*self, range), Probe { guess, tracked })
    }

    /// How often the resolution is halved.
    fn level(&self, resolution: Resolution) -> usize {
        let coarse = usual_level(&self.dataset.calibration().camera);
        match resolution {
            Resolution::Fine => coarse.saturating_sub(1),
            Resolution::Coarse => coarse,
        }
    }

    fn config(&self, level: usize, guess: &Guess) -> TrackerConfig {
        let mut config = reduced_tracker_config(self.dataset, self.options, level);
        config.readout.colour = guess.readout;
        config.readout.depth = guess.depth_readout;
        config.readout.depth_apart |= guess.depth_delay != 0.0;
        config.camera.fx *= guess.focal_scale;
        config.camera.fy *= guess.focal_scale;
        config
    }
}

/// Stretches of a recording of so many frames of which one may become the window: all of it if it is short.
fn stretches(frames: usize) -> Vec<Range<usize>> {
    let count = (frames / WINDOW).clamp(1, CANDIDATES);
    let length = WINDOW.min(frames);
    let start = |k: usize| k * (frames - length) / (count - 1).max(1);
    (0..count).map(|k| start(k)..start(k) + length).collect()
}

/// Median angle that the camera turns from frame to frame, radians.
fn liveliness(tracked: &[Tracked]) -> f64 {
    let turn = |pair: &[Tracked]| {
        let motion = pair[0].world_from_mid.tangent_to(&pair[1].world_from_mid);
        if pair[0].is_found && pair[1].is_found { motion.fixed_rows::<3>(3).norm() } else { 0.0 }
    };
    median(&tracked.windows(2).map(turn).collect::<Vec<_>>()).unwrap_or(0.0)
}

/// A stretch of the recording in memory.
#[derive(Debug)]
pub(super) struct Window<'a> {
    pub(super) recording: Recording<'a>,
    fine: Vec<RgbdFrame>,
    coarse: Vec<RgbdFrame>,
    length: usize,
}

impl<'a> Window<'a> {
    fn read(recording: Recording<'a>, range: Range<usize>) -> Self {
        let levels = [Resolution::Fine, Resolution::Coarse].map(|resolution| recording.level(resolution));
        let length = range.len();
        let fine = recording.read(range, levels[0]);
        let coarse = fine.par_iter().map(|frame| reduced(frame.clone(), levels[1] - levels[0])).collect();
        Self { recording, fine, coarse, length }
    }

    /// Whether it is the whole data set.
    pub(super) fn is_whole(&self) -> bool {
        self.length == self.recording.dataset.len()
    }

    /// The fine frame with this index of the data set; none if it is not in the window or was unreadable.
    pub(super) fn frame(&self, index: usize) -> Option<&RgbdFrame> {
        let place = self.fine.binary_search_by_key(&index, |frame| frame.index).ok()?;
        self.fine.get(place)
    }

    /// The camera of the fine frames.
    pub(super) fn camera(&self) -> PinholeCamera {
        self.recording.dataset.calibration().camera.at_level(self.recording.level(Resolution::Fine))
    }

    /// Squared distance of a pixel of the fine frames from the middle of the stored image, 1 in its corners.
    pub(super) fn stored_radius_squared(&self, [u, v]: [f64; 2]) -> f64 {
        let level = self.recording.level(Resolution::Fine);
        let at = |pixel: f64| f64::from(PinholeCamera::pixel_at_level(pixel as f32, level, 0));
        self.recording.dataset.stored_radius_squared(at(u), at(v))
    }

    /// Tracks the window with a supposed camera.
    pub(super) fn probe(&self, resolution: Resolution, guess: Guess) -> Probe {
        let frames = match resolution {
            Resolution::Fine => &self.fine,
            Resolution::Coarse => &self.coarse,
        };
        Probe { tracked: self.recording.track(frames, self.recording.level(resolution), &guess), guess }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_recording_has_a_few_stretches_from_start_to_end() {
        let starts = |frames| stretches(frames).iter().map(|range| range.start).collect::<Vec<_>>();
        assert_eq!((starts(40), stretches(40)[0].end), (vec![0], 40));
        assert_eq!((starts(100), stretches(100)[0].end), (vec![0], 60));
        assert_eq!((starts(130), stretches(130)[1].end), (vec![0, 70], 130));
        assert_eq!((starts(1060), stretches(1060)[4].end), (vec![0, 250, 500, 750, 1000], 1060));
    }
}
