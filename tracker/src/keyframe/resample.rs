//! An image at places that lie beside its pixels by a smooth field of shifts.
//!
//! # Layout
//!
//! Shifts are known at the nodes of a lattice, the pixels of a coarser pyramid level. Per tile of 64 pixels the lattice is
//! interpolated between its rows first, then along them; one sample of the image per SIMD lane.
//!
//! # Cost
//!
//! Per pixel one cell (two loads of neighbouring pairs) and about thirty arithmetic operations.

use fearless_simd::{Level, dispatch, prelude::*};

use crate::geometry::PinholeCamera;
use crate::image::{BilinearSampler, LevelImage};

/// Pixels of a tile: a multiple of every vector length.
const TILE: usize = 64;

/// Shifts at the pixels of pyramid level `level`, in pixels of the finest.
pub(super) struct Shifts<'a> {
    pub(super) at_nodes: &'a [[f32; 2]],
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) level: usize,
}

impl Shifts<'_> {
    /// The node before pixel `x` of the finest level, of `count`, and how far the pixel lies behind it.
    #[inline(always)]
    fn node(&self, x: usize, count: usize) -> (usize, f32) {
        let at = PinholeCamera::pixel_at_level(x as f32, 0, self.level).clamp(0.0, (count - 1) as f32);
        let first = (at as usize).min(count.saturating_sub(2));
        (first, at - first as f32)
    }

    /// Fills the shifts of the pixels from `(u, v)` on. Nodes after the last one repeat it.
    #[inline(always)]
    fn fill(&self, u: usize, v: usize, du: &mut [f32; TILE], dv: &mut [f32; TILE]) {
        let (j, fv) = self.node(v, self.height);
        let above = &self.at_nodes[j * self.width..][..self.width];
        let below = &self.at_nodes[(j + 1).min(self.height - 1) * self.width..][..self.width];
        let (first, _) = self.node(u, self.width);
        // A node per pixel at the most, and one on either side.
        let mut between = [[0.0f32; 2]; TILE + 2];
        let nodes = (TILE >> self.level) + 2;
        for (k, shift) in between[..nodes.min(TILE + 2)].iter_mut().enumerate() {
            let i = (first + k).min(self.width - 1);
            *shift = core::array::from_fn(|axis| above[i][axis] + fv * (below[i][axis] - above[i][axis]));
        }
        for k in 0..TILE {
            let (i, fu) = self.node(u + k, self.width);
            let place = (i - first).min(TILE);
            let (left, right) = (between[place], between[place + 1]);
            du[k] = left[0] + fu * (right[0] - left[0]);
            dv[k] = left[1] + fu * (right[1] - left[1]);
        }
    }
}

/// Writes to `out` the image at every pixel plus its shift, both interpolated bilinearly; the border is continued.
pub(super) fn resample(level: Level, image: &LevelImage, shifts: &Shifts, out: &mut [f32]) {
    dispatch!(level, simd => resample_rows(simd, image, shifts, out));
}

#[inline(always)]
fn resample_rows<S: Simd>(simd: S, image: &LevelImage, shifts: &Shifts, out: &mut [f32]) {
    let Some(sampler) = BilinearSampler::new(simd, image) else { return };
    let (last_u, last_v) = ((image.width - 1) as f32, (image.height - 1) as f32);
    let (mut du, mut dv, mut light) = ([0.0; TILE], [0.0; TILE], [0.0; TILE]);
    for (v, row) in out.chunks_exact_mut(image.width).enumerate() {
        for (tile, pixels) in row.chunks_mut(TILE).enumerate() {
            shifts.fill(tile * TILE, v, &mut du, &mut dv);
            for k in (0..TILE).step_by(S::f32s::LEN) {
                let u = S::f32s::from_fn(simd, |lane| (tile * TILE + k + lane) as f32);
                let u = (u + S::f32s::from_slice(simd, &du[k..k + S::f32s::LEN])).max(0.0).min(last_u);
                let y = S::f32s::from_slice(simd, &dv[k..k + S::f32s::LEN]) + v as f32;
                let cell = sampler.locate(u, y.max(0.0).min(last_v));
                sampler.sample(&cell).value.store_slice(&mut light[k..k + S::f32s::LEN]);
            }
            pixels.copy_from_slice(&light[..pixels.len()]);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::*;
    use crate::simd::{level_name, levels_up_to};

    const WIDTH: usize = 100;
    const HEIGHT: usize = 40;

    fn value(u: f64, v: f64) -> f64 {
        0.3 + 0.01 * u + 0.02 * v
    }

    #[test]
    fn pixels_are_taken_from_where_the_field_points_at_every_instruction_set() {
        let pixels: Vec<f32> =
            (0..WIDTH * HEIGHT).map(|k| value((k % WIDTH) as f64, (k / WIDTH) as f64) as f32).collect();
        let image = LevelImage { pixels: &pixels, width: WIDTH, height: HEIGHT };
        for level in 0..3 {
            let (width, height) = (WIDTH >> level, HEIGHT >> level);
            let full = |x: usize| PinholeCamera::pixel_at_level(x as f32, level, 0);
            // Linear in the pixel, so that interpolating it is exact between nodes.
            let field = |u: f32, v: f32| [1.5 + 0.01 * v, -2.25 + 0.02 * u];
            let at_nodes: Vec<[f32; 2]> =
                (0..width * height).map(|k| field(full(k % width), full(k / width))).collect();
            let shifts = Shifts { at_nodes: &at_nodes, width, height, level };
            for simd in levels_up_to(Level::new()) {
                let mut out = vec![f32::NAN; WIDTH * HEIGHT];
                resample(simd, &image, &shifts, &mut out);
                for (k, light) in out.iter().enumerate() {
                    let (u, v) = ((k % WIDTH) as f32, (k / WIDTH) as f32);
                    let nodes = [(u, width), (v, height)].map(|(x, count)| x.clamp(full(0), full(count - 1)));
                    let [du, dv] = field(nodes[0], nodes[1]);
                    let seen = [(u + du).clamp(0.0, 99.0), (v + dv).clamp(0.0, 39.0)].map(f64::from);
                    let expected = value(seen[0], seen[1]);
                    let name = level_name(simd);
                    assert!(
                        (f64::from(*light) - expected).abs() < 2e-6,
                        "{name}, level {level}, ({u}, {v}): {light}, {expected}"
                    );
                }
            }
        }
    }
}
