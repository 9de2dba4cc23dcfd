//! Gaussians as the map of the adjustment.

use mba_map::map::{MapSize, Scene};
use mba_raster::gaussians::Gaussians;
use mba_raster::losses::{Exposure, ExposureLoss};
use serde::{Deserialize, Serialize};

use super::map_model::{FitContext, MapModel};
use super::optimiser_state::OptimiserState;
use super::schedule::StepPlan;
use super::seed_view::SeedView;
use super::world_moves::{WorldMoves, move_gaussians};
use super::{adam, density, seeding};

/// Longest growth of the map at one change of density, as a fraction of its size.
const GROWTH: f64 = 0.15;

/// Gaussians, and what is kept of each besides.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GaussianMap {
    /// The map.
    pub gaussians: Gaussians,
    optimiser: OptimiserState,
}

/// There are no bounds that room would have to be made within.
impl MapModel for GaussianMap {
    type Context = FitContext;

    fn scene(&self) -> Scene<'_> {
        Scene::Gaussians(&self.gaussians)
    }

    fn is_empty(&self) -> bool {
        self.gaussians.is_empty()
    }

    fn size(&self) -> MapSize {
        MapSize::Gaussians(self.gaussians.len())
    }

    fn seed(&mut self, context: &mut FitContext, view: &SeedView<'_>, most: usize) {
        context.renderer.render(self.scene(), context.sensor.camera, &view.world_from_camera);
        let SeedView { index, .. } = view;
        let (alpha, response) = (&context.renderer.image.alpha, &context.sensor.inverse_response);
        let room = most.saturating_sub(self.gaussians.len());
        seeding::seed(&mut self.gaussians, view, response, alpha, room);
        self.optimiser.append(self.gaussians.len(), *index);
    }

    fn evaluate(
        &self,
        context: &mut FitContext,
        exposure: Exposure<'_>,
        plan: &StepPlan,
        _draw: u64,
    ) -> ExposureLoss {
        context.gaussian_loss.evaluate(&self.gaussians, exposure, plan)
    }

    fn step(&mut self, context: &mut FitContext, plan: &StepPlan) {
        let (gradients, drawn) = (context.gaussian_loss.gradients(), context.gaussian_loss.drawn());
        let Self { gaussians, optimiser } = self;
        adam::step(gaussians, &gradients.parameters, drawn, &plan.lengths, &mut optimiser.moments);
        optimiser.screen_gradient.add(&gradients.screen, drawn);
    }

    /// Divides Gaussians that are torn between pixels, removes useless ones, and puts the others in order.
    fn change_density(&mut self, most: usize) {
        let Self { gaussians, optimiser } = self;
        let count = gaussians.len();
        let room = most.saturating_sub(count).min((GROWTH * count as f64) as usize);
        density::divide(gaussians, optimiser, room);
        density::prune(gaussians, optimiser);
        self.reorder();
    }

    fn reorder(&mut self) {
        let order = density::morton_order(&self.gaussians);
        density::select(&mut self.gaussians, &mut self.optimiser, &order);
    }

    /// Every Gaussian moves with the keyframe that it was seeded from, or with the next one in time if that was given up.
    fn move_along(&mut self, moves: &WorldMoves) {
        move_gaussians(&mut self.gaussians, &self.optimiser.origins, moves);
    }
}
