//! What the first way says of one frame.

use mba_io::trajectory_file::TimedExposure;
use mba_tracker::geometry::{RigidTransform, so3};
use nalgebra::{Vector3, Vector6};

/// One frame: when, where and how fast.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sighting {
    /// Mid exposure, seconds.
    pub(super) time: f64,
    /// Seconds.
    pub(super) exposure: f64,
    /// Pose at mid exposure, camera-to-world.
    pub(super) world_from_mid: RigidTransform,
    /// Velocity in the axes of the camera, per second: translation, rotation. `None` where nothing moved during the exposure.
    pub(super) velocity: Option<Vector6<f64>>,
}

impl Sighting {
    /// The frame of an exposure of `exposure_seconds`.
    pub(super) fn of(exposure: &TimedExposure, exposure_seconds: f64) -> Self {
        let motion = exposure.start.tangent_to(&exposure.end);
        let has_moved = exposure_seconds > 0.0 && motion != Vector6::zeros();
        let velocity = has_moved.then(|| {
            let velocity = motion / exposure_seconds;
            let translation = exposure.mid.rotation.inverse() * Vector3::from(velocity.fixed_rows::<3>(0));
            joined(&translation, &velocity.fixed_rows::<3>(3).into())
        });
        let (time, world_from_mid) = (exposure.timestamp, exposure.mid);
        Self { time, exposure: exposure_seconds, world_from_mid, velocity }
    }

    /// Where `other` was and how fast, in the axes of this frame's camera: translation and rotation vector, and their
    /// derivatives per second.
    pub(super) fn seen_from_here(&self, other: &Self) -> (Vector6<f64>, Option<Vector6<f64>>) {
        let here_from_other = self.world_from_mid.inverse().compose(&other.world_from_mid);
        let turn = so3::log(&here_from_other.rotation);
        let velocity = other.velocity.map(|velocity| {
            let translation = here_from_other.rotation * Vector3::from(velocity.fixed_rows::<3>(0));
            // The derivative of the rotation vector, given the angular velocity in the turned camera.
            let rotation = so3::right_jacobian_inverse(&turn) * Vector3::from(velocity.fixed_rows::<3>(3));
            joined(&translation, &rotation)
        });
        (joined(&here_from_other.translation, &turn), velocity)
    }
}

fn joined(translation: &Vector3<f64>, rotation: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(translation.x, translation.y, translation.z, rotation.x, rotation.y, rotation.z)
}
