//! What the adjustment asks of a map, whatever it consists of.

use core::fmt;

use mba_field::triplane::FieldLoss;
use mba_map::map::{MapSize, Scene, SceneRenderer};
use mba_raster::losses::{Exposure, ExposureLoss};
use mba_raster::sensor::{Observation, Sensor};
use mba_tracker::geometry::RigidTransform;
use mba_tracker::simd::Level;

use super::gaussian_loss::GaussianLoss;
use super::schedule::StepPlan;
use super::seed_view::SeedView;
use super::world_moves::WorldMoves;

/// Tables and memory that Gaussians and fields work with. Only the gradients of the last exposure stay, for the step that follows.
#[derive(Debug)]
pub struct FitContext {
    pub(super) level: Level,
    pub(super) sensor: Sensor,
    pub(super) gaussian_loss: GaussianLoss,
    pub(super) field_loss: FieldLoss,
    pub(super) renderer: SceneRenderer,
}

impl FitContext {
    pub(super) fn new(level: Level, sensor: Sensor) -> Self {
        Self {
            level,
            gaussian_loss: GaussianLoss::new(level, &sensor),
            field_loss: FieldLoss::new(level, &sensor),
            renderer: SceneRenderer::new(level),
            sensor,
        }
    }
}

/// A map that can be fitted to exposures by a [`BundleAdjustment`](super::BundleAdjustment).
///
/// A kind of maps of its own implements this and [`RenderedMap`](mba_map::map::RenderedMap); what it has no use for does
/// nothing.
pub trait MapModel {
    /// Tables and memory that it works with. Only the gradients of the last exposure stay, for the step that follows.
    type Context: fmt::Debug;

    /// The map for a renderer.
    fn scene(&self) -> Scene<'_>;

    /// Whether nothing was seeded yet.
    fn is_empty(&self) -> bool;

    /// How large it is.
    fn size(&self) -> MapSize;

    /// Adds what a keyframe sees and the map does not have, or makes room for it. `most` bounds the Gaussians.
    fn seed(&mut self, context: &mut Self::Context, view: &SeedView<'_>, most: usize);

    /// The loss of an exposure; gradients by the map stay in the context. A map that looks at some pixels only chooses
    /// them by the number `draw`.
    fn evaluate(
        &self,
        context: &mut Self::Context,
        exposure: Exposure<'_>,
        plan: &StepPlan,
        draw: u64,
    ) -> ExposureLoss;

    /// One step against the gradients in the context.
    fn step(&mut self, context: &mut Self::Context, plan: &StepPlan);

    /// Puts detail where it is missing and removes what is useless.
    fn change_density(&mut self, _most: usize) {}

    /// Puts neighbours in space next to each other in memory.
    fn reorder(&mut self) {}

    /// Moves parts of the map with their keyframes, as far as it has parts.
    fn move_along(&mut self, _moves: &WorldMoves) {}

    /// Makes room for what a keyframe sees from a new pose.
    fn make_room(&mut self, _seen: &Observation, _world_from_camera: &RigidTransform) {}
}
