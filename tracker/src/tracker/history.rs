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
