//! A bundle that is being adjusted: blurred frames of the synthetic room and a map seeded from them.

use mba_mapper::bundle::{
    BundleAdjustment, BundleSettings, FrameState, Keyframe, ObservationPyramid, PathPrior, Sensor, StepReport,
};
use mba_mapper::dataset::RgbdFrame;
use mba_mapper::exposure::ExposurePath;
use mba_mapper::synth::{SynthConfig, SynthError, SynthFrame, SynthSequence};
use mba_tracker::image::PixelRectangle;
use mba_tracker::photometric::InverseResponse;
use mba_tracker::simd::Level;

/// Virtual views of every step: the frames are blurred enough for more.
pub const VIEWS: usize = 5;

/// Keyframes of the bundle.
const KEYFRAMES: usize = 4;

/// Mean blur, pixels: the stages that [`POSITION`] stands for would take one view per 4 of them.
const BLUR_PX: f64 = 24.0;

/// Where the schedule stays: full resolution, paths move.
const POSITION: f64 = 0.7;

/// Frames with true paths and the map they seed.
pub struct BundleInput {
    bundle: BundleAdjustment,
}

impl BundleInput {
    /// Renders the frames and seeds the map with as many Gaussians as a third of the pixels of an image.
    ///
    /// # Errors
    /// [`SynthError`] when the generator refuses the size.
    pub fn room(level: Level, width: usize, height: usize) -> Result<Self, SynthError> {
        let config =
            SynthConfig { frames: KEYFRAMES, width, height, mean_blur_px: BLUR_PX, ..SynthConfig::default() };
        let sequence = SynthSequence::new(config)?;
        let sensor = sensor(&sequence);
        let frames: Vec<_> = (0..KEYFRAMES).map(|index| sequence.render_frame(index)).collect();
        let states =
            frames.iter().map(|frame| FrameState::new(ExposurePath::linear(frame.exposure))).collect();
        let keyframes =
            (0..).zip(frames).filter_map(|(index, frame)| keyframe(&sensor, index, frame)).collect();
        let settings =
            BundleSettings { blur: true, max_views: VIEWS, max_gaussians: width * height / 3, seed: 1 };
        let mut bundle = BundleAdjustment::new(level, sensor, settings, keyframes, states);
        bundle.seed();
        bundle.state.position = POSITION;
        Ok(Self { bundle })
    }

    /// Gaussians in the map.
    #[must_use]
    pub fn gaussians(&self) -> usize {
        self.bundle.state.gaussians.len()
    }

    /// One step on the next keyframe; the schedule does not move.
    pub fn step(&mut self) -> Option<StepReport> {
        self.bundle.step(false, |_| POSITION)
    }
}

fn sensor(sequence: &SynthSequence) -> Sensor {
    let camera = sequence.camera();
    Sensor {
        camera,
        inverse_response: InverseResponse::srgb(),
        depth_scale: 5000.0,
        region: PixelRectangle { left: 0, top: 0, right: camera.width, bottom: camera.height },
    }
}

fn keyframe(sensor: &Sensor, index: usize, frame: SynthFrame) -> Option<Keyframe> {
    let prior = PathPrior { middle: frame.world_from_camera, motion: None };
    let captured = RgbdFrame {
        index,
        timestamp: frame.timestamp,
        exposure_seconds: frame.exposure_seconds,
        width: frame.width,
        height: frame.height,
        rgb: frame.rgb,
        depth: frame.depth,
    };
    let observation = ObservationPyramid::new(sensor, &captured, 2)?;
    Some(Keyframe::new(index, observation, prior))
}
