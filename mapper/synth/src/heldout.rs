//! Views that no frame of a sequence sees, to judge a map by.

use mba_io::trajectory_file::TimedPose;
use mba_tracker::geometry::RigidTransform;
use nalgebra::{UnitQuaternion, Vector3};

use super::SynthSequence;

/// One view for so many frames.
const FRAMES_PER_VIEW: usize = 6;

/// Most views of a sequence.
const MAX_VIEWS: usize = 12;

/// Shift (right, down, forward; metres) and turn (about the same axes; radians) of the views against the path, one
/// after the other. Small enough that the frames have seen what the views show.
const BESIDE_THE_PATH: [([f64; 3], [f64; 3]); 4] = [
    ([0.03, 0.0, 0.0], [0.0, -0.02, 0.0]),
    ([-0.03, 0.01, 0.0], [0.02, 0.02, 0.0]),
    ([0.0, -0.03, 0.02], [-0.02, 0.0, 0.03]),
    ([0.02, 0.02, -0.02], [0.0, 0.02, -0.03]),
];

impl SynthSequence {
    /// Poses near the camera's path, between frames and a little beside it, in order of time; with
    /// [`Self::render_view`] they test whether a map shows more than its own images.
    #[must_use]
    pub fn heldout_poses(&self) -> Vec<TimedPose> {
        poses(self)
    }
}

/// Poses half way between two frames in time, a little beside the camera's path; their timestamps lie between those
/// of the frames.
fn poses(sequence: &SynthSequence) -> Vec<TimedPose> {
    let views = sequence.len().div_ceil(FRAMES_PER_VIEW).min(MAX_VIEWS);
    let half_interval = 0.5 / sequence.config().frame_rate;
    let pose = |(view, beside): (usize, &([f64; 3], [f64; 3]))| {
        let frame = (2 * view + 1) * (sequence.len() - 1) / (2 * views);
        // Files hold whole microseconds.
        let timestamp = ((sequence.timestamp(frame) + half_interval) * 1e6).round() / 1e6;
        let (shift, turn) = (Vector3::from(beside.0), Vector3::from(beside.1));
        let path_from_view = RigidTransform::new(UnitQuaternion::from_scaled_axis(turn), shift);
        let world_from_camera = sequence.world_from_camera(timestamp).compose(&path_from_view);
        TimedPose { timestamp, world_from_camera }
    };
    (0..views).zip(BESIDE_THE_PATH.iter().cycle()).map(pose).collect()
}
