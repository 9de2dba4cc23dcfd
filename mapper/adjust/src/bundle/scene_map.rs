//! A map of any kind, as it is fitted.

use mba_map::map::{MapKind, MapSize, Scene};
use mba_raster::losses::{Exposure, ExposureLoss};
use mba_raster::sensor::Observation;
use mba_tracker::geometry::RigidTransform;
use serde::{Deserialize, Serialize};

use super::field_map::FieldMap;
use super::gaussian_map::GaussianMap;
use super::map_model::{FitContext, MapModel};
use super::schedule::StepPlan;
use super::seed_view::SeedView;
use super::world_moves::WorldMoves;

/// A map of either kind, with what its optimiser remembers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(clippy::large_enum_variant, reason = "a program has one or two, not a list of them")]
pub enum SceneMap {
    /// 3D Gaussians.
    Gaussians(GaussianMap),
    /// A tri-plane field.
    Field(Box<FieldMap>),
}

impl SceneMap {
    /// An empty map; `seed` decides about what is random in it.
    #[must_use]
    pub fn new(kind: MapKind, seed: u64) -> Self {
        match kind {
            MapKind::Gaussians => Self::Gaussians(GaussianMap::default()),
            MapKind::Field => Self::Field(Box::new(FieldMap::new(seed))),
        }
    }

    /// Which kind it is.
    #[must_use]
    pub fn kind(&self) -> MapKind {
        match self {
            Self::Gaussians(_) => MapKind::Gaussians,
            Self::Field(_) => MapKind::Field,
        }
    }

    fn model(&self) -> &dyn MapModel<Context = FitContext> {
        match self {
            Self::Gaussians(map) => map,
            Self::Field(map) => &**map,
        }
    }

    fn model_mut(&mut self) -> &mut dyn MapModel<Context = FitContext> {
        match self {
            Self::Gaussians(map) => map,
            Self::Field(map) => &mut **map,
        }
    }
}

impl MapModel for SceneMap {
    type Context = FitContext;

    fn scene(&self) -> Scene<'_> {
        self.model().scene()
    }

    fn is_empty(&self) -> bool {
        self.model().is_empty()
    }

    fn size(&self) -> MapSize {
        self.model().size()
    }

    fn seed(&mut self, context: &mut FitContext, view: &SeedView<'_>, most: usize) {
        self.model_mut().seed(context, view, most);
    }

    fn evaluate(
        &self,
        context: &mut FitContext,
        exposure: Exposure<'_>,
        plan: &StepPlan,
        draw: u64,
    ) -> ExposureLoss {
        self.model().evaluate(context, exposure, plan, draw)
    }

    fn step(&mut self, context: &mut FitContext, plan: &StepPlan) {
        self.model_mut().step(context, plan);
    }

    fn change_density(&mut self, most: usize) {
        self.model_mut().change_density(most);
    }

    fn reorder(&mut self) {
        self.model_mut().reorder();
    }

    fn move_along(&mut self, moves: &WorldMoves) {
        self.model_mut().move_along(moves);
    }

    fn make_room(&mut self, seen: &Observation, world_from_camera: &RigidTransform) {
        self.model_mut().make_room(seen, world_from_camera);
    }
}

impl<'a> From<&'a SceneMap> for Scene<'a> {
    fn from(map: &'a SceneMap) -> Self {
        map.scene()
    }
}
