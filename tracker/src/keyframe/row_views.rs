//! Where the camera was when the rows of an image were seen, one after the other.

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector3};

use crate::geometry::{PinholeCamera, RigidTransform};
use crate::trajectory::BowedTrajectory;
use crate::transfer::MAX_BANDS;

/// `camera_from_keyframe` at one time, in single precision.
#[derive(Clone, Copy)]
pub(super) struct View {
    pub(super) rotation: Matrix3<f32>,
    pub(super) translation: Vector3<f32>,
}

/// The views at the borders of the bands of rows of an image; between two borders pixels move linearly.
pub(super) struct RowViews {
    at_borders: ArrayVec<View, { MAX_BANDS + 1 }>,
    height: usize,
}

impl RowViews {
    pub(super) fn new(path: &BowedTrajectory, time_of_row: impl Fn(f64) -> f64, height: usize) -> Self {
        let border = |k: usize| k as f64 * height as f64 / MAX_BANDS as f64 - 0.5;
        let at_borders = (0..=MAX_BANDS).map(|k| View::new(&path.at(time_of_row(border(k))))).collect();
        Self { at_borders, height }
    }

    /// The border above `row` and how far the row lies behind it, as a share of a band.
    fn place(&self, row: f32) -> (usize, f32) {
        let bands = (row + 0.5) * MAX_BANDS as f32 / self.height as f32;
        let band = (bands.max(0.0) as usize).min(MAX_BANDS - 1);
        (band, (bands - band as f32).clamp(-1.0, 2.0))
    }

    /// The view of `row`, interpolated between the borders of its band: a band turns by a hundredth of a radian at the
    /// most, so that the mean of two rotations is one to a few parts in 10^5.
    pub(super) fn at(&self, row: f32) -> View {
        let (band, share) = self.place(row);
        let (above, below) = (&self.at_borders[band], &self.at_borders[band + 1]);
        View {
            rotation: above.rotation + (below.rotation - above.rotation) * share,
            translation: above.translation + (below.translation - above.translation) * share,
        }
    }

    /// Where the point on `ray` at inverse depth `rho` is seen when `row` is exposed.
    pub(super) fn project(
        &self,
        ray: &Vector3<f32>,
        rho: f32,
        camera: &PinholeCamera,
        row: f32,
    ) -> Option<[f32; 2]> {
        let view = self.at(row);
        let x = view.rotation * ray + view.translation * rho;
        (x.z > 0.1).then(|| pixel_of(camera, &x))
    }
}

impl View {
    fn new(keyframe_from_camera: &RigidTransform) -> Self {
        let inverse = keyframe_from_camera.inverse();
        Self {
            rotation: inverse.rotation_matrix().map(|x| x as f32),
            translation: inverse.translation.map(|x| x as f32),
        }
    }
}

pub(super) fn ray_of(camera: &PinholeCamera, u: f32, v: f32) -> Vector3<f32> {
    Vector3::new((u - camera.cx as f32) / camera.fx as f32, (v - camera.cy as f32) / camera.fy as f32, 1.0)
}

pub(super) fn pixel_of(camera: &PinholeCamera, x: &Vector3<f32>) -> [f32; 2] {
    [camera.fx as f32 * x.x / x.z + camera.cx as f32, camera.fy as f32 * x.y / x.z + camera.cy as f32]
}
