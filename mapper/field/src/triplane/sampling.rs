//! Where rays are sampled.

use mba_raster::sensor::Observation;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use rand_pcg::Pcg32;

use super::planes::unit;

/// How many samples rays get, and where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SamplingSettings {
    /// In front of a measured depth, at mid exposure.
    pub front: usize,
    /// Around a measured depth, 1.5 truncations to both sides, at mid exposure.
    pub band: usize,
    /// Around the surface that a ray is expected to meet, everywhere else.
    pub surface: usize,
    /// Half the length of that range, truncations.
    pub surface_reach: f32,
    /// Along a ray that meets no surface.
    pub open: usize,
    /// Samples with less weight in their ray have no colour: 1e-3 changes no stored value.
    pub least_weight: f32,
}

impl Default for SamplingSettings {
    fn default() -> Self {
        Self { front: 3, band: 10, surface: 7, surface_reach: 0.6, open: 12, least_weight: 1e-3 }
    }
}

/// Nearest depth that is looked at, metres.
pub(super) const NEAREST: f32 = 0.05;

/// Half the length of the range around a measured depth, truncations (ESLAM).
const BAND_REACH: f32 = 1.5;

/// Appends `count` depths to `out`, one at a random place in each of as many equal parts of a range, ascending. Nothing
/// for an empty range.
pub(super) fn stratified(random: &mut Pcg32, range: [f32; 2], count: usize, out: &mut Vec<f32>) {
    let step = (range[1] - range[0]) / count as f32;
    if step > 0.0 {
        out.extend((0..count).map(|k| range[0] + step * (k as f32 + unit(random))));
    }
}

impl SamplingSettings {
    /// Samples of a ray at mid exposure with a measured depth.
    pub(super) fn measured(&self, random: &mut Pcg32, depth: f32, truncation: f32, out: &mut Vec<f32>) {
        let reach = BAND_REACH * truncation;
        let start = (depth - reach).max(NEAREST);
        stratified(random, [NEAREST, start], self.front, out);
        stratified(random, [start, depth + reach], self.band, out);
    }

    /// Samples of a ray that meets one of two surfaces, the first no farther than the second.
    pub(super) fn expected(
        &self,
        random: &mut Pcg32,
        surfaces: [f32; 2],
        truncation: f32,
        out: &mut Vec<f32>,
    ) {
        let reach = self.surface_reach * truncation;
        let around = |depth: f32| [(depth - reach).max(NEAREST), depth + reach];
        let [near, far] = surfaces.map(around);
        // The two ranges overlap and are one; else each gets its half of the samples.
        if far[0] <= near[1] {
            stratified(random, [near[0], far[1]], self.surface, out);
        } else {
            let half = self.surface / 2;
            stratified(random, near, half, out);
            stratified(random, far, self.surface - half, out);
        }
    }
}

/// Rotation and translation in single precision.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    pub(super) rotation: [[f32; 3]; 3],
    pub(super) translation: [f32; 3],
}

impl Motion {
    pub(super) fn new(transform: &RigidTransform) -> Self {
        let rotation = transform.rotation_matrix();
        Self {
            rotation: [0, 1, 2].map(|i| [0, 1, 2].map(|j| rotation[(i, j)] as f32)),
            translation: transform.translation.map(|x| x as f32).into(),
        }
    }

    pub(super) fn turn(&self, x: [f32; 3]) -> [f32; 3] {
        self.rotation.map(|row| row[0] * x[0] + row[1] * x[1] + row[2] * x[2])
    }

    pub(super) fn turn_back(&self, x: [f32; 3]) -> [f32; 3] {
        let r = &self.rotation;
        [0, 1, 2].map(|i| r[0][i] * x[0] + r[1][i] * x[1] + r[2][i] * x[2])
    }

    pub(super) fn apply(&self, x: [f32; 3]) -> [f32; 3] {
        let turned = self.turn(x);
        [0, 1, 2].map(|i| turned[i] + self.translation[i])
    }
}

/// The depth image of mid exposure, from which the depth that another virtual view sees is guessed.
#[derive(Clone, Copy, Debug)]
pub(super) struct MidDepth<'a> {
    pub(super) camera: PinholeCamera,
    pub(super) depth: &'a [f32],
}

impl<'a> MidDepth<'a> {
    pub(super) fn new(seen: &'a Observation) -> Self {
        Self { camera: seen.camera, depth: &seen.depth }
    }

    /// Depth measured at a point of the camera frame of mid exposure, if any.
    fn at(&self, x: [f32; 3]) -> Option<f32> {
        let camera = &self.camera;
        // Half a pixel more, so that cutting off rounds.
        let inverse = 1.0 / x[2];
        let u = camera.fx as f32 * x[0] * inverse + camera.cx as f32 + 0.5;
        let v = camera.fy as f32 * x[1] * inverse + camera.cy as f32 + 0.5;
        let inside = u >= 0.0 && v >= 0.0 && u < camera.width as f32 && v < camera.height as f32;
        let pixel = if inside { v as usize * camera.width + u as usize } else { usize::MAX };
        self.depth.get(pixel).copied().filter(|depth| *depth > 0.0)
    }

    /// Depths at which a ray of another view may meet a surface, ascending: the image is asked where the point at the
    /// last guess is seen, until that is where it lies. At an edge the guesses go to and fro between two surfaces.
    pub(super) fn guess(&self, mid_from_view: &Motion, slope: [f32; 2], start: f32) -> [f32; 2] {
        let direction = [slope[0], slope[1], 1.0];
        let per_forward = 1.0 / mid_from_view.turn(direction)[2];
        let next = |z: f32| {
            let x = mid_from_view.apply(direction.map(|d| d * z));
            let measured = if x[2] > NEAREST { self.at(x) } else { None };
            measured.map_or(z, |measured| (z + (measured - x[2]) * per_forward).max(2.0 * NEAREST))
        };
        // Two steps reach a surface that is smooth; one more shows whether they have come to rest.
        let second = next(next(start));
        let third = next(second);
        [second.min(third), second.max(third)]
    }
}
