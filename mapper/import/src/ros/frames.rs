//! Where sensors are, from transforms between named frames.

use std::collections::HashMap;

use mba_tracker::geometry::RigidTransform;

/// Longest chain of transforms, so that one that bites its tail ends.
const LONGEST_CHAIN: usize = 64;

/// Most frames that are kept: more than any robot has.
const MOST_FRAMES: usize = 10_000;

/// A tree of frames. What is said of a frame first holds: sensors do not move in their housing.
#[derive(Debug, Default)]
pub(super) struct Frames(HashMap<String, (String, RigidTransform)>);

impl Frames {
    /// Takes up where a frame is in its parent.
    pub(super) fn add(&mut self, parent: &str, child: &str, parent_from_child: RigidTransform) {
        let (parent, child) = (plain(parent), plain(child));
        if self.0.len() < MOST_FRAMES && !self.0.contains_key(child) {
            self.0.insert(child.to_owned(), (parent.to_owned(), parent_from_child));
        }
    }

    /// What takes points of frame `from` to those of frame `to`, if both are related.
    pub(super) fn between(&self, to: &str, from: &str) -> Option<RigidTransform> {
        let (to, from) = (self.chain(plain(to)), self.chain(plain(from)));
        let (ancestor, ancestor_from_from) =
            from.iter().find(|(name, _)| to.iter().any(|(other, _)| other == name))?;
        let (_, ancestor_from_to) = to.iter().find(|(name, _)| name == ancestor)?;
        Some(ancestor_from_to.inverse().compose(ancestor_from_from))
    }

    /// The frame itself and all above it, with what takes points of the frame to them.
    fn chain<'a>(&'a self, frame: &'a str) -> Vec<(&'a str, RigidTransform)> {
        let mut chain = vec![(frame, RigidTransform::identity())];
        while let Some((name, from_frame)) = chain.last().copied()
            && let Some((parent, parent_from_child)) = self.0.get(name)
            && chain.len() < LONGEST_CHAIN
        {
            chain.push((parent, parent_from_child.compose(&from_frame)));
        }
        chain
    }
}

/// ROS once began the names of frames with a slash.
fn plain(name: &str) -> &str {
    name.trim_start_matches('/')
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    fn shift(x: f64) -> RigidTransform {
        RigidTransform::new(UnitQuaternion::identity(), Vector3::new(x, 0.0, 0.0))
    }

    #[test]
    fn frames_are_related_through_what_they_have_in_common() {
        let mut frames = Frames::default();
        let quarter = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
        frames.add("link", "colour_frame", shift(0.015));
        frames.add("/colour_frame", "colour_optical", RigidTransform::new(quarter, Vector3::zeros()));
        frames.add("link", "depth_optical", shift(-0.01));
        // A later place of the same frame does not count.
        frames.add("link", "depth_optical", shift(7.0));
        let colour_from_depth = frames.between("colour_optical", "depth_optical").unwrap();
        let seen = colour_from_depth.transform_point(&Vector3::new(1.0, 0.0, 2.0));
        assert!((seen - Vector3::new(0.0, -0.975, 2.0)).norm() < 1e-12, "{seen}");
        assert_eq!(frames.between("a", "a"), Some(RigidTransform::identity()));
        assert_eq!(frames.between("a", "link"), None);
    }

    #[test]
    fn a_chain_that_bites_its_tail_ends() {
        let mut frames = Frames::default();
        frames.add("b", "a", shift(1.0));
        frames.add("a", "b", shift(1.0));
        assert_eq!(frames.between("c", "a"), None);
    }
}
