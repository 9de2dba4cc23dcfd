//! How far a movement of the camera moves what it sees.

use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use nalgebra::{Matrix6, RowVector6, Vector3, Vector6};

use super::observation::Observation;
use crate::exposure::ExposurePath;

/// Every other pixel of every other row is looked at.
const STRIDE: usize = 2;

/// A move that is seen this much less than the typical one counts as seen that much, as a ratio of squares: nobody
/// should go far along what hardly shows.
const FAINTEST: f64 = 0.1;

/// Coordinates of the movements of one camera in which all directions move the picture by the same amount.
///
/// Turning and shifting a camera looks nearly alike; only the difference of near and far tells the two apart. Steps
/// along the gradient never get far along such a valley. In these coordinates there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathMetric {
    /// Tangent, translation in the camera frame, that a unit along each coordinate is.
    tangent_from_unit: Matrix6<f64>,
    unit_from_tangent: Matrix6<f64>,
}

impl PathMetric {
    /// From the gradients of a captured image and its depth; pixels without depth count as `typical_depth` metres away.
    ///
    /// One unit moves the picture by about one pixel of `seen`, weighted by the squared gradient.
    #[must_use]
    pub fn new(seen: &Observation, typical_depth: f64) -> Self {
        let camera = &seen.camera;
        let radians = 1.0 / camera.fx;
        let metres = typical_depth * radians;
        let scale = Vector6::new(metres, metres, metres, radians, radians, radians);
        let mut information = Matrix6::zeros();
        let mut weight = 0.0;
        let (left, right) = (seen.region.left.max(1), seen.region.right.min(camera.width - 1));
        let (top, bottom) = (seen.region.top.max(1), seen.region.bottom.min(camera.height - 1));
        for y in (top..bottom).step_by(STRIDE) {
            for x in (left..right).step_by(STRIDE) {
                let [along, down] = gradient(seen, x, y);
                let measured = f64::from(seen.depth[y * camera.width + x]);
                let depth = if measured > 0.0 { measured } else { typical_depth };
                let row = movement(camera, [x as f64, y as f64], depth, [along, down])
                    .component_mul(&scale.transpose());
                information += row.transpose() * row;
                weight += along * along + down * down;
            }
        }
        let [unscaled, inverse] = roots(&(information / f64::max(weight, 1e-12)));
        Self {
            tangent_from_unit: Matrix6::from_diagonal(&scale) * unscaled,
            unit_from_tangent: inverse * Matrix6::from_diagonal(&scale.map(|length| 1.0 / length)),
        }
    }

    /// The tangent, translation in the world, of a move given in units.
    #[must_use]
    pub fn tangent(&self, path: &ExposurePath, units: &Vector6<f64>) -> Vector6<f64> {
        turned(&path.mid(), &(self.tangent_from_unit * units))
    }

    /// How many units a tangent is, translation in the world.
    #[must_use]
    pub fn units(&self, path: &ExposurePath, tangent: &Vector6<f64>) -> Vector6<f64> {
        self.unit_from_tangent * turned(&path.mid().inverse(), tangent)
    }

    /// The gradient by units from that by the tangent.
    #[must_use]
    pub fn by_units(&self, path: &ExposurePath, by_tangent: &Vector6<f64>) -> Vector6<f64> {
        self.tangent_from_unit.transpose() * turned(&path.mid().inverse(), by_tangent)
    }
}

/// A tangent with its translation turned into another frame.
fn turned(other_from_frame: &RigidTransform, tangent: &Vector6<f64>) -> Vector6<f64> {
    let mut out = *tangent;
    let shift: Vector3<f64> = other_from_frame.rotation * tangent.fixed_rows::<3>(0);
    out.fixed_rows_mut::<3>(0).copy_from(&shift);
    out
}

/// Central differences of the grey value, 0 to 1 per pixel.
fn gradient(seen: &Observation, x: usize, y: usize) -> [f64; 2] {
    let width = seen.camera.width;
    let grey = |pixel: usize| seen.colour.iter().map(|plane| f64::from(plane[pixel])).sum::<f64>() / 765.0;
    let pixel = y * width + x;
    [0.5 * (grey(pixel + 1) - grey(pixel - 1)), 0.5 * (grey(pixel + width) - grey(pixel - width))]
}

/// Change of the value at a pixel by the tangent of the camera: `x_c = R^T (x - p)`, so `dx_c/dt = -1` with the
/// translation in the camera frame and `dx_c/dr = [x_c]x`.
fn movement(
    camera: &PinholeCamera,
    [u, v]: [f64; 2],
    depth: f64,
    [along, down]: [f64; 2],
) -> RowVector6<f64> {
    let ray = camera.ray(u, v);
    let by_x = along * camera.fx / depth;
    let by_y = down * camera.fy / depth;
    let by_point = Vector3::new(by_x, by_y, -(by_x * ray.x + by_y * ray.y));
    // by_point . (x_c x dr) is (by_point x x_c) . dr.
    let by_turn = by_point.cross(&(ray * depth));
    RowVector6::new(-by_point.x, -by_point.y, -by_point.z, by_turn.x, by_turn.y, by_turn.z)
}

/// A matrix C with `C^T A C` the identity, but for directions that A has next to nothing of, and its inverse.
fn roots(a: &Matrix6<f64>) -> [Matrix6<f64>; 2] {
    let typical = a.trace() / 6.0;
    if !(typical > 0.0 && typical.is_finite()) {
        return [Matrix6::identity(); 2];
    }
    let eigen = a.symmetric_eigen();
    let root = eigen.eigenvalues.map(|value| value.max(FAINTEST * typical).sqrt());
    let stretch = Matrix6::from_diagonal(&root.map(|root| 1.0 / root));
    [eigen.eigenvectors * stretch, Matrix6::from_diagonal(&root) * eigen.eigenvectors.transpose()]
}
