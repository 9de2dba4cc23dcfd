//! A synthetic recording at 640x480: a shaking hand in a room, about ten pixels of blur, sensor noise.

use mba_mapper::synth::{
    DepthSensor, NoiseModel, SceneName, SynthConfig, SynthError, SynthFrame, SynthSequence,
};
use mba_tracker::error::FrameError;
use mba_tracker::image::{ColourView, DepthView, PixelFormat};
use mba_tracker::photometric::InverseResponse;
use mba_tracker::{Frame, TrackerConfig};

/// Frames with the tracker's configuration for them.
pub struct Recording {
    /// Defaults for this camera.
    pub config: TrackerConfig,
    /// Frames at 30 Hz.
    pub frames: Vec<SynthFrame>,
}

impl Recording {
    /// Renders `frames` frames.
    ///
    /// # Errors
    /// [`SynthError`] when the generator refuses the settings.
    pub fn new(frames: usize) -> Result<Self, SynthError> {
        let synth = SynthConfig {
            scene: SceneName::Room,
            frames,
            mean_blur_px: 10.0,
            noise: Some(NoiseModel::default()),
            depth: DepthSensor::Exact,
            ..SynthConfig::default()
        };
        let sequence = SynthSequence::new(synth)?;
        let config = TrackerConfig::new(sequence.camera(), 1.0 / 5000.0, InverseResponse::srgb());
        Ok(Self { config, frames: (0..frames).map(|index| sequence.render_frame(index)).collect() })
    }

    /// Index of frame `k` of an endless recording that runs to and fro.
    #[must_use]
    pub fn to_and_fro(&self, k: usize) -> usize {
        let last = self.frames.len() - 1;
        let phase = k % (2 * last);
        phase.min(2 * last - phase)
    }

    /// Frame `index` as the tracker takes it, at time `timestamp`.
    ///
    /// # Errors
    /// [`FrameError`] never, unless the generator broke its contract.
    pub fn view(&self, index: usize, timestamp: f64) -> Result<Frame<'_>, FrameError> {
        let frame = &self.frames[index];
        let (width, height) = (frame.width, frame.height);
        Ok(Frame {
            timestamp,
            depth_timestamp: timestamp,
            exposure: frame.exposure_seconds,
            colour: ColourView::new(&frame.rgb, width, height, 3 * width, PixelFormat::Rgb8)?,
            depth: DepthView::new(&frame.depth, width, height, width)?,
            angular_velocity: None,
            gyro: None,
            expected_path: None,
        })
    }
}
