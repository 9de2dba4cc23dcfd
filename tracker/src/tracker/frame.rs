//! Input of the tracker.

use nalgebra::Vector3;

use crate::image::{ColourView, DepthView};

/// One RGB-D frame.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Mid-exposure time in seconds.
    pub timestamp: f64,
    /// Exposure time in seconds.
    pub exposure: f64,
    /// Undistorted colour or grey image.
    pub colour: ColourView<'a>,
    /// Undistorted depth image registered to the colour image.
    pub depth: DepthView<'a>,
    /// Mean angular velocity between the frame before and this one, camera frame, rad/s, if a gyroscope is at hand.
    pub angular_velocity: Option<Vector3<f64>>,
}
