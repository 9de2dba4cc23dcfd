//! A tri-plane field as the map of the adjustment.

use mba_field::triplane::{
    FieldExposure, FieldSettings, FieldStep, FieldWeights, Region, SamplingSettings, TriplaneAdam,
    TriplaneField,
};
use mba_map::map::{MapSize, Scene};
use mba_raster::losses::{Exposure, ExposureLoss};
use mba_raster::sensor::Observation;
use mba_tracker::geometry::RigidTransform;
use serde::{Deserialize, Serialize};

use super::map_model::{FitContext, MapModel};
use super::schedule::StepPlan;
use super::seed_view::SeedView;

/// Most pixels that a step looks at.
const PIXELS: usize = 2048;

/// In small pictures it looks at one pixel of so many.
const PIXEL_SHARE: usize = 8;

/// The box reaches this far beyond what was measured, metres: two truncations.
const MARGIN: f64 = 0.12;

/// Every so many columns and rows a depth is looked at to find the box.
const STRIDE: usize = 4;

/// Share of the depths of a frame that decide about the box: a few wrong ones would make it huge.
const TRUSTED: f64 = 0.995;

/// A field, and what its optimiser remembers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FieldMap {
    /// The map.
    pub field: TriplaneField,
    adam: TriplaneAdam,
    seed: u64,
    is_seeded: bool,
}

impl FieldMap {
    /// A field around the origin of the world, without any surface; `seed` decides about first values and about the
    /// pixels that are looked at.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let field = TriplaneField::new(Region::around([0.0; 3], [0.0; 3]), FieldSettings::default(), seed);
        Self { field, adam: TriplaneAdam::default(), seed, is_seeded: false }
    }
}

/// The planes are as dense everywhere, and their nodes stay where they are. A field has no parts that belong to a keyframe:
/// what moved is learnt again at its new place, and where it was, the rays that pass through make space free.
impl MapModel for FieldMap {
    type Context = FitContext;

    fn scene(&self) -> Scene<'_> {
        Scene::Field(&self.field)
    }

    fn is_empty(&self) -> bool {
        !self.is_seeded
    }

    fn size(&self) -> MapSize {
        MapSize::FieldBytes(self.field.bytes())
    }

    /// Grows the box; surfaces come with the steps.
    fn seed(&mut self, _context: &mut FitContext, view: &SeedView<'_>, _most: usize) {
        self.make_room(view.seen, &view.world_from_camera);
    }

    fn evaluate(
        &self,
        context: &mut FitContext,
        exposure: Exposure<'_>,
        plan: &StepPlan,
        draw: u64,
    ) -> ExposureLoss {
        let given = FieldExposure {
            exposure,
            pixels: PIXELS.min(exposure.seen.depth.len() / PIXEL_SHARE + 1),
            weights: FieldWeights::default(),
            sampling: SamplingSettings::default(),
            with_path: plan.path_pixels > 0.0,
            seed: self.seed,
            step: draw,
        };
        context.field_loss.evaluate(&self.field, &given)
    }

    fn step(&mut self, context: &mut FitContext, plan: &StepPlan) {
        let step = FieldStep::default().scaled(plan.shrink);
        self.adam.step(context.level, &mut self.field, context.field_loss.gradients(), step);
    }

    fn make_room(&mut self, seen: &Observation, world_from_camera: &RigidTransform) {
        if let Some(region) = measured_region(seen, world_from_camera) {
            self.field.grow(&region);
            self.is_seeded = true;
        }
    }
}

/// The box around what a frame measured and its camera; `None` without any depth.
fn measured_region(seen: &Observation, world_from_camera: &RigidTransform) -> Option<Region> {
    let camera = &seen.camera;
    let (columns, rows) = (camera.width, camera.height);
    let pixels = (0..rows).step_by(STRIDE).flat_map(|v| (0..columns).step_by(STRIDE).map(move |u| (u, v)));
    let measured = |(u, v): (usize, usize)| (u, v, seen.depth[v * columns + u]);
    let mut depths: Vec<_> = pixels.map(measured).filter(|(_, _, depth)| *depth > 0.0).collect();
    depths.sort_by(|a, b| a.2.total_cmp(&b.2));
    depths.truncate((TRUSTED * depths.len() as f64).ceil() as usize);
    let eye = world_from_camera.translation;
    let points = depths.iter().map(|&(u, v, depth)| {
        world_from_camera.transform_point(&(camera.ray(u as f64, v as f64) * f64::from(depth)))
    });
    let (least, most) = points.fold((eye, eye), |(least, most), x| (least.inf(&x), most.sup(&x)));
    let reach = |x: f64| (x - MARGIN, x + MARGIN);
    (!depths.is_empty())
        .then(|| Region::around(least.map(|x| reach(x).0).into(), most.map(|x| reach(x).1).into()))
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::PinholeCamera;
    use mba_tracker::image::PixelRectangle;
    use nalgebra::Vector3;

    use super::*;
    use mba_raster::exposure::RowTimes;

    #[test]
    fn the_box_holds_what_is_seen_wherever_a_keyframe_is_moved_to() {
        let camera = PinholeCamera { width: 16, height: 12, fx: 16.0, fy: 16.0, cx: 7.5, cy: 5.5 };
        let region = PixelRectangle { left: 0, top: 0, right: 16, bottom: 12 };
        let plane = || vec![0; 16 * 12];
        let colour = [plane(), plane(), plane()];
        let depth = vec![2.0; 16 * 12];
        let seen = Observation { camera, colour, depth, region, times: RowTimes::GLOBAL, falloff: None };
        let mut map = FieldMap::new(1);
        assert!(map.is_empty());
        for x in [0.0, 1.5] {
            let translation = Vector3::new(x, 0.0, 0.0);
            map.make_room(&seen, &RigidTransform { translation, ..RigidTransform::identity() });
        }
        assert!(!map.is_empty());
        // Columns reach from -7.5/16 to 4.5/16 of the depth, as every fourth is looked at; cells have 0.24 m.
        let (least, most) = (-2.0 * 7.5 / 16.0 - MARGIN, 1.5 + 2.0 * 4.5 / 16.0 + MARGIN);
        let width = (most / 0.24).ceil() * 0.24 - (least / 0.24).floor() * 0.24;
        let height = (2.0 * 2.5 / 16.0 + MARGIN) / 0.24;
        let height = (height.ceil() + ((2.0 * 5.5 / 16.0 + MARGIN) / 0.24).ceil()) * 0.24;
        let length = (((2.0 + MARGIN) / 0.24).ceil() + 1.0) * 0.24;
        let volume = map.field.region().volume();
        assert!(
            (volume - width * height * length).abs() < 1e-6,
            "{volume}, not {width} x {height} x {length}"
        );
    }
}
