//! Projection of one Gaussian (EWA splatting) and its derivative.

use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3, Vector4};

use super::{ReferenceGaussian, ReferenceGradient, SplatGradient};
use crate::raster::constants::{FAR_PLANE, LOW_PASS, MAX_COLOUR, NEAR_PLANE, TILT_LOW_PASS};
use crate::raster::pose::ViewGradient;
use crate::raster::view::RasterView;

/// A Gaussian on the image plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Splat {
    pub(super) centre: Vector2<f64>,
    /// Inverse covariance, per pixel squared.
    pub(super) conic: Matrix2<f64>,
    pub(super) opacity: f64,
    pub(super) colour: Vector3<f64>,
    /// Camera z of the centre, metres.
    pub(super) depth: f64,
    /// Metres per pixel at which it changes.
    pub(super) tilt: Vector2<f64>,
}

/// All intermediate values of a projection.
struct Steps {
    world_to_camera: Matrix3<f64>,
    x_camera: Vector3<f64>,
    /// `x/z` and `y/z` as the Jacobian sees them, and whether they are within their limits.
    slope: [f64; 2],
    follows: [bool; 2],
    jacobian: Matrix2x3<f64>,
    quaternion: Vector4<f64>,
    quaternion_norm: f64,
    orientation: Matrix3<f64>,
    /// Axes of the Gaussian as columns, in the world and in the camera frame.
    axes_world: Matrix3<f64>,
    axes_camera: Matrix3<f64>,
    conic: Matrix2<f64>,
    /// Inverse covariance with the low-pass of the tilt, and the tilt.
    tilt_conic: Matrix2<f64>,
    tilt: Vector2<f64>,
}

/// The splat of a Gaussian, or `None` if it is not drawn: behind the camera, too near or too far, or with a parameter that
/// makes no sense (not finite, no opacity, no orientation).
pub(super) fn project(gaussian: &ReferenceGaussian, view: &RasterView) -> Option<Splat> {
    let steps = Steps::new(gaussian, view);
    let camera = &view.camera;
    let [x, y, z] = steps.x_camera.into();
    let centre = Vector2::new(camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy);
    let finite =
        centre.iter().chain(&steps.conic).chain(&steps.tilt).chain(&gaussian.colour).all(|v| v.is_finite());
    let opaque = gaussian.opacity > 0.0 && gaussian.opacity <= 1.0;
    let in_range = z > NEAR_PLANE && z < FAR_PLANE && gaussian.colour.amax() < MAX_COLOUR;
    (in_range && finite && opaque).then_some(Splat {
        centre,
        conic: steps.conic,
        opacity: gaussian.opacity,
        colour: gaussian.colour,
        depth: z,
        tilt: steps.tilt,
    })
}

/// Takes the gradient by a splat on to the parameters of its Gaussian, and adds what the pose gets.
pub(super) fn project_backward(
    gaussian: &ReferenceGaussian,
    view: &RasterView,
    splat: &SplatGradient,
    view_gradient: &mut ViewGradient,
) -> ReferenceGradient {
    let steps = Steps::new(gaussian, view);
    let [gxx, gxy, gyy] = splat.conic;
    let grad_conic = Matrix2::new(gxx, 0.5 * gxy, 0.5 * gxy, gyy);
    let image_axes = steps.jacobian * steps.axes_camera;
    // The tilt is the inverse of one covariance times another, that of the offset on the image with camera z.
    let grad_covariance_with_z = steps.tilt_conic * splat.tilt;
    let grad_tilt_covariance = -grad_covariance_with_z * steps.tilt.transpose();
    let grad_covariance = -steps.conic * grad_conic * steps.conic;
    let grad_image_axes = 2.0 * grad_covariance * image_axes
        + (grad_tilt_covariance + grad_tilt_covariance.transpose()) * image_axes
        + grad_covariance_with_z * steps.axes_camera.row(2);
    let grad_jacobian = grad_image_axes * steps.axes_camera.transpose();
    let mut grad_axes_camera = steps.jacobian.transpose() * grad_image_axes;
    grad_axes_camera.set_row(2, &(grad_axes_camera.row(2) + grad_covariance_with_z.transpose() * image_axes));
    let grad_axes_world = steps.world_to_camera.transpose() * grad_axes_camera;
    let grad_x_camera = steps.grad_x_camera(view, splat, &grad_jacobian);

    view_gradient.rotation +=
        grad_axes_camera * steps.axes_world.transpose() + grad_x_camera * gaussian.mean.transpose();
    view_gradient.translation += grad_x_camera;
    let grad_orientation = grad_axes_world * Matrix3::from_diagonal(&gaussian.scale);
    ReferenceGradient {
        mean: steps.world_to_camera.transpose() * grad_x_camera,
        scale: Vector3::from_fn(|j, _| steps.orientation.column(j).dot(&grad_axes_world.column(j))),
        rotation: steps.grad_quaternion(&grad_orientation),
        opacity: splat.opacity,
        colour: splat.colour,
        splat: *splat,
    }
}

impl Steps {
    fn new(gaussian: &ReferenceGaussian, view: &RasterView) -> Self {
        let camera_from_world = view.world_from_camera.inverse();
        let world_to_camera = camera_from_world.rotation_matrix();
        let x_camera = world_to_camera * gaussian.mean + camera_from_world.translation;
        // Beyond the edge of the image the Jacobian is that of the edge: it grows without bound there.
        let limits = view.jacobian_limits();
        let z = x_camera.z;
        let exact = [x_camera.x / z, x_camera.y / z];
        let slope = [0, 1].map(|i| exact[i].clamp(limits[i][0], limits[i][1]));
        let (fx, fy) = (view.camera.fx, view.camera.fy);
        let jacobian = Matrix2x3::new(fx / z, 0.0, -fx * slope[0] / z, 0.0, fy / z, -fy * slope[1] / z);
        // Sigma = (R S)(R S)^T; quaternions need not have length 1.
        let quaternion_norm = Vector4::from(gaussian.rotation).norm();
        let quaternion = Vector4::from(gaussian.rotation) / quaternion_norm;
        let orientation = rotation_matrix(&quaternion);
        let axes_world = orientation * Matrix3::from_diagonal(&gaussian.scale);
        let axes_camera = world_to_camera * axes_world;
        // Sigma' = (J W R S)(J W R S)^T (Zwicker et al. 2001), widened to a pixel.
        let image_axes = jacobian * axes_camera;
        let covariance = image_axes * image_axes.transpose();
        let conic = inverse(&(covariance + Matrix2::from_diagonal_element(LOW_PASS)));
        // Camera z over the image: Cov(z, uv) Cov(uv, uv)^-1, the regression of depth on the pixel.
        let tilt_conic = inverse(&(covariance + Matrix2::from_diagonal_element(TILT_LOW_PASS)));
        let tilt = tilt_conic * (image_axes * axes_camera.row(2).transpose());
        Self {
            world_to_camera,
            x_camera,
            slope,
            follows: [0, 1].map(|i| slope[i] == exact[i]),
            jacobian,
            quaternion,
            quaternion_norm,
            orientation,
            axes_world,
            axes_camera,
            conic,
            tilt_conic,
            tilt,
        }
    }

    /// The centre moves the splat, its depth, and the Jacobian that shapes it.
    fn grad_x_camera(
        &self,
        view: &RasterView,
        splat: &SplatGradient,
        grad_jacobian: &Matrix2x3<f64>,
    ) -> Vector3<f64> {
        let focal = [view.camera.fx, view.camera.fy];
        let z = self.x_camera.z;
        let mut grad_x = Vector3::new(0.0, 0.0, splat.depth);
        for i in 0..2 {
            let grad_centre = splat.centre[i] * focal[i] / z;
            grad_x[i] += grad_centre;
            grad_x.z -= grad_centre * self.x_camera[i] / z;
            let (grad_diagonal, grad_last) = (grad_jacobian[(i, i)], grad_jacobian[(i, 2)]);
            grad_x.z -= grad_diagonal * focal[i] / (z * z);
            grad_x.z += grad_last * focal[i] * self.slope[i] / (z * z);
            if self.follows[i] {
                let grad_slope = -grad_last * focal[i] / z;
                grad_x[i] += grad_slope / z;
                grad_x.z -= grad_slope * self.slope[i] / z;
            }
        }
        grad_x
    }

    fn grad_quaternion(&self, grad_orientation: &Matrix3<f64>) -> [f64; 4] {
        let g = grad_orientation;
        let [w, x, y, z] = self.quaternion.into();
        let grad_unit = 2.0
            * Vector4::new(
                x * (g.m32 - g.m23) + y * (g.m13 - g.m31) + z * (g.m21 - g.m12),
                w * (g.m32 - g.m23) + y * (g.m12 + g.m21) + z * (g.m13 + g.m31) - 2.0 * x * (g.m22 + g.m33),
                w * (g.m13 - g.m31) + x * (g.m12 + g.m21) + z * (g.m23 + g.m32) - 2.0 * y * (g.m11 + g.m33),
                w * (g.m21 - g.m12) + x * (g.m13 + g.m31) + y * (g.m23 + g.m32) - 2.0 * z * (g.m11 + g.m22),
            );
        let radial = self.quaternion.dot(&grad_unit);
        ((grad_unit - self.quaternion * radial) / self.quaternion_norm).into()
    }
}

fn inverse(matrix: &Matrix2<f64>) -> Matrix2<f64> {
    Matrix2::new(matrix.m22, -matrix.m12, -matrix.m21, matrix.m11) / matrix.determinant()
}

/// Rotation matrix of a unit quaternion w x y z.
fn rotation_matrix(quaternion: &Vector4<f64>) -> Matrix3<f64> {
    let [w, x, y, z] = (*quaternion).into();
    Matrix3::new(
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )
}
