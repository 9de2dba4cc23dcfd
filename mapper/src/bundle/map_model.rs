//! What the adjustment asks of a map, whatever it consists of.

use mba_tracker::geometry::RigidTransform;
use mba_tracker::simd::Level;
use serde::{Deserialize, Serialize};

use super::engine::Engine;
use super::field_map::FieldMap;
use super::gaussian_map::GaussianMap;
use super::moving::WorldMoves;
use super::schedule::StepPlan;
use super::seeding::DepthSource;
use crate::losses::{Exposure, ExposureLoss};
use crate::map::{MapKind, MapSize, Scene, SceneRenderer};
use crate::sensor::{Observation, Sensor};
use crate::triplane::TriplaneEngine;

/// Tables and memory that maps work with. Only the gradients of the last exposure stay, for the step that follows.
#[derive(Debug)]
pub(super) struct Workbench {
    pub(super) level: Level,
    pub(super) sensor: Sensor,
    pub(super) engine: Engine,
    pub(super) field_engine: TriplaneEngine,
    pub(super) renderer: SceneRenderer,
}

impl Workbench {
    pub(super) fn new(level: Level, sensor: Sensor) -> Self {
        Self {
            level,
            engine: Engine::new(level, &sensor),
            field_engine: TriplaneEngine::new(level, &sensor),
            renderer: SceneRenderer::new(level),
            sensor,
        }
    }
}

/// What a keyframe shows, and from where.
#[derive(Clone, Copy, Debug)]
pub(super) struct SeedView<'a> {
    /// Index in the data set.
    pub(super) index: usize,
    /// What was captured, at full resolution.
    pub(super) seen: &'a Observation,
    /// The pose at mid exposure.
    pub(super) world_from_camera: RigidTransform,
    /// Gain on the map's light that gives what was captured.
    pub(super) gain: f32,
    /// Where depth comes from.
    pub(super) source: DepthSource,
}

/// A map that can be fitted to exposures.
pub(super) trait MapModel {
    /// The map for a renderer.
    fn scene(&self) -> Scene<'_>;

    /// Whether nothing was seeded yet.
    fn is_empty(&self) -> bool;

    /// How large it is.
    fn size(&self) -> MapSize;

    /// Adds what a keyframe sees and the map does not have, or makes room for it. `most` bounds the Gaussians.
    fn seed(&mut self, bench: &mut Workbench, view: &SeedView<'_>, most: usize);

    /// The loss of an exposure; gradients by the map stay on the bench. A map that looks at some pixels only chooses
    /// them by the number `draw`.
    fn evaluate(
        &self,
        bench: &mut Workbench,
        exposure: Exposure<'_>,
        plan: &StepPlan,
        draw: u64,
    ) -> ExposureLoss;

    /// One step against the gradients on the bench.
    fn step(&mut self, bench: &mut Workbench, plan: &StepPlan);

    /// Puts detail where it is missing and removes what is useless.
    fn change_density(&mut self, most: usize);

    /// Puts neighbours in space next to each other in memory.
    fn reorder(&mut self);

    /// Moves parts of the map with their keyframes, as far as it has parts.
    fn move_along(&mut self, moves: &WorldMoves);

    /// Makes room for what a keyframe sees from a new pose.
    fn make_room(&mut self, seen: &Observation, world_from_camera: &RigidTransform);
}

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

    /// The map for a renderer.
    #[must_use]
    pub fn scene(&self) -> Scene<'_> {
        self.model().scene()
    }

    /// Whether nothing was seeded yet.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.model().is_empty()
    }

    /// How large it is.
    #[must_use]
    pub fn size(&self) -> MapSize {
        self.model().size()
    }

    pub(super) fn model(&self) -> &dyn MapModel {
        match self {
            Self::Gaussians(map) => map,
            Self::Field(map) => &**map,
        }
    }

    pub(super) fn model_mut(&mut self) -> &mut dyn MapModel {
        match self {
            Self::Gaussians(map) => map,
            Self::Field(map) => &mut **map,
        }
    }
}

impl<'a> From<&'a SceneMap> for Scene<'a> {
    fn from(map: &'a SceneMap) -> Self {
        map.scene()
    }
}
