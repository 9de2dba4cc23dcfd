//! Input of the tracker.

use nalgebra::{Vector3, Vector6};

use crate::geometry::RigidTransform;
use crate::image::{ColourView, DepthView};

/// One RGB-D frame.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Mid-exposure time in seconds; where rows are exposed one after the other, that of the middle row.
    pub timestamp: f64,
    /// Exposure time in seconds, of every row.
    pub exposure: f64,
    /// When the middle row of the depth image was measured, seconds; the same as `timestamp` where depth and colour are
    /// taken together. It counts only where [`crate::Readout::depth_apart`] says so.
    pub depth_timestamp: f64,
    /// Undistorted colour or grey image.
    pub colour: ColourView<'a>,
    /// Undistorted depth image registered to the colour image.
    pub depth: DepthView<'a>,
    /// Mean angular velocity between the frame before and this one, camera frame, rad/s, if a gyroscope is at hand.
    pub angular_velocity: Option<Vector3<f64>>,
    /// What a gyroscope says of the turning around mid exposure, if one is at hand.
    pub gyro: Option<GyroReading>,
    /// How the camera moves around mid exposure as something else knows it, for example a filter, or this tracker when the
    /// recording was tracked before and the frames after this one are known, too.
    pub expected_path: Option<ExpectedPath>,
}

/// How a camera moves around mid exposure (of the middle row): derivatives of its pose by time, translation in the axes of
/// the camera at mid exposure in metres, rotation in the camera in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectedPath {
    /// Velocity, per second.
    pub velocity: Vector6<f64>,
    /// Acceleration, per square second.
    pub acceleration: Vector6<f64>,
    /// Change of the acceleration, per cube of a second.
    pub jerk: Vector6<f64>,
    /// Standard deviation of the velocity, translation and rotation; 0 or above.
    pub velocity_sigma: [f64; 2],
    /// Standard deviation of the acceleration, translation and rotation; 0 or above.
    pub acceleration_sigma: [f64; 2],
}

/// How the camera turns around mid exposure (of the middle row), as measured by a gyroscope; its bias may still be in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GyroReading {
    /// Angular velocity, camera frame, rad/s.
    pub angular_velocity: Vector3<f64>,
    /// Angular acceleration, camera frame, rad/s^2.
    pub angular_acceleration: Vector3<f64>,
}

/// A sharp view from outside, for example rendered from a map.
#[derive(Clone, Copy, Debug)]
pub struct ReferenceView<'a> {
    /// Sharp colour or grey image, encoded like the camera's.
    pub colour: ColourView<'a>,
    /// Depth image in the camera's raw units.
    pub depth: DepthView<'a>,
    /// Pose of the view in the tracker's world.
    pub world_from_camera: RigidTransform,
}
