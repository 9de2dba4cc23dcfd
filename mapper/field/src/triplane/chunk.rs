//! Some blurred pixels: their rays, what the field has along them, the loss, and all gradients.

use mba_raster::losses::{CLIPPED, NOISE, smooth_absolute};
use mba_raster::sensor::{DisplayCurve, Observation};
use mba_tracker::geometry::RigidTransform;
use nalgebra::{Vector3, Vector6};
use rand_core::Rng;
use rand_pcg::Pcg32;

use super::gradients::Group;
use super::layers::Layers;
use super::march::{Ray, first_surfaces};
use super::opacity::{Opacity, weigh, weigh_backward};
use super::prepared::{FieldSamples, Prepared};
use super::ray_views::RayViews;
use super::sampling::{MidDepth, Motion, NEAREST, SamplingSettings, stratified};
use super::weights::FieldWeights;

/// A sixth of the band, which reaches 1.5 truncations to both sides, lies more than one truncation in front of the surface
/// and counts as free space.
const BAND_PER_FRONT: usize = 6;

/// Pixels per chunk: what belongs to one stays in the cache of a core.
pub(super) const CHUNK: usize = 32;

/// Half the width of the centre of the band, truncations (ESLAM).
const CENTRE: f32 = 0.4;

/// A virtual view.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    /// From the camera to the field's coordinates.
    pub(super) field_from_camera: Motion,
    /// To the camera at the time of its depth.
    pub(super) mid_from_camera: Motion,
    pub(super) world_from_camera: RigidTransform,
}

/// What all chunks of an exposure share.
pub(super) struct Job<'a> {
    pub(super) field: &'a Prepared<'a>,
    pub(super) seen: &'a Observation,
    pub(super) curve: &'a DisplayCurve,
    pub(super) gain: f32,
    pub(super) views: &'a [View],
    pub(super) rays: RayViews,
    pub(super) weights: FieldWeights,
    pub(super) sampling: SamplingSettings,
    /// Whether the gradient by the path is wanted.
    pub(super) with_path: bool,
    pub(super) seed: u64,
    /// First of the streams of random numbers that belong to this exposure.
    pub(super) stream: u64,
    /// Pixels of all chunks.
    pub(super) pixels: usize,
}

/// Sums over the pixels of a chunk.
#[derive(Clone, Debug, Default)]
pub(super) struct Sums {
    pub(super) colour: f32,
    pub(super) depth: f32,
    pub(super) mean_square: f32,
    pub(super) grad_log_gain: f32,
    pub(super) grad_log_sharpness: f32,
    pub(super) distance_decoder: Layers<1>,
    pub(super) colour_decoder: Layers<3>,
    /// Gradient by the tangent of each view's pose.
    pub(super) grad_view: Vec<Vector6<f64>>,
}

/// A pixel that was chosen.
#[derive(Clone, Copy, Debug)]
struct Pixel {
    index: usize,
    /// First of its views.
    first_view: usize,
    /// `x/z` and `y/z` of its ray.
    slope: [f32; 2],
    /// Measured depth, metres, 0 if there is none.
    measured: f32,
    /// Depth of the surface at mid exposure, measured or found in the field.
    surface: Option<f32>,
}

/// One ray of a pixel.
#[derive(Clone, Copy, Debug)]
struct PixelRay {
    pixel: usize,
    view: usize,
    /// First of its samples, and the one after the last.
    start: usize,
    end: usize,
}

/// Memory for the pixels of a chunk.
#[derive(Debug, Default)]
pub(super) struct Chunk {
    pixels: Vec<Pixel>,
    rays: Vec<PixelRay>,
    /// Depths of all samples.
    z: Vec<f32>,
    geometry: FieldSamples<1>,
    opacities: Vec<Opacity>,
    weights: Vec<f32>,
    grad_weights: Vec<f32>,
    /// Samples that have a colour.
    lit: Vec<u32>,
    colour: FieldSamples<3>,
    /// Light that arrives along each ray, and depth.
    light: Vec<[f32; 3]>,
    depth: Vec<f32>,
    pub(super) sums: Sums,
}

impl Chunk {
    /// Geometry samples and colour samples with the gradients by their features.
    pub(super) fn groups(&self) -> [Group<'_>; 2] {
        [
            (self.geometry.points(), self.geometry.grad_features()),
            (self.colour.points(), self.colour.grad_features()),
        ]
    }

    /// Number of samples, of geometry and of colour.
    pub(super) fn samples(&self) -> [usize; 2] {
        [self.geometry.len(), self.colour.len()]
    }

    /// Everything for chunk `index` of a job.
    pub(super) fn run(&mut self, job: &Job<'_>, index: usize) {
        let mut random = Pcg32::new(job.seed, job.stream + index as u64);
        self.sums = Sums { grad_view: vec![Vector6::zeros(); job.views.len()], ..Sums::default() };
        self.choose(job, CHUNK.min(job.pixels - index * CHUNK), &mut random);
        self.find_surfaces(job);
        self.place_samples(job, &mut random);
        self.forward(job);
        self.backward(job);
    }

    /// Chooses pixels at random.
    fn choose(&mut self, job: &Job<'_>, count: usize, random: &mut Pcg32) {
        let (region, camera) = (job.seen.region, &job.seen.camera);
        let mut below = |bound: usize| ((u64::from(random.next_u32()) * bound as u64) >> 32) as usize;
        self.pixels.clear();
        for _ in 0..count {
            // Only where the sensor has pixels: outside of the region there is nothing to compare with.
            let u = region.left + below(region.right - region.left);
            let v = region.top + below(region.bottom - region.top);
            let index = v * camera.width + u;
            let ray = camera.ray(u as f64, v as f64);
            let measured = job.seen.depth[index];
            let surface = (measured > 0.0).then_some(measured);
            let (first_view, slope) = (job.rays.first(v), [ray.x as f32, ray.y as f32]);
            self.pixels.push(Pixel { index, first_view, slope, measured, surface });
        }
    }

    /// Looks in the field for the surfaces of pixels without a measured depth.
    fn find_surfaces(&mut self, job: &Job<'_>) {
        let unknown = self.pixels.iter_mut().filter(|pixel| pixel.surface.is_none());
        // From the view at the time of the depth image, up to where the ray leaves the box.
        let seen = |pixel: &mut Pixel| {
            let view = &job.views[pixel.first_view + job.rays.of_depth];
            within_box(job, view, ray(view, pixel.slope))
        };
        let rays: Vec<Ray> = unknown.map(seen).collect();
        let found = first_surfaces(job.field, &rays, &mut self.geometry);
        let unknown = self.pixels.iter_mut().filter(|pixel| pixel.surface.is_none());
        unknown.zip(found).for_each(|(pixel, found)| pixel.surface = found);
    }

    /// Makes the rays of all pixels and their samples.
    fn place_samples(&mut self, job: &Job<'_>, random: &mut Pcg32) {
        let truncation = job.field.field.settings.truncation;
        let depth = MidDepth::new(job.seen);
        let of_depth = job.rays.of_depth;
        self.rays.clear();
        self.z.clear();
        self.geometry.clear();
        for (k, pixel) in self.pixels.iter().enumerate() {
            let views = &job.views[pixel.first_view..pixel.first_view + job.rays.per_pixel];
            for (number, view) in views.iter().enumerate() {
                let (start, z) = (self.z.len(), &mut self.z);
                let ray = ray(view, pixel.slope);
                match pixel.surface {
                    // Depth was measured in this very view: samples in front of the surface and densely around it.
                    Some(depth) if pixel.measured > 0.0 && number == of_depth => {
                        job.sampling.measured(random, depth, truncation, z);
                    }
                    // No measurement, but the field has a surface here.
                    Some(surface) if number == of_depth => {
                        job.sampling.expected(random, [surface; 2], truncation, z);
                    }
                    Some(surface) => {
                        // Another view sees another point: the depth image is asked what that is.
                        let surfaces = depth.guess(&view.mid_from_camera, pixel.slope, surface);
                        job.sampling.expected(random, surfaces, truncation, z);
                    }
                    None => {
                        // Nothing is known of this ray: the whole of it is sampled.
                        stratified(random, within_box(job, view, ray).range, job.sampling.open, z);
                    }
                }
                self.geometry.extend(self.z[start..].iter().map(|z| ray.at(*z)));
                let view = pixel.first_view + number;
                self.rays.push(PixelRay { pixel: k, view, start, end: self.z.len() });
            }
        }
    }

    /// Light and depth of all rays.
    fn forward(&mut self, job: &Job<'_>) {
        job.field.distances(&mut self.geometry);
        job.field.opacities(&self.geometry, &mut self.opacities);
        self.weights.clear();
        self.weights.resize(self.z.len(), 0.0);
        self.depth.clear();
        for ray in &self.rays {
            let range = ray.start..ray.end;
            // The weight of a sample is its opacity times the transmittance in front of it.
            weigh(&self.opacities[range.clone()], &mut self.weights[range.clone()]);
            let samples = self.weights[range.clone()].iter().zip(&self.z[range]);
            self.depth.push(samples.map(|(weight, z)| weight * z).sum());
        }
        self.lit.clear();
        self.colour.clear();
        // Colours are decoded only where they would be seen; most samples have hardly any weight.
        let least = job.sampling.least_weight;
        for (sample, _) in self.weights.iter().enumerate().filter(|(_, weight)| **weight > least) {
            self.lit.push(sample as u32);
            self.colour.push(self.geometry.points.each_ref().map(|axis| axis[sample]));
        }
        job.field.colours(&mut self.colour);
        self.collect_light();
    }

    fn collect_light(&mut self) {
        self.light.clear();
        let mut lit = self.lit.iter().zip(&self.colour.values).peekable();
        for ray in &self.rays {
            let mut light = [0.0; 3];
            while let Some((sample, colour)) = lit.next_if(|(sample, _)| (**sample as usize) < ray.end) {
                let weight = self.weights[*sample as usize];
                light.iter_mut().zip(colour).for_each(|(light, colour)| *light += weight * colour);
            }
            self.light.push(light);
        }
    }

    /// Loss and gradients.
    fn backward(&mut self, job: &Job<'_>) {
        self.geometry.start_backward();
        self.colour.start_backward();
        self.grad_weights.clear();
        self.grad_weights.resize(self.z.len(), 0.0);
        let RayViews { per_pixel, of_light, of_depth, .. } = job.rays;
        let mut grad_light = Vec::with_capacity(self.rays.len());
        for k in 0..self.pixels.len() {
            let grad_pixel = self.compare_colour(job, k);
            // Colour is the mean over the views of light; the other views, those of depth, have no part in it.
            grad_light.extend((0..of_light).map(|_| grad_pixel.map(|by| by / of_light as f32)));
            grad_light.extend((of_light..per_pixel).map(|_| [0.0; 3]));
            if self.pixels[k].measured > 0.0 {
                self.compare_depth(job, k, k * per_pixel + of_depth);
            }
        }
        // Back through the stages of the forward pass: colours, weights, distances, and last the poses.
        self.colours_backward(job, &grad_light);
        for ray in &self.rays {
            let range = ray.start..ray.end;
            self.sums.grad_log_sharpness += weigh_backward(
                job.field.sharpness,
                &self.geometry.values.as_flattened()[range.clone()],
                &self.opacities[range.clone()],
                &self.weights[range.clone()],
                &self.grad_weights[range.clone()],
                &mut self.geometry.grad_outputs[range],
            );
        }
        job.field.distances_backward(&mut self.geometry, job.with_path, &mut self.sums.distance_decoder);
        if job.with_path {
            self.poses_backward(job);
        }
    }

    /// Compares the mean light of the rays of a pixel with what was captured; returns the gradient by it.
    fn compare_colour(&mut self, job: &Job<'_>, k: usize) -> [f32; 3] {
        let RayViews { per_pixel, of_light: views, .. } = job.rays;
        let rays = &self.light[k * per_pixel..k * per_pixel + views];
        let index = self.pixels[k].index;
        // What the lens takes away is part of the gain, so that the map has the light before the lens.
        let gain = job.seen.falloff.as_ref().map_or(job.gain, |falloff| job.gain * falloff[index]);
        let share = 1.0 / (3 * job.pixels) as f32;
        core::array::from_fn(|channel| {
            let light = rays.iter().map(|light| light[channel]).sum::<f32>() / views as f32;
            let byte = job.seen.colour[channel][index];
            let target = f32::from(byte) * (1.0 / 255.0);
            let [value, slope] = job.curve.at(gain * light);
            // A clipped value says that there was at least so much light, no more.
            if byte >= CLIPPED && value > target {
                return 0.0;
            }
            let (loss, grad_value) = smooth_absolute(value - target, NOISE);
            self.sums.colour += job.weights.colour * share * loss;
            self.sums.mean_square += share * (value - target) * (value - target);
            let grad_light = job.weights.colour * share * grad_value * slope * gain;
            self.sums.grad_log_gain += grad_light * light;
            grad_light
        })
    }

    /// Compares depth and signed distances along the ray of depth with the measured depth. The means of the paper
    /// are taken over the samples that a set has on average if all pixels have a depth.
    fn compare_depth(&mut self, job: &Job<'_>, k: usize, ray: usize) {
        let (measured, weights) = (self.pixels[k].measured, &job.weights);
        let truncation = job.field.field.settings.truncation;
        let per_pixel = 1.0 / job.pixels as f32;
        // Rendered depth.
        let off = self.depth[ray] - measured;
        self.sums.depth += weights.depth * per_pixel * off * off;
        let grad_depth = 2.0 * weights.depth * per_pixel * off;
        // Means over samples: those of free space are in front of the band and in its foremost part.
        let front = per_pixel * weights.free_space
            / (job.sampling.front + job.sampling.band / BAND_PER_FRONT).max(1) as f32;
        let band = per_pixel / job.sampling.band.max(1) as f32;
        for sample in self.rays[ray].start..self.rays[ray].end {
            let (z, s) = (self.z[sample], self.geometry.values[sample][0]);
            self.grad_weights[sample] += grad_depth * z;
            // Distance in front of the measured surface in truncations, which the field should have at the sample.
            let ahead = (measured - z) / truncation;
            // Farther than a truncation in front it is 1. Behind the band nothing is known.
            let (loss, by) = if ahead > 1.0 {
                (front * (s - 1.0) * (s - 1.0), 2.0 * front * (s - 1.0))
            } else if ahead >= -1.0 {
                let weight = band * if ahead.abs() < CENTRE { weights.centre } else { weights.tail };
                let off = truncation * (s - ahead);
                (weight * off * off, 2.0 * weight * off * truncation)
            } else {
                continue;
            };
            self.sums.depth += loss;
            self.geometry.grad_outputs[sample][0] += by;
        }
    }

    /// Takes the gradient by the light of rays to colours and weights.
    fn colours_backward(&mut self, job: &Job<'_>, grad_light: &[[f32; 3]]) {
        let mut lit = self.lit.iter().enumerate().peekable();
        for (ray, grad_light) in self.rays.iter().zip(grad_light) {
            while let Some((place, sample)) = lit.next_if(|(_, sample)| (**sample as usize) < ray.end) {
                let sample = *sample as usize;
                let colour = self.colour.values[place];
                self.grad_weights[sample] += (0..3).map(|c| colour[c] * grad_light[c]).sum::<f32>();
                self.colour.grad_outputs[place] = grad_light.map(|by| by * self.weights[sample]);
            }
        }
        job.field.colours_backward(&mut self.colour, job.with_path, &mut self.sums.colour_decoder);
    }

    /// Sums up the gradients by points to those by the poses of the views: with a point `x = p + R y`, `dx/dp` is one
    /// and `dx/dr = -R [y]x`.
    fn poses_backward(&mut self, job: &Job<'_>) {
        for (sample, by) in self.lit.iter().zip(&self.colour.grad_points) {
            let sum = &mut self.geometry.grad_points[*sample as usize];
            sum.iter_mut().zip(by).for_each(|(sum, by)| *sum += by);
        }
        for ray in &self.rays {
            // Of all samples of a ray: the sum of the gradients, and the sum of depth times gradient.
            let (mut shift, mut lever) = ([0.0; 3], [0.0; 3]);
            for sample in ray.start..ray.end {
                for (axis, by) in self.geometry.grad_points[sample].iter().enumerate() {
                    shift[axis] += by;
                    lever[axis] += by * self.z[sample];
                }
            }
            // In the camera a sample is its depth times (slope, 1), so that one cross product does for the whole ray.
            let lever = job.views[ray.view].field_from_camera.turn_back(lever).map(f64::from);
            let slope = self.pixels[ray.pixel].slope.map(f64::from);
            let turn = Vector3::new(slope[0], slope[1], 1.0).cross(&Vector3::from(lever));
            let [x, y, z] = shift.map(f64::from);
            self.sums.grad_view[ray.view] += Vector6::new(x, y, z, turn.x, turn.y, turn.z);
        }
    }
}

/// The ray of a pixel in a view.
fn ray(view: &View, slope: [f32; 2]) -> Ray {
    let direction = view.field_from_camera.turn([slope[0], slope[1], 1.0]);
    Ray { origin: view.field_from_camera.translation, direction, range: [NEAREST, f32::INFINITY] }
}

/// The part of a ray up to where it leaves the box.
fn within_box(job: &Job<'_>, view: &View, ray: Ray) -> Ray {
    let direction = Vector3::from(ray.direction.map(f64::from));
    let exit = job.field.field.region.exit(&view.world_from_camera.translation, &direction);
    Ray { range: [NEAREST, exit as f32], ..ray }
}
