//! Alpha of a splat at the pixels of a cell: the arithmetic that both passes over the pixels share.

use fearless_simd::prelude::*;

use super::constants::MAX_ALPHA;
use super::exp::exp2_of_minus;
use super::project::Splat;
use super::tile::{BLOCK_WIDTH, CELL, CELL_HEIGHT, RowRange};

/// Column and row of the pixels of a cell.
const COLUMNS: [f32; CELL] = places(0);
const ROWS: [f32; CELL] = places(1);

const fn places(axis: usize) -> [f32; CELL] {
    let mut places = [0.0; CELL];
    let mut pixel = 0;
    while pixel < CELL {
        places[pixel] = [pixel % BLOCK_WIDTH, pixel / BLOCK_WIDTH][axis] as f32;
        pixel += 1;
    }
    places
}

/// A splat over a column of cells.
pub(super) struct BlockFalloff<S: Simd> {
    /// Parts of u and v that do not change from vector to vector.
    fixed: [S::f32s; 2],
    /// du/dx, du/dy and dv/dy.
    whitening: [f32; 3],
    opacity: f32,
}

/// A splat over one vector of pixels.
pub(super) struct Falloff<S: Simd> {
    /// Coordinates in which the splat is round: it falls off as `2^-(u^2 + v^2)`.
    pub(super) u: S::f32s,
    pub(super) v: S::f32s,
    /// Opacity before the ceiling, and after.
    pub(super) raw: S::f32s,
    pub(super) alpha: S::f32s,
}

impl<S: Simd> Falloff<S> {
    /// Camera z at which the rays of the pixels meet the peak of the splat, metres.
    #[inline(always)]
    pub(super) fn depth(&self, simd: S, splat: &Splat) -> S::f32s {
        let [along_u, along_v] = splat.tilt;
        self.u.mul_add(along_u, self.v.mul_add(along_v, S::f32s::splat(simd, splat.depth)))
    }
}

/// Number of vectors of a cell.
#[inline(always)]
pub(super) const fn parts<S: Simd>() -> usize {
    CELL / S::f32s::LEN
}

impl<S: Simd> BlockFalloff<S> {
    /// The splat over the block whose first pixel is in column `left`.
    #[inline(always)]
    pub(super) fn new(simd: S, splat: &Splat, left: f32) -> Self {
        let load = |places: &[f32; CELL]| S::f32s::from_slice(simd, &places[..S::f32s::LEN]);
        let [u_per_column, u_per_row, v_per_row] = splat.whitening;
        let (columns, rows) = (load(&COLUMNS) + (left - splat.centre[0]), load(&ROWS));
        let mut fixed = [columns * u_per_column, rows * v_per_row];
        if S::f32s::LEN > BLOCK_WIDTH {
            fixed[0] += rows * u_per_row;
        }
        Self { fixed, whitening: splat.whitening, opacity: splat.opacity }
    }

    /// Vector `part` of the cell whose first row is at `dy` from the centre of the splat.
    #[inline(always)]
    pub(super) fn at(&self, simd: S, dy: f32, part: usize) -> Falloff<S> {
        let [u_per_column, u_per_row, v_per_row] = self.whitening;
        let first = part * S::f32s::LEN;
        let dy = dy + (first / BLOCK_WIDTH) as f32;
        let column = (first % BLOCK_WIDTH) as f32;
        let u = self.fixed[0] + (u_per_row * dy + u_per_column * column);
        let mut v = S::f32s::splat(simd, v_per_row * dy);
        if S::f32s::LEN > BLOCK_WIDTH {
            v += self.fixed[1];
        }
        let raw = exp2_of_minus(simd, u.mul_add(u, v * v)) * self.opacity;
        Falloff { u, v, raw, alpha: raw.min(MAX_ALPHA as f32) }
    }
}

/// Whether some pixels of vector `part` of cell `cell` are in the rows `range`; always for vectors of several rows.
#[inline(always)]
pub(super) fn is_listed<S: Simd>(range: RowRange, cell: usize, part: usize) -> bool {
    let row = cell * CELL_HEIGHT + part * S::f32s::LEN / BLOCK_WIDTH;
    S::f32s::LEN > BLOCK_WIDTH || (usize::from(range.start)..usize::from(range.end)).contains(&row)
}
