//! Transfer of a single pixel in f64, with its Jacobian.

use nalgebra::{Matrix2x6, Vector2, Vector3};

use crate::geometry::{PinholeCamera, RigidTransform};
use crate::trajectory::left_from_right;

/// A pixel of a virtual view seen in the reference image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransferredPixel {
    /// Column and row in the reference image, pixels.
    pub pixel: Vector2<f64>,
    /// Viewing ray in the reference frame; it has unit z in the virtual camera's frame.
    pub ray: Vector3<f64>,
    /// Distance from the virtual camera to the keypoint's plane along the reference's z axis, metres.
    pub plane_distance: f64,
    /// Derivative of `pixel` by (translation, left rotation) of the virtual camera.
    pub jacobian_left: Matrix2x6<f64>,
}

impl TransferredPixel {
    /// Derivative of `pixel` by the tangent vector of [`RigidTransform::perturbed`].
    #[must_use]
    pub fn jacobian_right(&self, reference_from_virtual: &RigidTransform) -> Matrix2x6<f64> {
        self.jacobian_left * left_from_right(&reference_from_virtual.rotation_matrix())
    }
}

/// Maps pixel `(u, v)` of a virtual view into the reference image through the plane `z = depth` of the reference
/// frame (metres). `None` unless the plane lies in front of the camera and along the ray.
///
/// Third rows vanish because the point keeps depth `depth`: with `r = R x`, `a = r_x/r_z`, `b = r_y/r_z` and
/// `w = depth - p_z` the pixel is `c + f (p + w (a, b))/depth` (MBA-VO supplement eqs. 62 to 84, simplified).
#[must_use]
pub fn transfer_pixel(
    camera: &PinholeCamera,
    reference_from_virtual: &RigidTransform,
    depth: f64,
    u: f64,
    v: f64,
) -> Option<TransferredPixel> {
    let ray = reference_from_virtual.rotation_matrix() * camera.ray(u, v);
    let p = reference_from_virtual.translation;
    let plane_distance = depth - p.z;
    if !(depth > 0.0 && plane_distance > 0.0 && ray.z > 0.0) {
        return None;
    }
    let (a, b) = (ray.x / ray.z, ray.y / ray.z);
    // Scales from metres on the plane to pixels, and with the distance of the plane to ratios of the ray.
    let (fx, fy) = (camera.fx / depth, camera.fy / depth);
    let (mu, mv) = (fx * plane_distance, fy * plane_distance);
    Some(TransferredPixel {
        pixel: Vector2::new(
            camera.cx + fx * (p.x + plane_distance * a),
            camera.cy + fy * (p.y + plane_distance * b),
        ),
        ray,
        plane_distance,
        #[rustfmt::skip]
        jacobian_left: Matrix2x6::new(
            fx, 0.0, -a * fx, -mu * a * b, mu * (1.0 + a * a), -mu * b,
            0.0, fy, -b * fy, -mv * (1.0 + b * b), mv * a * b, mv * a,
        ),
    })
}
