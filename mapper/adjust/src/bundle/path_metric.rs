//! How far a movement of the camera moves what it sees.

use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use nalgebra::{Matrix6, RowVector6, Vector3, Vector6};

use mba_raster::exposure::ExposurePath;
use mba_raster::sensor::Observation;

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
    /// Pixels that each component of a tangent moves the picture by, taken alone; translation in the camera frame.
    pixels_from_tangent: Vector6<f64>,
}

impl PathMetric {
    /// From the gradients of a captured image and its depth; pixels without depth count as `typical_depth` metres away.
    ///
    /// One unit moves the picture by about one pixel of `seen`, weighted by the squared gradient.
    #[must_use]
    pub fn new(seen: &Observation, typical_depth: f64) -> Self {
        let camera = &seen.camera;
        // A pixel as an angle, and as a length at the typical depth: unknowns of like size.
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
                // One line of J: how the value at the pixel changes with a unit of each unknown.
                let row = movement(camera, [x as f64, y as f64], depth, [along, down])
                    .component_mul(&scale.transpose());
                information += row.transpose() * row;
                weight += along * along + down * down;
            }
        }
        // J^T J over the squared gradients, and its roots: in their coordinates all directions are alike.
        let [unscaled, inverse] = roots(&(information / f64::max(weight, 1e-12)));
        Self {
            tangent_from_unit: Matrix6::from_diagonal(&scale) * unscaled,
            unit_from_tangent: inverse * Matrix6::from_diagonal(&scale.map(|length| 1.0 / length)),
            pixels_from_tangent: scale.map(|length| 1.0 / length),
        }
    }

    /// Units of that many metres and radians.
    #[cfg(test)]
    pub(super) fn uniform(metres: f64, radians: f64) -> Self {
        let scale = Vector6::new(metres, metres, metres, radians, radians, radians);
        let [tangent_from_unit, unit_from_tangent] =
            [scale, scale.map(|length| 1.0 / length)].map(|scale| Matrix6::from_diagonal(&scale));
        Self { tangent_from_unit, unit_from_tangent, pixels_from_tangent: scale.map(|length| 1.0 / length) }
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

    /// The gradient by units of half the squared pixels that a tangent is, each component taken alone: what turning and
    /// shifting move the picture by does not cancel.
    #[must_use]
    pub fn grad_squared_pixels(&self, path: &ExposurePath, tangent: &Vector6<f64>) -> Vector6<f64> {
        let own = turned(&path.mid().inverse(), tangent);
        let squared = self.pixels_from_tangent.component_mul(&self.pixels_from_tangent);
        self.tangent_from_unit.transpose() * own.component_mul(&squared)
    }

    /// The gradient by units from that by the tangent.
    #[must_use]
    pub fn grad_units(&self, path: &ExposurePath, grad_tangent: &Vector6<f64>) -> Vector6<f64> {
        self.tangent_from_unit.transpose() * turned(&path.mid().inverse(), grad_tangent)
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
    let grad_x = along * camera.fx / depth;
    let grad_y = down * camera.fy / depth;
    let grad_point = Vector3::new(grad_x, grad_y, -(grad_x * ray.x + grad_y * ray.y));
    // grad_point . (x_c x dr) is (grad_point x x_c) . dr.
    let grad_turn = grad_point.cross(&(ray * depth));
    RowVector6::new(-grad_point.x, -grad_point.y, -grad_point.z, grad_turn.x, grad_turn.y, grad_turn.z)
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

#[cfg(test)]
mod tests {
    use mba_tracker::image::PixelRectangle;
    use mba_tracker::trajectory::ExposureTrajectory;
    use nalgebra::UnitQuaternion;

    use super::*;
    use mba_raster::exposure::RowTimes;

    /// A textured floor that recedes from 1 to 3 m.
    fn observation() -> Observation {
        let (width, height) = (80, 60);
        let texture = |x: usize, y: usize| ((x * 37 + y * 91 + x * y * 13) % 256) as u8;
        let plane: Vec<u8> = (0..width * height).map(|pixel| texture(pixel % width, pixel / width)).collect();
        Observation {
            camera: PinholeCamera { width, height, fx: 70.0, fy: 70.0, cx: 39.5, cy: 29.5 },
            colour: [plane.clone(), plane.clone(), plane],
            depth: (0..width * height)
                .map(|pixel| 3.0 - 2.0 * (pixel / width) as f32 / height as f32)
                .collect(),
            region: PixelRectangle { left: 0, top: 0, right: width, bottom: height },
            times: RowTimes::GLOBAL,
            falloff: None,
        }
    }

    fn path() -> ExposurePath {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.4, -0.8, 0.3));
        ExposurePath::linear(ExposureTrajectory::still(RigidTransform::new(
            rotation,
            Vector3::new(1.0, 2.0, 3.0),
        )))
    }

    /// Root mean square of how far the picture moves, pixels per axis.
    fn movement_of(seen: &Observation, path: &ExposurePath, tangent: &Vector6<f64>) -> f64 {
        let moved_from_world = path.mid().perturbed(tangent).inverse();
        let pixels = (0..80).flat_map(|x| (0..60).map(move |y| (x, y)));
        let squares = pixels.map(|(x, y)| {
            let (u, v) = (f64::from(x), f64::from(y));
            let point = seen.camera.ray(u, v) * f64::from(seen.depth[(y * 80 + x) as usize]);
            let moved =
                seen.camera.project(&moved_from_world.transform_point(&path.mid().transform_point(&point)));
            0.5 * ((moved.x - u).powi(2) + (moved.y - v).powi(2))
        });
        (squares.sum::<f64>() / 4800.0).sqrt()
    }

    #[test]
    fn every_unit_moves_the_picture_by_about_a_pixel_also_along_the_valley() {
        let (seen, path) = (observation(), path());
        let metric = PathMetric::new(&seen, 2.0);
        for k in 0..6 {
            let tangent = metric.tangent(&path, &(Vector6::ith(k, 0.01)));
            let pixels = movement_of(&seen, &path, &tangent) / 0.01;
            assert!((0.3..1.7).contains(&pixels), "unit {k} moves {pixels} pixels");
        }
    }

    #[test]
    fn units_and_gradients_go_there_and_back() {
        let (seen, path) = (observation(), path());
        let metric = PathMetric::new(&seen, 2.0);
        let units = Vector6::new(0.3, -0.2, 0.5, 0.1, -0.4, 0.2);
        let tangent = metric.tangent(&path, &units);
        assert!((metric.units(&path, &tangent) - units).norm() < 1e-9);
        let grad_tangent = Vector6::new(1.0, 2.0, -1.0, 0.5, 3.0, -2.0);
        let change = grad_tangent.dot(&tangent);
        assert!((metric.grad_units(&path, &grad_tangent).dot(&units) - change).abs() < 1e-9);
    }

    #[test]
    fn a_picture_without_texture_has_a_metric_too() {
        let mut seen = observation();
        seen.colour.iter_mut().for_each(|plane| plane.fill(100));
        let metric = PathMetric::new(&seen, 2.0);
        assert!(metric.tangent(&path(), &Vector6::repeat(1.0)).iter().all(|x| x.is_finite()));
    }
}
