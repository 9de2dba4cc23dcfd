//! What a stopped adjustment goes on from.

use serde::{Deserialize, Serialize};

use super::frame_state::FrameState;
use super::scene_map::SceneMap;

/// How far an adjustment is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BundleProgress {
    /// Steps made.
    pub steps: usize,
    /// Those of the schedule.
    pub scheduled_steps: usize,
    /// Where the schedule stands, 0 to 1.
    pub position: f64,
}

/// All that changes from step to step, as it is read: enough to go on after an interruption.
#[derive(Debug, Deserialize)]
pub struct BundleState<M = SceneMap> {
    /// The map.
    pub map: M,
    /// One per keyframe, in their order.
    pub frames: Vec<FrameState>,
    /// How far the adjustment was.
    pub progress: BundleProgress,
}

/// The same as it is written.
#[derive(Debug, Serialize)]
pub struct BorrowedBundleState<'a, M = SceneMap> {
    /// The map.
    pub map: &'a M,
    /// One per keyframe, in their order.
    pub frames: Vec<&'a FrameState>,
    /// How far the adjustment is.
    pub progress: BundleProgress,
}
