//! What the tracker remembers of the motion.

use nalgebra::Vector6;

use crate::align::MotionPrior;
use crate::geometry::{PinholeCamera, RigidTransform};

/// The last tracked frame and how it was moving. Motions are (translation in the frame that the pose refers to,
/// rotation in the camera), per second.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    pub(super) timestamp: f64,
    pub(super) exposure: f64,
    /// Pose at mid exposure.
    pub(super) reference_from_mid: RigidTransform,
    /// Motion from the frame before.
    pub(super) between_frames: Vector6<f64>,
    /// Motion during the exposure; `None` while it is unknown.
    pub(super) within_exposure: Option<Vector6<f64>>,
}

/// Gap in seconds beyond which the motion before says nothing about the motion after.
const MAX_GAP: f64 = 0.25;

/// Standard deviation of the expected blur in pixels when the camera stands still.
const FLOOR_PIXELS: f64 = 0.5;

impl Motion {
    /// A camera at rest.
    pub(super) fn still(timestamp: f64, exposure: f64, reference_from_mid: RigidTransform) -> Self {
        Self {
            timestamp,
            exposure,
            reference_from_mid,
            between_frames: Vector6::zeros(),
            within_exposure: None,
        }
    }

    /// The same motion seen from another reference frame.
    pub(super) fn seen_from(&self, other_from_reference: &RigidTransform) -> Self {
        Self {
            reference_from_mid: other_from_reference.compose(&self.reference_from_mid),
            between_frames: rotated(other_from_reference, &self.between_frames),
            within_exposure: self.within_exposure.map(|rate| rotated(other_from_reference, &rate)),
            ..*self
        }
    }

    /// Pose after `dt` seconds at `rate`.
    pub(super) fn extrapolate(&self, rate: &Vector6<f64>, dt: f64) -> RigidTransform {
        if dt > MAX_GAP { self.reference_from_mid } else { self.reference_from_mid.perturbed(&(rate * dt)) }
    }

    /// Belief about the motion during an exposure of `exposure` seconds whose mid pose is `reference_from_mid`, at
    /// time `timestamp`.
    ///
    /// The trapezoidal rule: the motion between the mid exposures is the mean of the velocities at both, so
    /// `v = 2 m/dt - v_previous`. It carries the direction of time and needs no smoothness beyond one frame.
    pub(super) fn expected_motion(
        &self,
        reference_from_mid: &RigidTransform,
        timestamp: f64,
        exposure: f64,
        camera: &PinholeCamera,
        inverse_depth: f64,
    ) -> MotionPrior {
        let dt = timestamp - self.timestamp;
        let mean_rate = self.reference_from_mid.tangent_to(reference_from_mid) / dt;
        let (rate, spread) = match self.within_exposure.filter(|_| dt <= MAX_GAP) {
            Some(previous) => {
                let rate = mean_rate * 2.0 - previous;
                (rate, (rate - previous).abs() * 0.2 + rate.abs() * 0.1)
            }
            None => (mean_rate, mean_rate.abs() * 0.6),
        };
        let pixel = FLOOR_PIXELS / camera.fx;
        let information = Vector6::from_fn(|i, _| {
            let (group, floor) = if i < 3 { (0, pixel / inverse_depth.max(0.02)) } else { (3, pixel) };
            let sigma = spread.fixed_rows::<3>(group).norm() * exposure + floor;
            1.0 / (sigma * sigma)
        });
        MotionPrior { expected: rate * exposure, information }
    }
}

fn rotated(a_from_b: &RigidTransform, rate: &Vector6<f64>) -> Vector6<f64> {
    let mut rotated = *rate;
    let translation = a_from_b.rotation * rate.fixed_rows::<3>(0).into_owned();
    rotated.fixed_rows_mut::<3>(0).copy_from(&translation);
    rotated
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 640, height: 480, fx: 500.0, fy: 500.0, cx: 319.5, cy: 239.5 };
    const DT: f64 = 1.0 / 30.0;

    /// Position of a camera that moves with constant acceleration, and its velocity.
    fn quadratic(t: f64) -> (Vector6<f64>, Vector6<f64>) {
        let (velocity, acceleration) =
            (Vector6::new(0.4, -0.2, 0.1, 0.0, 0.0, 0.3), Vector6::new(-3.0, 5.0, 1.0, 0.0, 0.0, -2.0));
        (velocity * t + acceleration * (0.5 * t * t), velocity + acceleration * t)
    }

    fn pose(t: f64) -> RigidTransform {
        // Rotation about one axis only: rotation vectors then add up.
        RigidTransform::identity().perturbed(&quadratic(t).0)
    }

    fn motion(t: f64) -> Motion {
        Motion { within_exposure: Some(quadratic(t).1), ..Motion::still(t, 0.01, pose(t)) }
    }

    #[test]
    fn constant_acceleration_is_predicted_exactly() {
        let prior = motion(0.2).expected_motion(&pose(0.2 + DT), 0.2 + DT, 0.015, &CAMERA, 0.5);
        let error = prior.expected - quadratic(0.2 + DT).1 * 0.015;
        assert!(error.norm() < 1e-12, "{error:?}");
    }

    #[test]
    fn the_prior_does_not_depend_on_the_reference_frame() {
        let other = RigidTransform::identity().perturbed(&Vector6::new(1.0, 2.0, 3.0, 0.3, -0.2, 0.9));
        let here = motion(0.2).expected_motion(&pose(0.2 + DT), 0.2 + DT, 0.015, &CAMERA, 0.5);
        let mid = other.compose(&pose(0.2 + DT));
        let there = motion(0.2).seen_from(&other).expected_motion(&mid, 0.2 + DT, 0.015, &CAMERA, 0.5);
        assert!((rotated(&other, &here.expected) - there.expected).norm() < 1e-12);
    }

    #[test]
    fn extrapolation_continues_the_rate_but_not_across_a_gap() {
        let rate = Vector6::new(1.0, 0.0, 0.0, 0.0, 0.5, 0.0);
        let ahead = motion(0.0).extrapolate(&rate, 0.1);
        assert!((pose(0.0).tangent_to(&ahead) - rate * 0.1).norm() < 1e-12);
        assert_eq!(motion(0.0).extrapolate(&rate, 2.0 * MAX_GAP), pose(0.0));
    }

    #[test]
    fn a_camera_at_rest_is_expected_to_stay_within_half_a_pixel() {
        let still = Motion::still(0.0, 0.01, RigidTransform::identity());
        let prior = still.expected_motion(&RigidTransform::identity(), DT, 0.01, &CAMERA, 0.5);
        assert_eq!(prior.expected, Vector6::zeros());
        // Half a pixel is 0.5/500 rad, and twice that in metres at 2 m.
        assert!((prior.information[3] - 1e6).abs() < 1e-3);
        assert!((prior.information[0] - 0.25e6).abs() < 1e-3);
    }
}
