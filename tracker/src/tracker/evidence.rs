//! What speaks for an alignment, and the judgement of it.

use super::frame::Frame;
use super::history::Motion;
use super::policy::{Evidence, judge};
use super::result::{Doubt, FrameStatus};
use super::track::{Tracker, exposure_of};
use crate::align::LevelOutcome;
use crate::geometry::RigidTransform;
use crate::trajectory::ExposureTrajectory;

impl Tracker<'_> {
    /// How far a pose can be trusted, and why no further.
    pub(super) fn judge(
        &self,
        outcome: &LevelOutcome,
        motion: &Motion,
        frame: &Frame,
    ) -> (FrameStatus, Option<Doubt>) {
        judge(outcome, &self.evidence(outcome, motion, frame), &self.typical)
    }

    /// Whether a hand can have moved the camera where an alignment ended.
    pub(super) fn is_reachable(&self, outcome: &LevelOutcome, motion: &Motion, frame: &Frame) -> bool {
        let mid = outcome.estimate.keyframe_from_camera.mid();
        motion.can_reach(&self.keyframe.world_from_keyframe.compose(&mid), frame.timestamp)
    }

    /// An alignment in the terms of the decisions.
    pub(super) fn evidence(&self, outcome: &LevelOutcome, motion: &Motion, frame: &Frame) -> Evidence {
        let keypoints = self.keyframe.finest_keypoints();
        let total = keypoints.len().max(1) as f32;
        let mid = outcome.estimate.keyframe_from_camera.mid();
        let path = ExposureTrajectory { start: RigidTransform::identity(), end: mid };
        Evidence {
            overlap: outcome.patches_in_view as f32 / total,
            inliers: outcome.patches as f32 / total,
            flow: self.blur_length(&path),
            blur: self.blur_length(&exposure_of(&outcome.estimate.path(), &self.timing)),
            depth_share: self.depth_share,
            is_reachable: self.is_reachable(outcome, motion, frame),
        }
    }
}
