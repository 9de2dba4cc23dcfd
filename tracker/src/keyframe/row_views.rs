//! Where the camera was when the rows of an image were seen, one after the other.

use arrayvec::ArrayVec;
use fearless_simd::{f32x8, i32x8, mask32x8, prelude::*};

use crate::geometry::{PinholeCamera, RigidTransform};
use crate::trajectory::BowedTrajectory;
use crate::transfer::MAX_BANDS;

/// Entries of a [`View`].
const ENTRIES: usize = 12;

/// `camera_from_keyframe` at one time, in single precision: per row three entries of the rotation and one of the translation.
#[derive(Clone, Copy)]
struct View([f32; ENTRIES]);

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

    /// The views of eight rows, interpolated between the borders of their bands: a band turns by a hundredth of a radian at
    /// the most, so that the mean of two rotations is one to a few parts in 10^5.
    #[inline(always)]
    pub(super) fn at<S: Simd>(&self, simd: S, row: f32x8<S>) -> LaneViews<S> {
        let bands = (row + 0.5) * (MAX_BANDS as f32 / self.height as f32);
        let band = bands.max(0.0).min((MAX_BANDS - 1) as f32).to_int::<i32x8<S>>();
        let share = (bands - band.to_float::<f32x8<S>>()).max(-1.0).min(2.0);
        let index = band.as_slice();
        let border = |lane: usize| (index[lane] as u32 as usize).min(MAX_BANDS - 1);
        let mut entries = [share; ENTRIES];
        if index.iter().all(|&band| band == index[0]) {
            // Neighbours are nearly always in one band.
            let (above, below) = (&self.at_borders[border(0)].0, &self.at_borders[border(0) + 1].0);
            for ((entry, &above), &below) in entries.iter_mut().zip(above).zip(below) {
                *entry = share * (below - above) + above;
            }
        } else {
            for (k, entry) in entries.iter_mut().enumerate() {
                let above = f32x8::from_fn(simd, |lane| self.at_borders[border(lane)].0[k]);
                let below = f32x8::from_fn(simd, |lane| self.at_borders[border(lane) + 1].0[k]);
                *entry = share * (below - above) + above;
            }
        }
        LaneViews { entries }
    }
}

impl View {
    fn new(keyframe_from_camera: &RigidTransform) -> Self {
        let inverse = keyframe_from_camera.inverse();
        let (rotation, translation) = (inverse.rotation_matrix(), inverse.translation);
        Self(core::array::from_fn(|k| {
            let (row, column) = (k / 4, k % 4);
            (if column < 3 { rotation[(row, column)] } else { translation[row] }) as f32
        }))
    }
}

/// [`View`]s of eight pixels.
pub(super) struct LaneViews<S: Simd> {
    entries: [f32x8<S>; ENTRIES],
}

impl<S: Simd> LaneViews<S> {
    /// Row `i` of the rotations times the rays `(x, y, 1)`.
    #[inline(always)]
    pub(super) fn turned(&self, i: usize, [x, y]: [f32x8<S>; 2]) -> f32x8<S> {
        self.entries[4 * i] * x + self.entries[4 * i + 1] * y + self.entries[4 * i + 2]
    }

    /// Component `i` of the translations.
    #[inline(always)]
    pub(super) fn shift(&self, i: usize) -> f32x8<S> {
        self.entries[4 * i + 3]
    }

    /// The points at inverse depth `rho` on the rays, times `rho`.
    #[inline(always)]
    pub(super) fn points(&self, ray: [f32x8<S>; 2], rho: f32x8<S>) -> [f32x8<S>; 3] {
        core::array::from_fn(|i| self.turned(i, ray) + self.shift(i) * rho)
    }
}

/// `(x, y)` of the rays `(x, y, 1)` through pixels.
#[inline(always)]
pub(super) fn rays_of<S: Simd>(simd: S, camera: &PinholeCamera, u: f32x8<S>, v: f32) -> [f32x8<S>; 2] {
    let y = (v - camera.cy as f32) / camera.fy as f32;
    [(u - camera.cx as f32) / f32x8::splat(simd, camera.fx as f32), f32x8::splat(simd, y)]
}

/// Pixels of points; `in_front` says which of them count.
#[inline(always)]
pub(super) fn pixels_of<S: Simd>(
    simd: S,
    camera: &PinholeCamera,
    x: &[f32x8<S>; 3],
    in_front: mask32x8<S>,
) -> [f32x8<S>; 2] {
    let one = f32x8::splat(simd, 1.0);
    let inverse_z = one / in_front.select(x[2], one);
    [
        x[0] * inverse_z * camera.fx as f32 + camera.cx as f32,
        x[1] * inverse_z * camera.fy as f32 + camera.cy as f32,
    ]
}
