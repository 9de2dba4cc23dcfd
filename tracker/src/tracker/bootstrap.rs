//! The second frame: it tells how the first one was moving.

use core::mem;

use nalgebra::Vector6;

use super::coarse_to_fine::Aligned;
use super::frame::Frame;
use super::history::Motion;
use super::reference::Sharpness;
use super::result::{FrameStatus, Revision};
use super::track::{Tracker, exposure_of};
use crate::align::Estimate;
use crate::geometry::RigidTransform;
use crate::trajectory::{BowedTrajectory, ExposureTrajectory, FrameTiming};

/// Alignments of the second frame with a first one whose own shear becomes known by them.
pub(super) const BOOTSTRAP_ROUNDS: usize = 2;

impl Tracker<'_> {
    /// Aligns the first frame after the first keyframe, whose own motion is unknown.
    ///
    /// Both are blurred alike, so they are aligned as they are; the motion between them then deblurs the keyframe,
    /// and the frame is aligned again.
    pub(super) fn bootstrap(&mut self, frame: &Frame, motion: &Motion) -> (Aligned, Option<Revision>) {
        let timing = self.timing;
        // Rows and depth are sheared alike in both, as long as neither is corrected.
        self.timing = FrameTiming::GLOBAL;
        let first = self.align(frame, motion, false, None);
        self.timing = timing;
        if self.judge(&first.outcome, motion, frame).0 == FrameStatus::Lost {
            return (first, None);
        }
        let dt = frame.timestamp - motion.timestamp;
        let mid = first.outcome.estimate.keyframe_from_camera.mid();
        let rate = RigidTransform::identity().tangent_to(&mid) / dt;
        // Where rows or depth have other times both frames are given better paths below.
        let sharpness = if timing.reaches_outside() { Sharpness::AsCaptured } else { Sharpness::Deblurred };
        self.set_keyframe_path(self.path_of_keyframe(&rate, &Vector6::zeros()), sharpness);
        let mut second = self.align(frame, motion, self.config.align.blur, Some(mid));
        let refined = self.rate_before(&second.outcome.estimate, dt);
        let mut path = self.path_of_keyframe(&refined, &Vector6::zeros());
        if timing.reaches_outside() {
            (second, path) = self.align_each_other(frame, motion, second);
        } else {
            self.keyframe.keyframe_from_camera = Some(path);
        }
        let exposure = exposure_of(&path, &self.keyframe.timing);
        let revision = Revision {
            index: self.keyframe.frame_index,
            world_from_camera: exposure.seen_from(&self.keyframe.world_from_keyframe),
            world_from_mid: self.keyframe.world_from_keyframe,
            blur: self.blur_length(&exposure),
        };
        (second, Some(revision))
    }

    /// Velocity of the keyframe, per second, when a frame `dt` seconds later was aligned with `estimate`: the mean of the
    /// velocities at both is that of the motion between them.
    pub(super) fn rate_before(&self, estimate: &Estimate, dt: f64) -> Vector6<f64> {
        let between = RigidTransform::identity().tangent_to(&estimate.keyframe_from_camera.mid()) / dt;
        between * 2.0 - estimate.keyframe_from_camera.motion() / self.span
    }

    /// The keyframe's path for a velocity and an acceleration at its middle, per second.
    pub(super) fn path_of_keyframe(
        &self,
        rate: &Vector6<f64>,
        acceleration: &Vector6<f64>,
    ) -> BowedTrajectory {
        let span = self.keyframe_span;
        let linear = ExposureTrajectory::from_mid_and_motion(&RigidTransform::identity(), &(rate * span));
        BowedTrajectory { linear, bow: acceleration * (0.5 * span * span), jerk: Vector6::zeros() }
    }

    /// Aligns the frame with the keyframe and the keyframe with the frame in turn, until each has been given one time with
    /// a path that was measured against the other. Returns the alignment of the frame and the keyframe's path.
    pub(super) fn align_each_other(
        &mut self,
        frame: &Frame,
        motion: &Motion,
        first: Aligned,
    ) -> (Aligned, BowedTrajectory) {
        let mut of_frame = first;
        let mut of_keyframe =
            BowedTrajectory::without_bow(ExposureTrajectory::still(RigidTransform::identity()));
        for round in 1..=BOOTSTRAP_ROUNDS {
            let sharpness =
                if round == BOOTSTRAP_ROUNDS { Sharpness::Deblurred } else { Sharpness::AsCaptured };
            let keyframe_from_mid = of_frame.outcome.estimate.keyframe_from_camera.mid();
            let mid_from_keyframe = keyframe_from_mid.inverse();
            let path = of_frame.outcome.estimate.path().seen_from(&mid_from_keyframe);
            self.exchange_with_keyframe(path, sharpness);
            let back = Frame {
                timestamp: motion.timestamp,
                angular_velocity: None,
                gyro: self.keyframe_gyro,
                expected_path: None,
                ..*frame
            };
            let from_frame = Motion::still(frame.timestamp, RigidTransform::identity());
            let world_from_frame = self.keyframe.world_from_keyframe.compose(&keyframe_from_mid);
            let world_from_keyframe =
                core::mem::replace(&mut self.keyframe.world_from_keyframe, world_from_frame);
            let from_frame = from_frame.seen_from(&world_from_frame);
            let reverse = self.align(&back, &from_frame, self.config.align.blur, Some(mid_from_keyframe));
            let frame_from_keyframe = reverse.outcome.estimate.path();
            of_keyframe = frame_from_keyframe.seen_from(&frame_from_keyframe.linear.mid().inverse());
            self.keyframe.world_from_keyframe = world_from_keyframe;
            self.exchange_with_keyframe(of_keyframe, sharpness);
            let start = frame_from_keyframe.linear.mid().inverse();
            of_frame = self.align(frame, motion, self.config.align.blur, Some(start));
        }
        (of_frame, of_keyframe)
    }

    /// Makes the current frame, which moved along `path` seen from its own mid pose, the keyframe, and the keyframe as it
    /// was captured the current frame.
    fn exchange_with_keyframe(&mut self, path: BowedTrajectory, sharpness: Sharpness) {
        let keyframe = &mut self.keyframe;
        self.rectify.restore(keyframe.pyramid.levels[0].pixels, keyframe.depth.values);
        self.deblur.restore(keyframe.pyramid.levels[0].pixels);
        keyframe.pyramid.reduce();
        mem::swap(&mut self.pyramid, &mut keyframe.pyramid);
        mem::swap(&mut self.depth, &mut keyframe.depth);
        mem::swap(&mut self.timing, &mut keyframe.timing);
        mem::swap(&mut self.span, &mut self.keyframe_span);
        self.rectify.capture(keyframe.pyramid.levels[0].pixels, keyframe.depth.values);
        self.deblur.capture(keyframe.pyramid.levels[0].pixels);
        // Its planes say how blur moves; those of a picture that stays as it is are fitted when it has been given one time.
        if sharpness == Sharpness::Deblurred {
            keyframe.restart_surface(self.simd);
        }
        self.set_keyframe_path(path, sharpness);
    }
}
