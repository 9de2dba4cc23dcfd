//! An image at places that lie beside its pixels by a smooth field of shifts.
//!
//! # Layout
//!
//! Shifts are known at the nodes of a lattice, the pixels of a coarser pyramid level. Tiles are 64 columns in strips of 64 rows:
//! the lattice is interpolated along its rows first, once for all rows of the image between two of its own, then between
//! them; one sample of the image per SIMD lane.
//!
//! # Cost
//!
//! Per vector nine loads and about forty arithmetic operations; where neighbours are pulled apart, two loads of pairs per
//! pixel instead.

use fearless_simd::{Level, dispatch, prelude::*};

use crate::geometry::PinholeCamera;
use crate::image::{BilinearSampler, LevelImage};

/// Pixels of a tile: a multiple of every vector length.
const TILE: usize = 64;

/// Rows of a tile: few enough for the cache to hold them all across the image.
const STRIP: usize = 64;

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

    /// Fills the shifts of the pixels of `tile` in node row `j`.
    #[inline(always)]
    fn fill_row(&self, tile: &TileColumns, j: usize, row: &mut TileShifts) {
        let nodes = &self.at_nodes[j.min(self.height - 1) * self.width..][..self.width];
        let columns = tile.node.iter().zip(&tile.fraction);
        for ((du, dv), (&node, &fraction)) in row.du.iter_mut().zip(&mut row.dv).zip(columns) {
            // Nodes after the last one repeat it.
            let (left, right) = (nodes[node], nodes[(node + 1).min(self.width - 1)]);
            *du = left[0] + fraction * (right[0] - left[0]);
            *dv = left[1] + fraction * (right[1] - left[1]);
        }
    }
}

/// Where the pixels of a tile lie among the columns of the lattice.
struct TileColumns {
    node: [usize; TILE],
    fraction: [f32; TILE],
}

impl TileColumns {
    #[inline(always)]
    fn new(shifts: &Shifts, u: usize) -> Self {
        let mut columns = Self { node: [0; TILE], fraction: [0.0; TILE] };
        for (k, (node, fraction)) in columns.node.iter_mut().zip(&mut columns.fraction).enumerate() {
            (*node, *fraction) = shifts.node(u + k, shifts.width);
        }
        columns
    }
}

/// Shifts of the pixels of a tile in one row.
#[derive(Clone, Copy)]
struct TileShifts {
    du: [f32; TILE],
    dv: [f32; TILE],
}

/// Writes to `out` the image at every pixel plus its shift, both interpolated bilinearly; the border is continued.
pub(super) fn resample(level: Level, image: &LevelImage, shifts: &Shifts, out: &mut [f32]) {
    dispatch!(level, simd => resample_tiles(simd, image, shifts, out));
}

#[inline(always)]
fn resample_tiles<S: Simd>(simd: S, image: &LevelImage, shifts: &Shifts, out: &mut [f32]) {
    let Some(sampler) = BilinearSampler::new(simd, image) else { return };
    let (last_u, last_v) = ((image.width - 1) as f32, (image.height - 1) as f32);
    let load = |values: &[f32; TILE], k: usize| S::f32s::from_slice(simd, &values[k..k + S::f32s::LEN]);
    let empty = TileShifts { du: [0.0; TILE], dv: [0.0; TILE] };
    let mut light = [0.0; TILE];
    for (strip, rows) in out.chunks_mut(STRIP * image.width).enumerate() {
        for left in (0..image.width).step_by(TILE) {
            let columns = TileColumns::new(shifts, left);
            // The rows of the lattice above and below the row of the image; they change every few rows.
            let (mut above, mut below, mut filled) = (empty, empty, None);
            for (row, v) in rows.chunks_exact_mut(image.width).zip(strip * STRIP..) {
                let (j, fv) = shifts.node(v, shifts.height);
                if filled != Some(j) {
                    shifts.fill_row(&columns, j, &mut above);
                    shifts.fill_row(&columns, j + 1, &mut below);
                    filled = Some(j);
                }
                for k in (0..TILE).step_by(S::f32s::LEN) {
                    let [du, dv] = [(&above.du, &below.du), (&above.dv, &below.dv)].map(|(above, below)| {
                        let above = load(above, k);
                        above + (load(below, k) - above) * fv
                    });
                    let u = S::f32s::from_fn(simd, |lane| (left + k + lane) as f32) + du;
                    let (u, y) = (u.max(0.0).min(last_u), (dv + v as f32).max(0.0).min(last_v));
                    sampler.sample_neighbours(u, y).store_slice(&mut light[k..k + S::f32s::LEN]);
                }
                let right = (left + TILE).min(image.width);
                row[left..right].copy_from_slice(&light[..right - left]);
            }
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
