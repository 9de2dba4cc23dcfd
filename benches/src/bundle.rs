//! A bundle that is being adjusted: blurred frames of the synthetic room and a map seeded from them.

use mba_mapper::bundle::{
    BundleAdjustment, BundleSettings, FrameState, MapKeyframe, MapModel, MappedFrame, PathPrior, StepReport,
};
use mba_mapper::exposure::{ExposurePath, RowTiming};
use mba_mapper::map::MapKind;
use mba_mapper::sensor::{ObservationPyramid, Sensor};
use mba_mapper::synth::{SynthConfig, SynthError, SynthFrame, SynthSequence};
use mba_tracker::image::PixelRectangle;
use mba_tracker::photometric::InverseResponse;
use mba_tracker::simd::Level;

/// Virtual views of every step: the frames are blurred enough for more.
pub const VIEWS: usize = 5;

/// Frames of the sequence; those with enough blur become keyframes.
const FRAMES: usize = 8;

/// Mean blur of the sequence, pixels.
const BLUR_PX: f64 = 24.0;

/// Blur of every keyframe at the least, pixels: at full resolution there is a view per 4 of them.
const KEYFRAME_BLUR_PX: f64 = 18.0;

/// Where the schedule stays: full resolution, paths move, the density is final.
const POSITION: f64 = 0.7;

/// Steps on the way there, in which the map grows.
const GROWING: usize = 48;

/// Frames with true paths and the map they seed.
pub struct BundleInput {
    bundle: BundleAdjustment,
}

impl BundleInput {
    /// Renders the frames, seeds the map, and lets it grow up to a Gaussian per three pixels of an image.
    ///
    /// # Errors
    /// [`SynthError`] when the generator refuses the size.
    pub fn room(level: Level, width: usize, height: usize) -> Result<Self, SynthError> {
        let config = SynthConfig {
            frames: FRAMES,
            width,
            height,
            exposure_seconds: 0.03,
            mean_blur_px: BLUR_PX,
            ..SynthConfig::default()
        };
        let sequence = SynthSequence::new(config)?;
        let sensor = sensor(&sequence);
        let blurred = |index: &usize| sequence.blur(*index).mean_px > KEYFRAME_BLUR_PX;
        let frames: Vec<_> = (0..FRAMES).filter(blurred).map(|index| sequence.render_frame(index)).collect();
        let frames = (0..).zip(frames).filter_map(|(index, frame)| mapped(&sensor, index, frame)).collect();
        let kind = MapKind::Gaussians;
        let max_gaussians = width * height / 3;
        let settings = BundleSettings { kind, blur: true, max_views: VIEWS, max_gaussians, seed: 1 };
        let mut bundle = BundleAdjustment::new(level, sensor, settings, frames);
        bundle.seed();
        for k in 1..=GROWING {
            bundle.step(false, |_| POSITION * k as f64 / GROWING as f64);
        }
        Ok(Self { bundle })
    }

    /// Keyframes that are visited in turn.
    #[must_use]
    pub fn keyframes(&self) -> usize {
        self.bundle.frames.len()
    }

    /// Gaussians in the map.
    #[must_use]
    pub fn gaussians(&self) -> usize {
        self.bundle.map.size().gaussians()
    }

    /// One step on the next keyframe; the schedule does not move.
    pub fn step(&mut self) -> Option<StepReport> {
        self.bundle.step(false, |_| POSITION)
    }
}

/// The camera of a synthetic sequence.
pub(crate) fn sensor(sequence: &SynthSequence) -> Sensor {
    let camera = sequence.camera();
    Sensor {
        camera,
        inverse_response: InverseResponse::srgb(),
        depth_scale: 5000.0,
        region: PixelRectangle { left: 0, top: 0, right: camera.width, bottom: camera.height },
        rows: RowTiming::default(),
        falloff: None,
    }
}

fn mapped(sensor: &Sensor, index: usize, frame: SynthFrame) -> Option<MappedFrame> {
    let state = FrameState::new(ExposurePath::linear(frame.exposure));
    let prior = PathPrior { middle: frame.world_from_camera, is_measured: true, motion: None };
    let observation = ObservationPyramid::new(sensor, &frame.into_captured(index), 2)?;
    Some(MappedFrame { keyframe: MapKeyframe::new(index, observation, prior), state })
}
