//! Motion that something else knows: a belief about a path, and the path of a first keyframe.

use nalgebra::Vector6;

use super::frame::{ExpectedPath, Frame};
use super::history::{FLOOR_PIXELS, Motion, rotated};
use super::reference::Sharpness;
use super::result::FrameResult;
use super::track::{Tracker, exposure_of};
use crate::align::MotionPrior;
use crate::geometry::{PinholeCamera, RigidTransform};
use crate::trajectory::{BowedTrajectory, ExposureTrajectory};

/// Bounds of velocity, acceleration and jerk, per power of a second: far beyond what any camera survives, and small enough
/// for every number that follows from them.
const BOUNDS: [f64; 3] = [1e4, 1e7, 1e10];

impl ExpectedPath {
    /// Whether it can be worked with.
    pub(super) fn is_sound(&self) -> bool {
        let derivatives = [&self.velocity, &self.acceleration, &self.jerk];
        // Written so that NaN is refused.
        let is_bounded =
            |(derivative, bound): (&Vector6<f64>, f64)| derivative.iter().all(|x| x.abs() <= bound);
        let sigmas = self.velocity_sigma.iter().chain(&self.acceleration_sigma);
        derivatives.into_iter().zip(BOUNDS).all(is_bounded) && { sigmas }
            .all(|sigma| (0.0..=1e10).contains(sigma))
    }

    /// The path of `span` seconds around `reference_from_mid`.
    pub(super) fn at(&self, reference_from_mid: &RigidTransform, span: f64) -> BowedTrajectory {
        let seen = |derivative: &Vector6<f64>| rotated(reference_from_mid, derivative);
        let motion = seen(&self.velocity) * span;
        BowedTrajectory {
            linear: ExposureTrajectory::from_mid_and_motion(reference_from_mid, &motion),
            // The terms of Taylor's series.
            bow: seen(&self.acceleration) * (span * span / 2.0),
            jerk: seen(&self.jerk) * (span * span * span / 6.0),
        }
    }

    /// The belief about the path of `span` seconds around `reference_from_mid`. It owes nothing to the mid pose, so it does
    /// not follow it.
    pub(super) fn prior(
        &self,
        reference_from_mid: &RigidTransform,
        span: f64,
        camera: &PinholeCamera,
        inverse_depth: f64,
    ) -> MotionPrior {
        let path = self.at(reference_from_mid, span);
        // However sure the other is, its poses were measured in pixels.
        let pixel = FLOOR_PIXELS / camera.fx;
        let floors = [pixel / inverse_depth.max(0.02), pixel];
        let information = |sigmas: [f64; 2], unit: f64| {
            Vector6::from_fn(|i, _| {
                let sigma = sigmas[i / 3] * unit + floors[i / 3];
                1.0 / (sigma * sigma)
            })
        };
        MotionPrior {
            expected: path.linear.motion(),
            information: information(self.velocity_sigma, span),
            bow: path.bow,
            bow_information: information(self.acceleration_sigma, span * span / 2.0),
            follows: None,
        }
    }
}

impl Tracker<'_> {
    /// Gives a keyframe that was just made the path that is known of it, so that it need not be learnt from the next frame.
    pub(super) fn take_expected_path(&mut self, frame: &Frame, result: &mut FrameResult) {
        let Some(expected) = frame.expected_path.filter(|_| self.path_is_modelled()) else { return };
        let path = expected.at(&RigidTransform::identity(), self.span);
        self.set_keyframe_path(path, Sharpness::Deblurred);
        let world_path = path.seen_from(&self.keyframe.world_from_keyframe);
        result.world_from_camera = exposure_of(&world_path, &self.timing);
        result.blur = self.keyframe.blur;
        let velocity = rotated(&self.keyframe.world_from_keyframe, &expected.velocity);
        self.motion = Some(Motion {
            within_exposure: Some(velocity),
            acceleration: rotated(&self.keyframe.world_from_keyframe, &expected.acceleration),
            ..Motion::still(frame.timestamp, self.keyframe.world_from_keyframe)
        });
    }
}
