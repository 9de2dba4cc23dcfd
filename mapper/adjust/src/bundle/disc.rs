//! Flat Gaussians on a surface.

use mba_tracker::geometry::PinholeCamera;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Surfaces are not taken for steeper than this tangent of the angle between the ray and their normal, about 72 degrees:
/// what is measured that flat says little of a slope.
const STEEPEST: f64 = 3.0;

/// The standard deviation of a disc across the surface, as a fraction of that of its image at its depth.
const THICKNESS: f64 = 0.15;

/// Place and shape of a flat Gaussian in the frame of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Disc {
    /// Centre, metres.
    pub(super) mean: Vector3<f64>,
    /// Standard deviations along the own axes, metres, the largest first.
    pub(super) scale: Vector3<f64>,
    /// From the own axes to the camera.
    pub(super) rotation: UnitQuaternion<f64>,
}

impl Disc {
    /// The disc on a surface that looks round from the camera, with a standard deviation of `sigma` pixels.
    ///
    /// Its centre is seen at the pixel `at` with `depth` in metres; from there the depth of the surface changes by `tilt`,
    /// in metres per pixel to the right and down.
    pub(super) fn new(camera: &PinholeCamera, at: [f64; 2], depth: f64, tilt: [f64; 2], sigma: f64) -> Self {
        let metres_per_pixel = [depth / camera.fx, depth / camera.fy];
        let steepness = (tilt[0] / metres_per_pixel[0]).hypot(tilt[1] / metres_per_pixel[1]);
        let share = (STEEPEST / steepness).min(1.0);
        let ray = camera.ray(at[0], at[1]);
        // What one pixel is on the surface.
        let right = ray * (share * tilt[0]) + Vector3::new(metres_per_pixel[0], 0.0, 0.0);
        let down = ray * (share * tilt[1]) + Vector3::new(0.0, metres_per_pixel[1], 0.0);
        let across = right.cross(&down).normalize() * (THICKNESS * metres_per_pixel[0]);
        let columns = Matrix3::from_columns(&[right, down, across]) * sigma;
        let eigen = (columns * columns.transpose()).symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_unstable_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let mut axes = Matrix3::from_columns(&order.map(|k| eigen.eigenvectors.column(k)));
        if axes.determinant() < 0.0 {
            axes.neg_mut();
        }
        Self {
            mean: ray * depth,
            scale: Vector3::from(order.map(|k| eigen.eigenvalues[k].max(0.0).sqrt())),
            rotation: UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 640, height: 480, fx: 500.0, fy: 450.0, cx: 319.5, cy: 239.5 };

    /// Camera z of the plane through `centre` with that normal on the ray of a pixel.
    fn depth_on_plane(normal: &Vector3<f64>, centre: &Vector3<f64>, [u, v]: [f64; 2]) -> f64 {
        normal.dot(centre) / normal.dot(&CAMERA.ray(u, v))
    }

    #[test]
    fn a_disc_lies_on_the_plane_and_looks_round() {
        let (at, depth, sigma) = ([450.0, 100.0], 2.5, 3.0);
        for normal in [[0.0, 0.0, 1.0], [0.6, -0.2, 1.0], [-0.4, 0.9, 1.0]] {
            let normal = Vector3::from(normal).normalize();
            let centre = CAMERA.ray(at[0], at[1]) * depth;
            let slope = |by: [f64; 2]| {
                let at = |sign: f64| [at[0] + sign * by[0], at[1] + sign * by[1]];
                (depth_on_plane(&normal, &centre, at(1e-3)) - depth_on_plane(&normal, &centre, at(-1e-3)))
                    / 2e-3
            };
            let disc = Disc::new(&CAMERA, at, depth, [slope([1.0, 0.0]), slope([0.0, 1.0])], sigma);
            let axes = disc.rotation.to_rotation_matrix();
            assert!((disc.mean - centre).norm() < 1e-12);
            let across = axes.matrix().column(2).dot(&normal).abs();
            assert!(across > 1.0 - 1e-6, "the thin axis is off the normal: {across}");
            let thin = THICKNESS * sigma * depth / CAMERA.fx;
            assert!((disc.scale.z - thin).abs() < 1e-9 && disc.scale.x >= disc.scale.y);
            // The covariance on the image; the thin axis adds little to it.
            let z = depth;
            let jacobian = nalgebra::Matrix2x3::new(
                CAMERA.fx / z,
                0.0,
                -CAMERA.fx * centre.x / (z * z),
                0.0,
                CAMERA.fy / z,
                -CAMERA.fy * centre.y / (z * z),
            );
            let image = jacobian * axes.matrix() * Matrix3::from_diagonal(&disc.scale);
            let covariance = image * image.transpose() / (sigma * sigma);
            assert!((covariance - nalgebra::Matrix2::identity()).amax() < 0.05, "{covariance}");
        }
    }

    #[test]
    fn steep_slopes_are_bounded() {
        let disc = Disc::new(&CAMERA, [319.5, 239.5], 2.0, [1.0, 0.0], 2.0);
        let longest = (1.0 + STEEPEST * STEEPEST).sqrt() * 2.0 * 2.0 / CAMERA.fx;
        assert!((disc.scale.x - longest).abs() < 1e-4, "{} instead of {longest}", disc.scale.x);
    }
}
