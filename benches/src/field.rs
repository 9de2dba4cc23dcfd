//! A tri-plane field that has begun to take the shape of the synthetic room, and a frame to compare it with.

use mba_mapper::exposure::ExposurePath;
use mba_mapper::losses::{Exposure, ExposureLoss};
use mba_mapper::sensor::{Observation, ObservationPyramid};
use mba_mapper::synth::{SynthConfig, SynthError, SynthSequence};
use mba_mapper::triplane::{
    FieldExposure, FieldLoss, FieldSettings, FieldStep, FieldWeights, Region, SamplingSettings, TriplaneAdam,
    TriplaneField,
};
use mba_tracker::simd::Level;

use crate::bundle::sensor;

/// Pixels that are compared in a step.
pub const PIXELS: usize = 1024;

/// Virtual views of a step.
pub const VIEWS: usize = 5;

/// Steps before anything is measured: surfaces are where they belong.
const STEPS: u64 = 150;

/// A field in training.
pub struct FieldInput {
    field: TriplaneField,
    field_loss: FieldLoss,
    seen: Observation,
    path: ExposurePath,
}

impl FieldInput {
    /// Renders a frame and trains a field on it with the instruction set `level`.
    ///
    /// # Errors
    /// [`SynthError`] when the generator refuses its settings.
    pub fn room(level: Level) -> Result<Self, SynthError> {
        let config = SynthConfig { frames: 2, width: 320, height: 240, ..SynthConfig::default() };
        let sequence = SynthSequence::new(config)?;
        let (sensor, frame) = (sensor(&sequence), sequence.render_frame(0));
        let path = ExposurePath::linear(frame.exposure);
        let pyramid = ObservationPyramid::new(&sensor, &frame.into_captured(0), 1);
        let seen = pyramid.expect("a frame has the size of its camera").level(0).clone();
        let field = TriplaneField::new(around(&seen, &path), FieldSettings::default(), 1);
        let mut input = Self { field, field_loss: FieldLoss::new(level, &sensor), seen, path };
        let mut adam = TriplaneAdam::default();
        let step = FieldStep::default();
        for k in 0..STEPS {
            input.evaluate(k, false);
            adam.step(level, &mut input.field, input.field_loss.gradients(), step);
        }
        Ok(input)
    }

    /// Loss and all gradients; with `every_colour`, every sample has a colour.
    pub fn evaluate(&mut self, step: u64, every_colour: bool) -> ExposureLoss {
        let least_weight = if every_colour { -1.0 } else { SamplingSettings::default().least_weight };
        let given = FieldExposure {
            exposure: Exposure { seen: &self.seen, path: &self.path, gain: 1.0, views: VIEWS },
            pixels: PIXELS,
            weights: FieldWeights::default(),
            sampling: SamplingSettings { least_weight, ..SamplingSettings::default() },
            with_path: true,
            seed: 1,
            step,
        };
        self.field_loss.evaluate(&self.field, &given)
    }

    /// Samples of geometry and of colour in the last evaluation.
    #[must_use]
    pub fn samples(&self) -> [usize; 2] {
        self.field_loss.samples(PIXELS)
    }

    /// Bytes of the field per cubic metre of its box.
    #[must_use]
    pub fn bytes_per_cubic_metre(&self) -> f64 {
        self.field.bytes() as f64 / self.field.region().volume()
    }
}

/// The box around all that was measured.
fn around(seen: &Observation, path: &ExposurePath) -> Region {
    let (mut least, mut most) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for (pixel, depth) in seen.depth.iter().enumerate() {
        let ray = seen.camera.ray((pixel % seen.camera.width) as f64, (pixel / seen.camera.width) as f64);
        let point = path.mid().transform_point(&(ray * f64::from(*depth)));
        for axis in 0..3 {
            least[axis] = least[axis].min(point[axis] - 0.1);
            most[axis] = most[axis].max(point[axis] + 0.1);
        }
    }
    Region::around(least, most)
}
