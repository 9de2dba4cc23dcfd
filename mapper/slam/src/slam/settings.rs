//! What can be chosen about a SLAM run.

use std::time::Duration;

use mba_map::map::MapKind;
use mba_tracker::ReferenceMode;
use nalgebra::UnitVector3;

use crate::mapping::MapSettings;
use crate::tracking::TrackingOptions;

/// What each frame is aligned with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SlamReference {
    /// The tracker's keyframe as it was captured.
    Raw,
    /// The tracker's keyframe, deblurred with its own motion.
    Deblurred,
    /// A view rendered from the map; the deblurred keyframe while the map is young.
    #[default]
    Map,
}

/// When frames arrive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Arrival {
    /// As fast as they are processed; tracker and mapper go in lock step and the result does not depend on the
    /// machine's speed or the number of threads.
    #[default]
    LockStep,
    /// By their timestamps; those that come too late for the tracker are skipped.
    RealTime,
}

/// Settings of [`run_slam`](super::run_slam).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlamSettings {
    /// What the map consists of.
    pub kind: MapKind,
    /// Whether motion during the exposure is modelled.
    pub blur: bool,
    /// Upper bound of virtual views per exposure, in tracker and mapper; `None` for as many as the blur asks for.
    pub virtual_views: Option<usize>,
    /// What each frame is aligned with.
    pub reference: SlamReference,
    /// Whether the depth map of each frame takes part in tracking.
    pub depth_term: bool,
    /// Whether places that are seen again correct the drift.
    pub loops: bool,
    /// Whether the refinement after the last frame repairs frames and predicts their motions by what their neighbours do.
    pub continuity: bool,
    /// Most keyframes at a time, at least 2; beyond it those that add the least are given up.
    pub max_keyframes: usize,
    /// Most Gaussians; `None` for one that grows with what was seen.
    pub max_gaussians: Option<usize>,
    /// Time for the refinement after the last frame; `None` for a number of steps by the number of keyframes.
    pub time_budget: Option<Duration>,
    /// When frames arrive.
    pub arrival: Arrival,
    /// Time between two checkpoints, in lock step; zero for one after every frame and step. It does not change the
    /// result.
    pub checkpoint_interval: Duration,
    /// Seed of the choice of keyframes to visit.
    pub seed: u64,
    /// Where up is in the axes of the first camera; `None` for what an accelerometer says, if there is one.
    pub up: Option<UnitVector3<f64>>,
}

impl Default for SlamSettings {
    fn default() -> Self {
        Self {
            kind: MapKind::default(),
            blur: true,
            virtual_views: None,
            reference: SlamReference::default(),
            depth_term: true,
            loops: true,
            continuity: true,
            max_keyframes: 100,
            max_gaussians: None,
            time_budget: None,
            arrival: Arrival::default(),
            checkpoint_interval: MapSettings::default().checkpoint_interval,
            seed: 1,
            up: None,
        }
    }
}

impl SlamSettings {
    /// The tracker's choices.
    #[must_use]
    pub fn tracking(&self) -> TrackingOptions {
        TrackingOptions {
            blur: self.blur,
            virtual_views: self.virtual_views,
            reference: match self.reference {
                SlamReference::Raw => ReferenceMode::Raw,
                SlamReference::Deblurred | SlamReference::Map => ReferenceMode::Deblurred,
            },
            depth_term: self.depth_term,
        }
    }

    /// The choices of the refinement after the last frame.
    #[must_use]
    pub fn mapping(&self) -> MapSettings {
        MapSettings {
            kind: self.kind,
            blur: self.blur,
            continuity: self.continuity,
            virtual_views: self.virtual_views,
            max_keyframes: self.max_keyframes,
            max_gaussians: self.max_gaussians,
            time_budget: self.time_budget,
            seed: self.seed,
            ..MapSettings::default()
        }
    }
}
