//! Which way a camera looks.

use std::f64::consts::PI;

use nalgebra::{UnitQuaternion, Vector3};

/// The rotation of an upright camera, radians. `yaw` is its heading: 0 looks along +z, positive turns towards +x. `pitch`
/// is its elevation, positive upward.
pub(super) fn upright_camera(yaw: f64, pitch: f64) -> UnitQuaternion<f64> {
    let heading = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), yaw);
    let elevation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -pitch);
    // Camera axes are right, down, forward; half a turn about z takes them from x, y (up), z.
    let upright = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), PI);
    heading * elevation * upright
}
