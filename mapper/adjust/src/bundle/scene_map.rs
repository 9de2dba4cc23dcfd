//! A map of any kind, as it is fitted.

use mba_map::map::{MapKind, MapSize, Scene};
use serde::{Deserialize, Serialize};

use super::field_map::FieldMap;
use super::gaussian_map::GaussianMap;
use super::map_model::MapModel;

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
