//! Gradient of one tile by its splats, back to front.
//!
//! The loss is linear in the weights of the splats at a pixel: a splat is worth `q = dL/dI c + dL/dD z + dL/dA`, the
//! background `dL/dI c`. With B the worth of everything behind, seen through nothing, `dL/dalpha = T (q - B)` and
//! B of the next splat in front is `B + alpha (q - B)`: one number per pixel however many channels there are.
//!
//! The transmittance T in front of a splat is that behind it divided by `1 - alpha`, at least 0.001, with the
//! very alpha that the forward pass multiplied by: its relative error stays at one rounding per splat. The other
//! way, front to back with what remains found by subtraction, divides a difference of large numbers by `1 - alpha`
//! and loses three digits behind an opaque splat.

use fearless_simd::{Level, dispatch, f32x4, f32x8, prelude::*};

use super::constants::{MAX_ALPHA, MIN_ALPHA};
use super::falloff::BlockFalloff;
use super::forward::{TilePixels, TileSplats};
use super::lanes::each;
use super::project::Splat;
use super::tile::{BLOCK_WIDTH, TILE_COLUMNS, TILE_HEIGHT};

/// Sums over the pixels of a tile for one splat, with `s` the gradient by the logarithm of alpha, (u, v) the
/// coordinates in which the splat is round, and `w` the weight: `s`, `s u`, `s v`, `s u^2`, `s u v`, `s v^2`,
/// `w dL/dI` (three), `w dL/dD`; two unused.
pub(super) type SplatSums = [f32; 12];

/// What the backward pass keeps of one row of a block.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub(super) struct GradientRow {
    pub(super) by_colour: [[f32; BLOCK_WIDTH]; 3],
    pub(super) by_depth: [f32; BLOCK_WIDTH],
    pub(super) by_alpha: [f32; BLOCK_WIDTH],
    /// Transmittance in front of the splats visited so far.
    pub(super) transmittance: [f32; BLOCK_WIDTH],
    /// Worth of everything visited so far, seen through nothing.
    pub(super) behind: [f32; BLOCK_WIDTH],
    /// See [`super::forward::PixelRow::end`].
    pub(super) end: [f32; BLOCK_WIDTH],
}

/// The gradient by the pixels of a tile, block by block.
pub(super) type TileGradient = [[GradientRow; TILE_HEIGHT]; TILE_COLUMNS];

/// Ten sums, one vector each.
struct Sums<S: Simd>([f32x8<S>; 10]);

/// Writes the sums of every splat of the tile to `sums`, which has the length of its list. `gradient` holds the
/// gradient by the pixels on entry and is used up.
pub(super) fn backward(
    level: Level,
    tile: TileSplats,
    background: &[f32; 3],
    pixels: &TilePixels,
    gradient: &mut TileGradient,
    sums: &mut [SplatSums],
) {
    let end = (pixels.end as usize).min(tile.list.len());
    let (composited, skipped) = sums.split_at_mut(end);
    skipped.fill([0.0; 12]);
    dispatch!(level, simd => {
        start(simd, background, pixels, gradient);
        replay(simd, tile, gradient, composited);
    });
}

/// Everything behind the last splat of a pixel is background.
#[inline(always)]
fn start<S: Simd>(simd: S, background: &[f32; 3], pixels: &TilePixels, gradient: &mut TileGradient) {
    let rows = gradient.as_flattened_mut().iter_mut().zip(pixels.blocks.as_flattened());
    for (row, pixels) in rows {
        let mut behind = f32x8::splat(simd, 0.0);
        for (by_colour, &background) in row.by_colour.iter().zip(background) {
            behind = f32x8::from_slice(simd, by_colour).mul_add(background, behind);
        }
        behind.store_slice(&mut row.behind);
        f32x8::from_slice(simd, &pixels.transmittance).abs().store_slice(&mut row.transmittance);
        row.end = pixels.end;
    }
}

#[inline(always)]
fn replay<S: Simd>(simd: S, tile: TileSplats, gradient: &mut TileGradient, out: &mut [SplatSums]) {
    let TileSplats { splats, list, origin } = tile;
    let [left, top] = origin.map(|pixel| pixel as f32);
    for (index, (entry, out)) in list.iter().zip(out).enumerate().rev() {
        let splat = &splats[entry.rank as usize];
        let mut sums = Sums([f32x8::splat(simd, 0.0); 10]);
        for (block, range) in entry.rows.iter().enumerate() {
            let falloff = BlockFalloff::new(simd, splat, left + (block * BLOCK_WIDTH) as f32);
            let range = usize::from(range.start)..usize::from(range.end);
            let mut dy = top + range.start as f32 - splat.centre[1];
            for row in &mut gradient[block][range] {
                sums.add(simd, splat, &falloff, dy, index as f32, row);
                dy += 1.0;
            }
        }
        *out = sums.finish(simd);
    }
}

impl<S: Simd> Sums<S> {
    /// Adds one row and takes its state to the front of the splat.
    #[inline(always)]
    fn add(
        &mut self,
        simd: S,
        splat: &Splat,
        falloff: &BlockFalloff<S>,
        dy: f32,
        index: f32,
        row: &mut GradientRow,
    ) {
        let load = |values: &[f32; BLOCK_WIDTH]| f32x8::from_slice(simd, values);
        let at = falloff.row(dy);
        let used = at.alpha.simd_ge(MIN_ALPHA as f32) & load(&row.end).simd_gt(index);
        let zero = f32x8::splat(simd, 0.0);
        let alpha = used.select(at.alpha, zero);
        let transmittance = load(&row.transmittance) / (f32x8::splat(simd, 1.0) - alpha);
        let weight = alpha * transmittance;

        let by_colour = [load(&row.by_colour[0]), load(&row.by_colour[1]), load(&row.by_colour[2])];
        let by_depth = load(&row.by_depth);
        let mut worth = by_depth.mul_add(splat.depth, load(&row.by_alpha));
        for (by_colour, &colour) in by_colour.iter().zip(&splat.colour) {
            worth = by_colour.mul_add(colour, worth);
        }
        let behind = load(&row.behind);
        let gain = worth - behind;
        alpha.mul_add(gain, behind).store_slice(&mut row.behind);
        transmittance.store_slice(&mut row.transmittance);

        // At the ceiling alpha does not move.
        let by_logarithm = at.raw.simd_lt(MAX_ALPHA as f32).select(weight * gain, zero);
        let along_u = by_logarithm * at.u;
        let along_v = by_logarithm * at.v;
        let sums = &mut self.0;
        sums[0] += by_logarithm;
        sums[1] += along_u;
        sums[2] += along_v;
        sums[3] = along_u.mul_add(at.u, sums[3]);
        sums[4] = along_u.mul_add(at.v, sums[4]);
        sums[5] = along_v.mul_add(at.v, sums[5]);
        for (sum, by_colour) in sums[6..9].iter_mut().zip(by_colour) {
            *sum = weight.mul_add(by_colour, *sum);
        }
        sums[9] = weight.mul_add(by_depth, sums[9]);
    }

    #[inline(always)]
    fn finish(self, simd: S) -> SplatSums {
        let [a, b, c, d, e, f, g, h, i, j] = each(
            #[inline(always)]
            |k| {
                let (low, high) = self.0[k].split();
                low + high
            },
        );
        let zero = f32x4::splat(simd, 0.0);
        let mut out = [0.0; 12];
        sum_four(a, b, c, d).store_slice(&mut out[..4]);
        sum_four(e, f, g, h).store_slice(&mut out[4..8]);
        sum_four(i, j, zero, zero).store_slice(&mut out[8..]);
        out
    }
}

/// The sums of the elements of four vectors.
#[inline(always)]
fn sum_four<S: Simd>(a: f32x4<S>, b: f32x4<S>, c: f32x4<S>, d: f32x4<S>) -> f32x4<S> {
    let pairs = |x: f32x4<S>, y: f32x4<S>| x.unzip_low(y) + x.unzip_high(y);
    pairs(pairs(a, b), pairs(c, d))
}
