//! Alpha of a splat along one row of a block: the arithmetic that both passes over the pixels share.

use fearless_simd::{f32x8, prelude::*};

use super::constants::MAX_ALPHA;
use super::exp::exp2_negative;
use super::project::Splat;
use super::tile::BLOCK_WIDTH;

const COLUMNS: [f32; BLOCK_WIDTH] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// A splat over a column of blocks.
pub(super) struct BlockFalloff<S: Simd> {
    /// From the centre of the splat to the pixels, along x.
    pub(super) dx: f32x8<S>,
    /// Terms of the falloff that do not change from row to row: `xx dx^2` and `xy dx`.
    square: f32x8<S>,
    mixed: f32x8<S>,
    /// `yy`.
    vertical: f32,
    opacity: f32,
}

/// A splat over one row of a block.
pub(super) struct RowFalloff<S: Simd> {
    /// Opacity before the ceiling, and after.
    pub(super) raw: f32x8<S>,
    pub(super) alpha: f32x8<S>,
}

impl<S: Simd> BlockFalloff<S> {
    /// The splat over the block whose first pixel is in column `left`.
    #[inline(always)]
    pub(super) fn new(simd: S, splat: &Splat, left: f32) -> Self {
        let dx = f32x8::from_slice(simd, &COLUMNS) + (left - splat.centre[0]);
        let [xx, xy, yy] = splat.falloff;
        Self { dx, square: dx * dx * xx, mixed: dx * xy, vertical: yy, opacity: splat.opacity }
    }

    /// The row at `dy` from the centre of the splat.
    #[inline(always)]
    pub(super) fn row(&self, dy: f32) -> RowFalloff<S> {
        let exponent = (self.mixed + self.vertical * dy).mul_add(dy, self.square);
        let raw = exp2_negative(exponent) * self.opacity;
        RowFalloff { raw, alpha: raw.min(MAX_ALPHA as f32) }
    }
}
