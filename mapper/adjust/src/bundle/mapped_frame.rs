//! A frame that the map is fitted to: what was captured, and what is estimated of it.

use mba_raster::sensor::{Observation, ObservationPyramid};

use super::brightness::Placed;
use super::frame_state::FrameState;
use super::path_metric::PathMetric;
use super::path_step::PathPrior;

/// A keyframe of a map, and what was estimated of it so far.
#[derive(Clone, Debug)]
pub struct MappedFrame {
    /// What does not change from step to step.
    pub keyframe: MapKeyframe,
    /// What does: path and brightness.
    pub state: FrameState,
}

impl MappedFrame {
    /// What it shows at resolution `level`, where 0 is full, and from where.
    #[must_use]
    pub fn placed(&self, level: usize) -> Placed<'_> {
        Placed { seen: self.keyframe.observation.level(level), world_from_camera: self.state.path.mid() }
    }
}

/// What is known of a frame that the map is fitted to.
#[derive(Clone, Debug)]
pub struct MapKeyframe {
    /// Index in the data set.
    pub index: usize,
    /// What was captured.
    pub observation: ObservationPyramid,
    /// What is known of its path besides.
    pub prior: PathPrior,
    /// Typical depth, metres.
    pub depth: f64,
    /// Coordinates of its path.
    pub metric: PathMetric,
}

impl MapKeyframe {
    /// Frame `index` of the data set.
    #[must_use]
    pub fn new(index: usize, observation: ObservationPyramid, prior: PathPrior) -> Self {
        let depth = typical_depth(observation.level(0));
        let metric = PathMetric::new(observation.level(1), depth);
        Self { index, observation, prior, depth, metric }
    }
}

/// Typical depth of an observation, metres; 2 where nothing was measured.
fn typical_depth(seen: &Observation) -> f64 {
    let mut depths: Vec<f32> = seen.depth.iter().copied().filter(|depth| *depth > 0.0).step_by(7).collect();
    if depths.is_empty() {
        return 2.0;
    }
    let middle = depths.len() / 2;
    f64::from(*depths.select_nth_unstable_by(middle, f32::total_cmp).1)
}
