//! What the tracker remembers of the motion.

use nalgebra::{Vector3, Vector6};

use crate::align::MotionPrior;
use crate::geometry::{PinholeCamera, RigidTransform, so3};
use crate::trajectory::ExposureTrajectory;

/// The last tracked frame and how it was moving.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    pub timestamp: f64,
    pub exposure: f64,
    pub world_from_camera: ExposureTrajectory,
    pub world_from_mid: RigidTransform,
    /// Motion from the frame before, per second.
    pub between_frames: Vector6<f64>,
    /// Motion during the exposure, per second; `None` while it is unknown.
    pub within_exposure: Option<Vector6<f64>>,
}

impl Motion {
    /// Pose after `dt` seconds at `rate` (translation in the world, rotation in the camera, per second).
    pub fn extrapolate(&self, rate: &Vector6<f64>, dt: f64) -> RigidTransform {
        self.world_from_mid.perturbed(&(rate * dt))
    }

    /// Pose after `dt` seconds with a measured angular velocity in place of the predicted one.
    pub fn extrapolate_with_gyro(&self, rate: &Vector6<f64>, gyro: &Vector3<f64>, dt: f64) -> RigidTransform {
        let mut rate = *rate;
        rate.fixed_rows_mut::<3>(3).copy_from(gyro);
        self.extrapolate(&rate, dt)
    }

    /// Belief about the motion during an exposure of `exposure` seconds whose mid pose is `world_from_mid`, `dt`
    /// seconds after this frame.
    ///
    /// The trapezoidal rule: the motion between the mid exposures is the mean of the velocities at both, so
    /// `v = 2 m/dt - v_previous`. It carries the direction of time and needs no smoothness beyond one frame.
    pub fn expected_motion(
        &self,
        world_from_mid: &RigidTransform,
        dt: f64,
        exposure: f64,
        camera: &PinholeCamera,
        inverse_depth: f64,
    ) -> MotionPrior {
        let mean_rate = self.world_from_mid.tangent_to(world_from_mid) / dt;
        let (rate, spread) = match self.within_exposure {
            Some(previous) => {
                let rate = mean_rate * 2.0 - previous;
                (rate, (rate - previous).abs() * 0.2 + rate.abs() * 0.1)
            }
            None => (mean_rate, mean_rate.abs() * 0.6),
        };
        let pixel = FLOOR_PIXELS / camera.fx;
        let information = Vector6::from_fn(|i, _| {
            let group = if i < 3 { 0 } else { 3 };
            let norm = spread.fixed_rows::<3>(group).norm();
            let floor = if i < 3 { pixel / inverse_depth.max(0.02) } else { pixel };
            let sigma = norm * exposure + floor;
            1.0 / (sigma * sigma)
        });
        MotionPrior { expected: rate * exposure, information }
    }
}

/// Standard deviation of the expected blur in pixels when the camera stands still.
const FLOOR_PIXELS: f64 = 0.5;

/// The part of `motion` that turns the camera, radians.
pub(super) fn rotation_part(from: &RigidTransform, to: &RigidTransform) -> f64 {
    so3::log(&(from.rotation.inverse() * to.rotation)).norm()
}
