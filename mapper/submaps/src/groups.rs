//! Where the path is cut into groups.

use std::ops::Range;

use mba_tracker::geometry::{PinholeCamera, RigidTransform};

use crate::shared_view::CoarseView;

/// Turn of the camera after which a group is closed, radians, all turns added up.
const LONGEST_TURN: f64 = 3.0;

/// Path after which a group is closed, in typical depths of the scene.
const LONGEST_PATH: f64 = 3.0;

/// Share of the view of a group's first keyframe below which the group is closed.
const LEAST_SHARED: f64 = 0.1;

/// How many keyframes a group has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GroupLimits {
    /// The fewest, at least 1; a run with fewer is one group.
    pub least: usize,
    /// The most, at least `least`.
    pub most: usize,
}

impl Default for GroupLimits {
    fn default() -> Self {
        Self { least: 60, most: 100 }
    }
}

/// Cuts a path into groups of keyframes, given by their poses and coarse views: a group that has the fewest keyframes is
/// closed when the camera has gone far, turned much, or left what it saw at first, and any other one when it has the most.
pub(crate) fn cut(
    poses: &[RigidTransform],
    views: &[CoarseView],
    camera: &PinholeCamera,
    depth: f64,
    limits: GroupLimits,
) -> Vec<Range<usize>> {
    let mut groups: Vec<Range<usize>> = Vec::new();
    let (mut start, mut path, mut turn) = (0, 0.0, 0.0);
    for k in 0..poses.len() {
        let count = k - start;
        let has_left = || views[start].shared_with(&views[k], camera) < LEAST_SHARED;
        // What a camera that turned or went so far sees has little to do with what it saw first.
        let is_far = path > LONGEST_PATH * depth || turn > LONGEST_TURN;
        if count >= limits.most || (count >= limits.least && (is_far || has_left())) {
            groups.push(start..k);
            (start, path, turn) = (k, 0.0, 0.0);
        }
        if let Some(next) = poses.get(k + 1) {
            path += (next.translation - poses[k].translation).norm();
            turn += next.rotation.angle_to(&poses[k].rotation);
        }
    }
    groups.push(start..poses.len());
    join_short_end(&mut groups, limits);
    groups
}

/// A last group that is too small becomes one with the group before it, or takes half of what both have.
fn join_short_end(groups: &mut Vec<Range<usize>>, limits: GroupLimits) {
    let [.., before, last] = groups.as_mut_slice() else { return };
    if last.len() >= limits.least {
        return;
    }
    let both = before.start..last.end;
    if both.len() <= limits.most {
        *before = both;
        groups.pop();
    } else {
        let middle = both.start + both.len() / 2;
        (*before, *last) = (both.start..middle, middle..both.end);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared_view::tests::{CAMERA, view};

    const LIMITS: GroupLimits = GroupLimits { least: 6, most: 10 };

    /// Sizes of the groups of views at these shifts along a wall at 2 m.
    fn sizes(shifts: &[f64]) -> Vec<usize> {
        let views: Vec<CoarseView> = shifts.iter().map(|shift| view(0.0, *shift, 2.0)).collect();
        let pose = |shift: &f64| {
            let mut pose = RigidTransform::identity();
            pose.translation.x = *shift;
            pose
        };
        let poses: Vec<RigidTransform> = shifts.iter().map(pose).collect();
        cut(&poses, &views, &CAMERA, 2.0, LIMITS).into_iter().map(|group| group.len()).collect()
    }

    #[test]
    fn a_standing_camera_fills_groups_and_a_moving_one_closes_them() {
        assert_eq!(sizes(&[0.0; 20]), [10, 10]);
        // 0.8 m a keyframe: after six the first view is left.
        let moving: Vec<f64> = (0..18).map(|k| 0.8 * f64::from(k)).collect();
        assert_eq!(sizes(&moving), [6, 6, 6]);
        assert_eq!(sizes(&[0.0; 3]), [3]);
    }

    #[test]
    fn the_rest_is_shared_out() {
        assert_eq!(sizes(&[0.0; 13]), [6, 7]);
        let moving: Vec<f64> = (0..9).map(|k| 0.8 * f64::from(k)).collect();
        assert_eq!(sizes(&moving), [9]);
    }
}
