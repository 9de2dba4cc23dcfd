//! The loss of one exposure and all its gradients.

use mba_raster::exposure::{ExposurePath, PATH_PARAMETERS};
use mba_raster::losses::{Exposure, ExposureLoss, LossTerms};
use mba_raster::sensor::{DisplayCurve, Sensor};
use mba_tracker::geometry::RigidTransform;
use mba_tracker::simd::Level;
use nalgebra::SVector;
use rayon::prelude::*;

use super::chunk::{CHUNK, Chunk, Job, View};
use super::field::TriplaneField;
use super::gradients::{FieldGradients, Group};
use super::prepared::Prepared;
use super::ray_views::RayViews;
use super::sampling::{Motion, SamplingSettings};
use super::weights::FieldWeights;

/// Streams of random numbers that a step may use, one per chunk: far more than chunks of any picture.
const STREAMS_PER_STEP: u64 = 1 << 20;

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
pub struct FieldLoss {
    level: Level,
    curve: DisplayCurve,
    chunks: Vec<Chunk>,
    gradients: FieldGradients,
}

impl FieldLoss {
    /// Memory for it, with the instruction set `level`; levels differ by rounding only.
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
    /// through the lens and the camera's response. Depth is compared at the time of the depth image. An even number of views counts as the next odd
    /// one. Without pixels, or with an empty region, the loss is zero.
    pub fn evaluate(&mut self, field: &TriplaneField, given: &FieldExposure<'_>) -> ExposureLoss {
        let Exposure { seen, path, gain, views } = given.exposure;
        let empty = seen.region.left >= seen.region.right || seen.region.top >= seen.region.bottom;
        let pixels = if empty { 0 } else { given.pixels };
        // 1. The field as kernels want it, and the virtual views that pixels are seen in.
        let prepared = Prepared::new(self.level, field);
        let rays = RayViews::new(&seen.times, views, seen.camera.height);
        let times = rays.times(&seen.times);
        let views = virtual_views(&prepared, path, &times, &rays);
        // 2. Pixels in chunks, each with random numbers of its own, so that it does not matter which thread has which chunk.
        let count = pixels.div_ceil(CHUNK);
        let job = Job {
            field: &prepared,
            seen,
            curve: &self.curve,
            gain: gain as f32,
            views: &views,
            rays,
            weights: given.weights,
            sampling: given.sampling,
            with_path: given.with_path,
            seed: given.seed,
            stream: given.step.wrapping_mul(STREAMS_PER_STEP),
            pixels,
        };
        if self.chunks.len() < count {
            self.chunks.resize_with(count, Chunk::default);
        }
        let chunks = &mut self.chunks[..count];
        chunks.par_iter_mut().enumerate().for_each(|(index, chunk)| chunk.run(&job, index));
        // 3. Gradients by the planes, plane by plane: a node gets its samples in their order, whoever adds them.
        let groups: Vec<[Group<'_>; 2]> = chunks.iter().map(Chunk::groups).collect();
        let [geometry, colour] = [0, 1].map(|kind| groups.iter().map(|pair| pair[kind]).collect::<Vec<_>>());
        self.gradients.reset(field);
        self.gradients.add_planes(&prepared, &geometry, &colour);
        self.sum_up(path, &times, count)
    }

    /// Adds up what the chunks have, in their order.
    fn sum_up(&mut self, path: &ExposurePath, times: &[f64], count: usize) -> ExposureLoss {
        let mut terms = LossTerms::default();
        let mut grad_path = SVector::<f64, PATH_PARAMETERS>::zeros();
        let mut grad_log_gain = 0.0;
        let jacobians: Vec<_> = times.iter().map(|time| path.pose_jacobian(*time).transpose()).collect();
        // A gradient by the pose of a view becomes one by the path through the derivative of the pose at the time of the view.
        for Chunk { sums, .. } in &self.chunks[..count] {
            terms.colour += f64::from(sums.colour);
            terms.depth += f64::from(sums.depth);
            terms.mean_square += f64::from(sums.mean_square);
            grad_log_gain += f64::from(sums.grad_log_gain);
            jacobians.iter().zip(&sums.grad_view).for_each(|(jacobian, by)| grad_path += jacobian * by);
            self.gradients.distance_decoder.add(&sums.distance_decoder);
            self.gradients.colour_decoder.add(&sums.colour_decoder);
            self.gradients.log_sharpness += sums.grad_log_sharpness;
        }
        ExposureLoss { terms, grad_path, grad_log_gain }
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

fn virtual_views(field: &Prepared<'_>, path: &ExposurePath, times: &[f64], rays: &RayViews) -> Vec<View> {
    let poses: Vec<RigidTransform> = times.iter().map(|time| path.at(*time)).collect();
    let view = |(k, world_from_camera): (usize, &RigidTransform)| {
        let mid_from_world = poses[rays.depth_of(k)].inverse();
        let mut field_from_camera = *world_from_camera;
        field_from_camera.translation -= field.origin;
        View {
            field_from_camera: Motion::new(&field_from_camera),
            mid_from_camera: Motion::new(&mid_from_world.compose(world_from_camera)),
            world_from_camera: *world_from_camera,
        }
    };
    poses.iter().enumerate().map(view).collect()
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::PinholeCamera;
    use mba_tracker::image::PixelRectangle;
    use mba_tracker::photometric::InverseResponse;
    use mba_tracker::trajectory::ExposureTrajectory;
    use nalgebra::{UnitQuaternion, Vector3, Vector6};

    use super::*;
    use crate::triplane::gradients::plane_values_mut;
    use crate::triplane::reference::lively_field;
    use mba_raster::exposure::{RowTimes, RowTiming};
    use mba_raster::sensor::Observation;

    const SIZE: [usize; 2] = [24, 18];

    fn sensor() -> Sensor {
        let [width, height] = SIZE;
        Sensor {
            camera: PinholeCamera { width, height, fx: 30.0, fy: 30.0, cx: 11.5, cy: 8.5 },
            inverse_response: InverseResponse::srgb(),
            depth_scale: 5000.0,
            region: PixelRectangle { left: 0, top: 0, right: width, bottom: height },
            rows: RowTiming::default(),
            falloff: None,
        }
    }

    fn observation() -> Observation {
        let sensor = sensor();
        let fraction = |i: usize| ((i * 7919 + 17) % 101) as f32 / 101.0;
        let pixels = SIZE[0] * SIZE[1];
        let plane = |c: usize| (0..pixels).map(|i| (40.0 + 170.0 * fraction(5 * i + c)) as u8).collect();
        Observation {
            camera: sensor.camera,
            colour: [plane(0), plane(1), plane(2)],
            depth: (0..pixels).map(|i| 0.35 + 0.1 * (i % SIZE[0]) as f32 / SIZE[0] as f32).collect(),
            region: sensor.region,
            times: RowTimes::GLOBAL,
            falloff: None,
        }
    }

    /// A camera that looks into the box and moves.
    fn path() -> ExposurePath {
        let pose = |x: f64| {
            let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.02, 0.1 * x, 0.3));
            RigidTransform::new(turn, Vector3::new(0.1 + x, 0.45, 0.4))
        };
        ExposurePath::linear(ExposureTrajectory { start: pose(-0.03), end: pose(0.03) })
    }

    /// A hundred pixels of an exposure, with all gradients.
    fn drawn(exposure: Exposure<'_>) -> FieldExposure<'_> {
        FieldExposure {
            exposure,
            pixels: 100,
            weights: FieldWeights::default(),
            sampling: SamplingSettings::default(),
            with_path: true,
            seed: 3,
            step: 9,
        }
    }

    fn evaluated(
        level: Level,
        field: &TriplaneField,
        path: &ExposurePath,
        gain: f64,
        views: usize,
    ) -> (ExposureLoss, FieldGradients) {
        let seen = observation();
        let mut field_loss = FieldLoss::new(level, &sensor());
        let loss = field_loss.evaluate(field, &drawn(Exposure { seen: &seen, path, gain, views }));
        (loss, field_loss.gradients().clone())
    }

    /// Groups of parameters of a field, to be changed along a gradient.
    fn groups(field: &mut TriplaneField) -> Vec<&mut [f32]> {
        let TriplaneField { distance_decoder, colour_decoder, log_sharpness, .. } = field;
        let decoders = distance_decoder.parts_mut().into_iter().chain(colour_decoder.parts_mut());
        decoders.chain([core::slice::from_mut(log_sharpness)]).collect()
    }

    fn group_gradients(gradients: &FieldGradients) -> Vec<Vec<f32>> {
        let FieldGradients { distance_decoder, colour_decoder, log_sharpness, .. } = gradients;
        let decoders = distance_decoder.parts().into_iter().chain(colour_decoder.parts());
        decoders.map(<[f32]>::to_vec).chain([vec![*log_sharpness]]).collect()
    }

    /// Asserts that the slope along a gradient is its length.
    fn check(what: &str, gradient: &[f32], step: f64, loss: &dyn Fn(&[f32]) -> f64) {
        let norm = gradient.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>().sqrt();
        let moved = |by: f64| {
            let change: Vec<f32> = gradient.iter().map(|g| (by * f64::from(*g) / norm) as f32).collect();
            loss(&change)
        };
        let slope = (moved(step) - moved(-step)) / (2.0 * step);
        assert!((slope - norm).abs() < 0.02 * norm + 2e-4, "{what}: slope {slope}, gradient {norm}");
    }

    #[test]
    fn gradients_by_the_field_are_those_of_finite_differences() {
        let (field, path) = (lively_field(), path());
        let (_, gradients) = evaluated(Level::new(), &field, &path, 1.1, 3);
        let total = |field: &TriplaneField| evaluated(Level::new(), field, &path, 1.1, 3).0.terms.total();
        for (k, gradient) in group_gradients(&gradients).into_iter().enumerate() {
            check(&format!("group {k}"), &gradient, 2e-3, &|change| {
                let mut moved = field.clone();
                groups(&mut moved)[k].iter_mut().zip(change).for_each(|(value, by)| *value += by);
                total(&moved)
            });
        }
        for (k, gradient) in gradients.planes.iter().enumerate() {
            check(&format!("plane {k}"), &gradient.sums, 2e-2, &|change| {
                let mut moved = field.clone();
                plane_values_mut(&mut moved)[k].iter_mut().zip(change).for_each(|(value, by)| *value += by);
                total(&moved)
            });
        }
    }

    #[test]
    fn the_gradient_by_the_gain_is_that_of_finite_differences() {
        let (field, path) = (lively_field(), path());
        let at = |log: f64| evaluated(Level::new(), &field, &path, log.exp(), 3).0;
        let numeric = (at(1e-2).terms.total() - at(-1e-2).terms.total()) / 2e-2;
        let analytic = at(0.0).grad_log_gain;
        assert!((analytic - numeric).abs() < 0.02 * numeric.abs(), "{analytic}, not {numeric}");
    }

    /// Loss and gradients by the tangents of views, of which only what the field sees is moved: where samples lie on
    /// their rays does not count as a function of the pose.
    fn grad_views(moved: Option<(usize, Vector6<f64>)>) -> (f64, Vec<Vector6<f64>>) {
        let (field, path, seen) = (lively_field(), path(), observation());
        let prepared = Prepared::new(Level::new(), &field);
        let curve = DisplayCurve::new(&sensor().inverse_response);
        let rays = RayViews::new(&RowTimes::GLOBAL, 3, SIZE[1]);
        let mut views = virtual_views(&prepared, &path, &[0.2, 0.5, 0.8], &rays);
        if let Some((view, tangent)) = moved {
            let mut pose = views[view].world_from_camera.perturbed(&tangent);
            pose.translation -= prepared.origin;
            views[view].field_from_camera = Motion::new(&pose);
        }
        let job = Job {
            field: &prepared,
            seen: &seen,
            curve: &curve,
            gain: 1.0,
            views: &views,
            rays,
            weights: FieldWeights::default(),
            // Where a sample gets its colour, the loss has a step.
            sampling: SamplingSettings { least_weight: 0.0, ..SamplingSettings::default() },
            with_path: true,
            seed: 1,
            stream: 0,
            pixels: CHUNK,
        };
        let mut chunk = Chunk::default();
        chunk.run(&job, 0);
        (f64::from(chunk.sums.colour) + f64::from(chunk.sums.depth), chunk.sums.grad_view)
    }

    #[test]
    fn gradients_by_poses_are_those_of_finite_differences() {
        let (_, gradients) = grad_views(None);
        for (view, gradient) in gradients.iter().enumerate() {
            for k in 0..6 {
                let mut tangent = Vector6::zeros();
                tangent[k] = 1e-3;
                let numeric =
                    (grad_views(Some((view, tangent))).0 - grad_views(Some((view, -tangent))).0) / 2e-3;
                let error = (numeric - gradient[k]).abs();
                assert!(error < 0.03 * gradient.norm() + 1e-3, "view {view}, {k}: {gradient}, not {numeric}");
            }
        }
    }

    /// Loss of an exposure whose rows are exposed one after the other and whose depth is late, with the surface far
    /// from where samples depend on the pose.
    fn rolling(path: &ExposurePath, with_path: bool) -> ExposureLoss {
        let times = RowTimes { exposure: 0.4, readout: 0.6, depth_offset: 0.3, depth_readout: 0.0 };
        let falloff: Vec<f32> = (0..SIZE[0] * SIZE[1]).map(|pixel| 1.0 - 0.001 * pixel as f32).collect();
        let seen = Observation { times, falloff: Some(falloff.into()), ..observation() };
        let mut field_loss = FieldLoss::new(Level::new(), &sensor());
        let exposure = Exposure { seen: &seen, path, gain: 1.1, views: 3 };
        let given = FieldExposure { with_path, ..drawn(exposure) };
        field_loss.evaluate(&lively_field(), &given)
    }

    #[test]
    fn rays_have_the_time_of_their_row() {
        let rays = RayViews::new(&RowTimes::GLOBAL, 2, 18);
        assert_eq!((rays.per_pixel, rays.of_light, rays.of_depth, rays.first(17)), (3, 3, 1, 0));
        let times = RowTimes { exposure: 0.4, readout: 0.6, depth_offset: 0.3, depth_readout: 0.0 };
        let rays = RayViews::new(&times, 3, 18);
        let all = rays.times(&times);
        assert_eq!((rays.per_pixel, rays.of_light, rays.of_depth, all.len()), (4, 3, 3, 4 * 18));
        for v in 0..18 {
            let first = rays.first(v);
            let row = 0.5 + ((v as f64 + 0.5) / 18.0 - 0.5) * 0.6;
            for (k, s) in [1.0 / 6.0, 0.5, 5.0 / 6.0].into_iter().enumerate() {
                assert!((all[first + k] - (row + (s - 0.5) * 0.4)).abs() < 1e-12, "row {v}, view {k}");
            }
            assert!((all[rays.depth_of(first + 1)] - 0.8).abs() < 1e-12);
        }
    }

    #[test]
    fn the_gradient_by_a_path_of_rows_leads_down() {
        let path = path();
        let at_path = rolling(&path, true);
        let step = at_path.grad_path * (2e-4 / at_path.grad_path.norm());
        let slope = rolling(&path.perturbed(&step), false).terms.total()
            - rolling(&path.perturbed(&-step), false).terms.total();
        // Where samples lie changes with the poses too, and is no part of the gradient.
        let expected = 2.0 * step.dot(&at_path.grad_path);
        assert!((slope / expected - 1.0).abs() < 0.3, "{slope} instead of {expected}");
    }

    #[test]
    fn threads_do_not_change_a_bit_and_levels_hardly_anything() {
        let (field, path) = (lively_field(), path());
        let with_threads = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| evaluated(Level::new(), &field, &path, 1.0, 5))
        };
        let ((one, of_one), (three, of_three)) = (with_threads(1), with_threads(3));
        assert_eq!((one.terms, one.grad_path), (three.terms, three.grad_path));
        for (one, three) in of_one.planes.iter().zip(&of_three.planes) {
            assert_eq!((&one.sums, &one.touched), (&three.sums, &three.touched));
        }
        for level in mba_tracker::simd::levels_up_to(Level::new()) {
            let (other, _) = evaluated(level, &field, &path, 1.0, 5);
            assert!((other.terms.total() - one.terms.total()).abs() < 1e-4 * one.terms.total());
            assert!((other.grad_path - one.grad_path).norm() < 1e-2 * one.grad_path.norm());
        }
    }

    #[test]
    fn an_empty_region_has_no_loss() {
        let mut seen = observation();
        seen.region.right = 0;
        let exposure = Exposure { seen: &seen, path: &path(), gain: 1.0, views: 3 };
        let loss = FieldLoss::new(Level::new(), &sensor()).evaluate(&lively_field(), &drawn(exposure));
        assert_eq!((loss.terms.total(), loss.grad_log_gain), (0.0, 0.0));
    }
}
