//! What is rendered: a camera at a pose.

use mba_tracker::geometry::{PinholeCamera, RigidTransform};

use super::constants::JACOBIAN_MARGIN;

/// One view of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RasterView {
    /// Intrinsics in pixels; the centre of the top-left pixel is `(0, 0)`.
    pub camera: PinholeCamera,
    /// Pose of the camera: x right, y down, z forward; metres.
    pub world_from_camera: RigidTransform,
    /// Colour behind everything, linear RGB.
    pub background: [f64; 3],
}

impl RasterView {
    /// Limits of `x/z` and of `y/z` within which the Jacobian of the projection follows the centre of a Gaussian.
    #[must_use]
    pub fn jacobian_limits(&self) -> [[f64; 2]; 2] {
        let camera = &self.camera;
        let along = |size: usize, focal: f64, centre: f64| {
            let margin = JACOBIAN_MARGIN * 0.5 * size as f64 / focal;
            [(-0.5 - centre) / focal - margin, (size as f64 - 0.5 - centre) / focal + margin]
        };
        [along(camera.width, camera.fx, camera.cx), along(camera.height, camera.fy, camera.cy)]
    }
}
