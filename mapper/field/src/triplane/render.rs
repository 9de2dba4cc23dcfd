//! Views of a field.

use mba_raster::raster::RasterImage;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::simd::Level;
use nalgebra::Vector3;
use rayon::prelude::*;

use super::field::TriplaneField;
use super::march::{Ray, first_surfaces};
use super::opacity::{Opacity, weigh};
use super::prepared::{FieldSamples, Prepared};
use super::sampling::{Motion, NEAREST, SamplingSettings};

/// Renders views of fields.
#[derive(Clone, Copy, Debug)]
pub struct FieldRenderer {
    level: Level,
    sampling: SamplingSettings,
}

/// Memory for the pixels of a row.
#[derive(Debug, Default)]
struct RowScratch {
    geometry: FieldSamples<1>,
    colour: FieldSamples<3>,
    opacities: Vec<Opacity>,
    weights: Vec<f32>,
    z: Vec<f32>,
}

/// What a ray sees: light, depth (weighted sum), alpha.
type Seen = ([f32; 3], f32, f32);

impl FieldRenderer {
    /// A renderer with the instruction set `level`. Surfaces are sampled as in `sampling`, so that views look as they
    /// did in training.
    #[must_use]
    pub fn new(level: Level, sampling: SamplingSettings) -> Self {
        Self { level, sampling }
    }

    /// The view of `camera` from a pose: linear light, alpha, and the depth where the signed distance is zero, times
    /// alpha. The sum of depths with the weights of samples would lie in front of the surface, more so the softer it is.
    #[must_use]
    pub fn render(
        &self,
        field: &TriplaneField,
        camera: &PinholeCamera,
        world_from_camera: &RigidTransform,
    ) -> RasterImage {
        let prepared = Prepared::new(self.level, field);
        // Kernels have the lowest corner of the box as their origin: single precision is best near zero.
        let mut field_from_camera = *world_from_camera;
        field_from_camera.translation -= prepared.origin;
        let motion = Motion::new(&field_from_camera);
        let ray = |u: usize, v: usize| {
            let slope = camera.ray(u as f64, v as f64).map(|x| x as f32);
            let direction = motion.turn(slope.into());
            let along = Vector3::from(direction.map(f64::from));
            // Beyond the box the field is not defined.
            let exit = field.region.exit(&world_from_camera.translation, &along) as f32;
            Ray { origin: motion.translation, direction, range: [NEAREST, exit] }
        };
        let mut image = RasterImage::zeros(camera.width, camera.height);
        let [red, green, blue] = image.colour.each_mut().map(|plane| plane.par_chunks_mut(camera.width));
        let depth = image.depth.par_chunks_mut(camera.width);
        let alpha = image.alpha.par_chunks_mut(camera.width);
        let rows = (red, green, blue, depth, alpha).into_par_iter().enumerate();
        rows.for_each_init(RowScratch::default, |scratch, (v, (red, green, blue, depth, alpha))| {
            let rays: Vec<Ray> = (0..camera.width).map(|u| ray(u, v)).collect();
            for (u, (light, z, a)) in self.trace(&prepared, &rays, scratch).into_iter().enumerate() {
                [red[u], green[u], blue[u]] = light;
                (depth[u], alpha[u]) = (z, a);
            }
        });
        image
    }

    fn trace(&self, field: &Prepared<'_>, rays: &[Ray], scratch: &mut RowScratch) -> Vec<Seen> {
        let surfaces = first_surfaces(field, rays, &mut scratch.geometry);
        let RowScratch { geometry, colour, opacities, weights, z } = scratch;
        let count = self.sampling.surface;
        let reach = self.sampling.surface_reach * field.field.settings.truncation;
        geometry.clear();
        z.clear();
        // 1. A few samples, evenly around where a ray meets the surface; rays that meet none have none.
        for (ray, surface) in rays.iter().zip(&surfaces) {
            let Some(surface) = surface else { continue };
            for k in 0..count {
                let depth = surface + reach * ((2 * k + 1) as f32 / count as f32 - 1.0);
                z.push(depth);
                geometry.push(ray.at(depth));
            }
        }
        // 2. Distances, opacities and colours of all samples of the row at once.
        field.distances(geometry);
        field.opacities(geometry, opacities);
        colour.clear();
        (0..z.len()).for_each(|sample| colour.push(geometry.points.each_ref().map(|axis| axis[sample])));
        field.colours(colour);
        // 3. The samples of each ray, weighted.
        weights.resize(count, 0.0);
        let mut start = 0;
        let mut seen = |surface: &Option<f32>| -> Seen {
            let Some(surface) = surface else { return ([0.0; 3], 0.0, 0.0) };
            let range = start..start + count;
            start += count;
            let alpha = weigh(&opacities[range.clone()], weights);
            let mut light = [0.0; 3];
            for (weight, sample) in weights.iter().zip(range) {
                let pairs = light.iter_mut().zip(colour.values[sample]);
                pairs.for_each(|(light, colour)| *light += weight * colour);
            }
            (light, surface * alpha, alpha)
        };
        surfaces.iter().map(&mut seen).collect()
    }
}
