//! The loss of one exposure and all its gradients.

use mba_tracker::geometry::RigidTransform;
use mba_tracker::simd::Level;
use mba_tracker::trajectory::SampleRule;
use nalgebra::SVector;
use rayon::prelude::*;

use super::chunk::{CHUNK, Chunk, Job, View};
use super::field::TriplaneField;
use super::gradients::{FieldGradients, Group};
use super::prepared::Prepared;
use super::sampling::{Motion, SamplingSettings};
use crate::bundle::{DisplayCurve, Exposure, ExposureLoss, LossTerms, Sensor};
use crate::exposure::{ExposurePath, PATH_PARAMETERS};

/// Weights of the terms of the loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldWeights {
    /// Of the mean absolute difference of display values.
    pub colour: f32,
    /// Of the mean squared difference of rendered and measured depth, 1/m^2.
    pub depth: f32,
    /// Of the mean squared difference of signed distances from 1 in front of the band.
    pub free_space: f32,
    /// Of the mean squared error of distances near the surface, 1/m^2.
    pub centre: f32,
    /// Of the mean squared error of distances in the rest of the band, 1/m^2.
    pub tail: f32,
}

impl Default for FieldWeights {
    /// Those of ESLAM's mapping in units of its colour weight.
    fn default() -> Self {
        Self { colour: 1.0, depth: 0.02, free_space: 1.0, centre: 40.0, tail: 2.0 }
    }
}

/// How one exposure is compared with a field.
#[derive(Clone, Copy, Debug)]
pub struct FieldExposure<'a> {
    /// What was captured, from where, and how many virtual views there are.
    pub exposure: Exposure<'a>,
    /// Number of pixels that are compared.
    pub pixels: usize,
    /// Weights of the terms.
    pub weights: FieldWeights,
    /// Where rays are sampled.
    pub sampling: SamplingSettings,
    /// Whether the gradient by the path is computed.
    pub with_path: bool,
    /// Seed of the choice of pixels and samples.
    pub seed: u64,
    /// Number of the step: every step chooses others.
    pub step: u64,
}

/// Renders pixels of exposures, compares them with what was captured, and takes gradients back. Memory is kept from
/// exposure to exposure.
#[derive(Debug)]
pub struct TriplaneEngine {
    level: Level,
    curve: DisplayCurve,
    chunks: Vec<Chunk>,
    gradients: FieldGradients,
}

impl TriplaneEngine {
    /// An engine with the instruction set `level`; levels differ by rounding only.
    #[must_use]
    pub fn new(level: Level, sensor: &Sensor) -> Self {
        Self {
            level,
            curve: DisplayCurve::new(&sensor.inverse_response),
            chunks: Vec::new(),
            gradients: FieldGradients::default(),
        }
    }

    /// The loss of an exposure with that field; gradients by the field are then in [`Self::gradients`]. Neither depends
    /// on the number of threads.
    ///
    /// Each chosen pixel is the mean in linear light of its rays in all virtual views (MBA-SLAM eq. 3), times the gain,
    /// through the camera's response. Depth is compared at mid exposure. An even number of views counts as the next odd
    /// one. Without pixels, or with an empty region, the loss is zero.
    pub fn evaluate(&mut self, field: &TriplaneField, given: &FieldExposure<'_>) -> ExposureLoss {
        let Exposure { seen, path, gain, views } = given.exposure;
        let empty = seen.region.left >= seen.region.right || seen.region.top >= seen.region.bottom;
        let pixels = if empty { 0 } else { given.pixels };
        let prepared = Prepared::new(self.level, field);
        let times: Vec<f64> = (0..views | 1).map(|k| SampleRule::Midpoint.time(k, views | 1)).collect();
        let views = virtual_views(&prepared, path, &times);
        let count = pixels.div_ceil(CHUNK);
        let job = Job {
            field: &prepared,
            seen,
            curve: &self.curve,
            gain: gain as f32,
            views: &views,
            weights: given.weights,
            sampling: given.sampling,
            with_path: given.with_path,
            seed: given.seed,
            stream: given.step.wrapping_mul(1 << 20),
            pixels,
        };
        if self.chunks.len() < count {
            self.chunks.resize_with(count, Chunk::default);
        }
        let chunks = &mut self.chunks[..count];
        chunks.par_iter_mut().enumerate().for_each(|(index, chunk)| chunk.run(&job, index));
        let groups: Vec<[Group<'_>; 2]> = chunks.iter().map(Chunk::groups).collect();
        let [geometry, colour] = [0, 1].map(|kind| groups.iter().map(|pair| pair[kind]).collect::<Vec<_>>());
        self.gradients.reset(field);
        self.gradients.add_planes(&prepared, &geometry, &colour);
        self.sum_up(path, &times, count)
    }

    /// Adds up what the chunks have, in their order.
    fn sum_up(&mut self, path: &ExposurePath, times: &[f64], count: usize) -> ExposureLoss {
        let mut terms = LossTerms::default();
        let mut by_path = SVector::<f64, PATH_PARAMETERS>::zeros();
        let mut by_log_gain = 0.0;
        let jacobians: Vec<_> = times.iter().map(|time| path.pose_jacobian(*time).transpose()).collect();
        for Chunk { sums, .. } in &self.chunks[..count] {
            terms.colour += f64::from(sums.colour);
            terms.depth += f64::from(sums.depth);
            terms.mean_square += f64::from(sums.mean_square);
            by_log_gain += f64::from(sums.by_log_gain);
            jacobians.iter().zip(&sums.by_view).for_each(|(jacobian, by)| by_path += jacobian * by);
            self.gradients.distance_decoder.add(&sums.distance_decoder);
            self.gradients.colour_decoder.add(&sums.colour_decoder);
            self.gradients.log_sharpness += sums.by_log_sharpness;
        }
        ExposureLoss { terms, by_path, by_log_gain }
    }

    /// Gradients by the field of the last exposure, for an optimiser.
    #[must_use]
    pub fn gradients(&mut self) -> &mut FieldGradients {
        &mut self.gradients
    }

    /// Number of samples of geometry and of colour in the last exposure with `pixels` pixels.
    #[must_use]
    pub fn samples(&self, pixels: usize) -> [usize; 2] {
        let chunks = self.chunks.iter().take(pixels.div_ceil(CHUNK)).map(Chunk::samples);
        chunks.fold([0; 2], |sum, samples| [sum[0] + samples[0], sum[1] + samples[1]])
    }
}

fn virtual_views(field: &Prepared<'_>, path: &ExposurePath, times: &[f64]) -> Vec<View> {
    let poses: Vec<RigidTransform> = times.iter().map(|time| path.at(*time)).collect();
    let mid_from_world = poses[poses.len() / 2].inverse();
    let view = |world_from_camera: &RigidTransform| {
        let mut field_from_camera = *world_from_camera;
        field_from_camera.translation -= field.origin;
        View {
            field_from_camera: Motion::new(&field_from_camera),
            mid_from_camera: Motion::new(&mid_from_world.compose(world_from_camera)),
            world_from_camera: *world_from_camera,
        }
    };
    poses.iter().map(view).collect()
}
