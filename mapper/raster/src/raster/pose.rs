//! Gradient of a loss by the pose of the camera.

use mba_tracker::geometry::RigidTransform;
use nalgebra::{Matrix3, Vector3, Vector6};

/// Gradient by the twelve numbers of `camera_from_world`, `x_c = R x_w + t`, each taken as free.
///
/// This is what the Gaussians of a view sum up; the tangents of a pose follow from it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ViewGradient {
    /// By the elements of R.
    pub rotation: Matrix3<f64>,
    /// By t.
    pub translation: Vector3<f64>,
}

impl ViewGradient {
    /// Gradient by the tangent of [`RigidTransform::perturbed`] at the pose `world_from_camera`: translation in
    /// the world, metres, then rotation in the camera frame, radians.
    ///
    /// With `x_c = R^T (x - p)`: `dx_c/dp = -R^T` and `dx_c/dr = [x_c]x`.
    #[must_use]
    pub fn tangent(&self, world_from_camera: &RigidTransform) -> Vector6<f64> {
        let left = self.left_tangent(&world_from_camera.inverse());
        let shift = -(world_from_camera.rotation * left.fixed_rows::<3>(0));
        let turn = left.fixed_rows::<3>(3);
        Vector6::new(shift.x, shift.y, shift.z, -turn[0], -turn[1], -turn[2])
    }

    /// Gradient by `xi = (rho, phi)` of `exp(xi) camera_from_world` at zero, translation first.
    #[must_use]
    pub fn left_tangent(&self, camera_from_world: &RigidTransform) -> Vector6<f64> {
        let rotation = camera_from_world.rotation_matrix();
        let columns = (0..3).map(|j| rotation.column(j).cross(&self.rotation.column(j)));
        let turn = columns.fold(camera_from_world.translation.cross(&self.translation), |sum, c| sum + c);
        let shift = self.translation;
        Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
    }
}
