//! What a frame tells about the one before it.

use nalgebra::Vector6;

use super::frame::Frame;
use super::history::Motion;
use super::result::Revision;
use super::track::Tracker;
use crate::geometry::RigidTransform;
use crate::keyframe::typical_inverse_depth;
use crate::trajectory::ExposureTrajectory;

/// Pixels by which the motion during an exposure may exceed that between frames: twice the error of a good blur length.
const IMPOSSIBLE_MARGIN: f64 = 1.5;

/// Pixels of expected blur from which its direction says which way time runs.
const DIRECTED: f64 = 1.0;

impl Tracker<'_> {
    /// Judges the exposure motion of the last frame, now that the poses on both sides of it are known.
    ///
    /// A shutter is open for at most the time between two frames, so that the picture cannot move farther during an
    /// exposure than to the farther of its neighbours; and a blurred picture does not tell the direction of time. What is
    /// impossible is replaced by the motion between the neighbours, what fits better reversed is reversed.
    pub(super) fn revise_last(
        &self,
        frame: &Frame,
        motion: &Motion,
        world_from_mid: &RigidTransform,
    ) -> Option<Revision> {
        let measured =
            motion.within_exposure.filter(|_| motion.interval.is_finite() && motion.exposure > 0.0)?;
        let dt = frame.timestamp - motion.timestamp;
        let next = motion.reference_from_mid.tangent_to(world_from_mid) / dt;
        let slope = (next * motion.interval + motion.between_frames * dt) / (dt + motion.interval);
        let [within, farther_before, farther_after, of_slope] = [
            measured * motion.exposure,
            motion.between_frames * motion.interval,
            next * dt,
            slope * motion.exposure,
        ]
        .map(|way| self.way_in_pixels(&way));
        let rate = if within > farther_before.max(farther_after) + IMPOSSIBLE_MARGIN {
            slope
        } else if !self.timing.is_rolling()
            && of_slope > DIRECTED
            && self.way_in_pixels(&(measured + slope)) < self.way_in_pixels(&(measured - slope))
        {
            -measured
        } else {
            return None;
        };
        let world_from_camera =
            ExposureTrajectory::from_mid_and_motion(&motion.reference_from_mid, &(rate * motion.exposure));
        let seen = world_from_camera.seen_from(&self.keyframe.world_from_keyframe.inverse());
        Some(Revision {
            index: self.last_index,
            world_from_camera,
            world_from_mid: motion.reference_from_mid,
            blur: self.blur_length(&seen),
        })
    }

    /// About how far a motion (translation, rotation) moves the picture.
    pub(super) fn way_in_pixels(&self, way: &Vector6<f64>) -> f64 {
        let rho = typical_inverse_depth(self.keyframe.finest_keypoints());
        let (shift, turn) = (way.fixed_rows::<3>(0).norm() * rho, way.fixed_rows::<3>(3).norm());
        self.config.camera.fx * crate::math::sqrt(shift * shift + turn * turn)
    }
}
