//! Alpha of a splat along one row of a block: the arithmetic that both passes over the pixels share.

use fearless_simd::{f32x8, prelude::*};

use super::constants::MAX_ALPHA;
use super::exp::exp2_of_minus;
use super::project::Splat;
use super::tile::BLOCK_WIDTH;

const COLUMNS: [f32; BLOCK_WIDTH] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// A splat over a column of blocks.
pub(super) struct BlockFalloff<S: Simd> {
    /// Part of u that does not change from row to row.
    across: f32x8<S>,
    /// What u and v gain per row.
    down: [f32; 2],
    opacity: f32,
}

/// A splat over one row of a block.
pub(super) struct RowFalloff<S: Simd> {
    /// Coordinates in which the splat is round: it falls off as `2^-(u^2 + v^2)`.
    pub(super) u: f32x8<S>,
    pub(super) v: f32,
    /// Opacity before the ceiling, and after.
    pub(super) raw: f32x8<S>,
    pub(super) alpha: f32x8<S>,
}

impl<S: Simd> BlockFalloff<S> {
    /// The splat over the block whose first pixel is in column `left`.
    #[inline(always)]
    pub(super) fn new(simd: S, splat: &Splat, left: f32) -> Self {
        let dx = f32x8::from_slice(simd, &COLUMNS) + (left - splat.centre[0]);
        let [u_per_column, u_per_row, v_per_row] = splat.whitening;
        Self { across: dx * u_per_column, down: [u_per_row, v_per_row], opacity: splat.opacity }
    }

    /// The row at `dy` from the centre of the splat.
    #[inline(always)]
    pub(super) fn row(&self, dy: f32) -> RowFalloff<S> {
        let u = self.across + self.down[0] * dy;
        let v = self.down[1] * dy;
        let raw = exp2_of_minus(u.mul_add(u, v * v)) * self.opacity;
        RowFalloff { u, v, raw, alpha: raw.min(MAX_ALPHA as f32) }
    }
}
