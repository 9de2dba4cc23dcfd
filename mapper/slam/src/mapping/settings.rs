//! What can be chosen about a map.

use std::time::Duration;

use mba_map::map::MapKind;
use serde::Serialize;

use mba_adjust::bundle::BundleSettings;

/// Settings of [`map_dataset`](super::map_dataset).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapSettings {
    /// What the map consists of.
    pub kind: MapKind,
    /// Whether motion during the exposure is modelled.
    pub blur: bool,
    /// Whether frames are repaired and their motions predicted by what their neighbours do.
    pub continuity: bool,
    /// Upper bound of virtual views per exposure; `None` for the schedule's own.
    pub virtual_views: Option<usize>,
    /// Most keyframes; further frames are fitted to the finished map. At least 1.
    pub max_keyframes: usize,
    /// Most Gaussians; `None` for one that fits what the keyframes see.
    pub max_gaussians: Option<usize>,
    /// Time for all of it; `None` for as many steps as the schedule has, and equal results on all machines of a kind.
    pub time_budget: Option<Duration>,
    /// Time between two checkpoints; zero for one after every step. It does not change the result.
    pub checkpoint_interval: Duration,
    /// Seed of the order in which keyframes are visited, and of what is random in the map.
    pub seed: u64,
}

impl Default for MapSettings {
    fn default() -> Self {
        Self {
            kind: MapKind::default(),
            blur: true,
            continuity: true,
            virtual_views: None,
            max_keyframes: 100,
            max_gaussians: None,
            time_budget: None,
            checkpoint_interval: Duration::from_secs(20),
            seed: 1,
        }
    }
}

/// The settings that change the result, for the identity of a checkpoint.
#[derive(Serialize)]
pub(super) struct Decisive {
    bundle: BundleSettings,
    max_gaussians: Option<usize>,
    continuity: bool,
    max_keyframes: usize,
    timed: bool,
}

impl MapSettings {
    /// Those of the bundle adjustment. Where the number of Gaussians is not asked for, none are allowed until it is known what
    /// there is to see.
    pub(crate) fn bundle(&self) -> BundleSettings {
        BundleSettings {
            kind: self.kind,
            blur: self.blur,
            max_views: self.virtual_views.unwrap_or(usize::MAX),
            max_gaussians: self.max_gaussians.unwrap_or(0),
            seed: self.seed,
        }
    }

    pub(super) fn decisive(&self) -> Decisive {
        Decisive {
            bundle: self.bundle(),
            max_gaussians: self.max_gaussians,
            continuity: self.continuity,
            max_keyframes: self.max_keyframes,
            timed: self.time_budget.is_some(),
        }
    }
}
