//! Gradient of one tile by its splats, back to front.
//!
//! The loss is linear in the weights of the splats at a pixel: a splat of which the depth there is z is worth
//! `q = dL/dI c + dL/dD z + dL/dA`, the
//! background `dL/dI c`. With B the worth of everything behind, seen through nothing, `dL/dalpha = T (q - B)` and
//! B of the next splat in front is `B + alpha (q - B)`: one number per pixel however many channels there are.
//!
//! The transmittance T in front of a splat is that behind it divided by `1 - alpha`, at least 0.001, with the
//! very alpha that the forward pass multiplied by: its relative error stays at one rounding per splat. The other
//! way, front to back with what remains found by subtraction, divides a difference of large numbers by `1 - alpha`
//! and loses three digits behind an opaque splat.

use fearless_simd::{Level, dispatch, f32x4, prelude::*};

use super::constants::{MAX_ALPHA, MIN_ALPHA};
use super::falloff::{BlockFalloff, Falloff, is_listed, parts};
use super::forward::{TilePixels, TileSplats};
use super::lanes::each;
use super::project::Splat;
use super::tile::{BLOCK_WIDTH, CELL, CELL_HEIGHT, CELLS, TILE_COLUMNS};

/// Sums over the pixels of a tile for one splat, with `s` the gradient by the logarithm of alpha, (u, v) the
/// coordinates in which the splat is round, `w` the weight and `g = w dL/dD`: `s`, `s u`, `s v`, `s u^2`, `s u v`,
/// `s v^2`, `w dL/dI` (three), `g`, `g u`, `g v`.
pub(super) type SplatSums = [f32; 12];

/// What the backward pass keeps of a cell.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub(super) struct GradientCell {
    grad_colour: [[f32; CELL]; 3],
    grad_depth: [f32; CELL],
    grad_alpha: [f32; CELL],
    /// Transmittance in front of the splats visited so far.
    transmittance: [f32; CELL],
    /// Worth of everything visited so far, seen through nothing.
    behind: [f32; CELL],
    /// See [`super::forward::PixelCell::end`].
    end: [f32; CELL],
}

impl GradientCell {
    /// The given gradient by red, green, blue, depth and alpha.
    pub(super) fn given_mut(&mut self) -> [&mut [f32; CELL]; 5] {
        let [red, green, blue] = self.grad_colour.each_mut();
        [red, green, blue, &mut self.grad_depth, &mut self.grad_alpha]
    }

    /// Forgets the given gradient.
    pub(super) fn clear(&mut self) {
        self.given_mut().into_iter().for_each(|values| *values = [0.0; CELL]);
    }
}

/// The gradient by the pixels of a tile, block by block.
pub(super) type TileGradient = [[GradientCell; CELLS]; TILE_COLUMNS];

/// The sums of [`SplatSums`], one vector each.
struct Sums<S: Simd>([S::f32s; 12]);

/// Writes the sums of every splat of the tile to `sums`, which has the length of its list. `gradient` holds the
/// gradient by the pixels on entry and is used up. Without `GEOMETRY` depth and alpha count as having no gradient.
pub(super) fn backward<const GEOMETRY: bool>(
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
        replay::<_, GEOMETRY>(simd, tile, gradient, composited);
    });
}

/// Everything behind the last splat of a pixel is background.
#[inline(always)]
fn start<S: Simd>(simd: S, background: &[f32; 3], pixels: &TilePixels, gradient: &mut TileGradient) {
    let load = |values: &[f32], at: usize| S::f32s::from_slice(simd, &values[at..at + S::f32s::LEN]);
    let cells = gradient.as_flattened_mut().iter_mut().zip(pixels.blocks.as_flattened());
    for (cell, pixels) in cells {
        for at in (0..CELL).step_by(S::f32s::LEN) {
            let mut behind = S::f32s::splat(simd, 0.0);
            for (grad_colour, &background) in cell.grad_colour.iter().zip(background) {
                behind = load(grad_colour, at).mul_add(background, behind);
            }
            behind.store_slice(&mut cell.behind[at..at + S::f32s::LEN]);
            let transmittance = load(&pixels.transmittance, at).abs();
            transmittance.store_slice(&mut cell.transmittance[at..at + S::f32s::LEN]);
        }
        cell.end = pixels.end;
    }
}

#[inline(always)]
fn replay<S: Simd, const GEOMETRY: bool>(
    simd: S,
    tile: TileSplats,
    gradient: &mut TileGradient,
    out: &mut [SplatSums],
) {
    let TileSplats { splats, list, origin } = tile;
    let [left, top] = origin.map(|pixel| pixel as f32);
    // Back to front, so that what is behind a splat is known when it is its turn.
    for (index, (entry, out)) in list.iter().zip(out).enumerate().rev() {
        let splat = &splats[entry.rank as usize];
        let mut sums = Sums([S::f32s::splat(simd, 0.0); 12]);
        for (block, &range) in entry.rows.iter().enumerate() {
            let falloff = BlockFalloff::new(simd, splat, left + (block * BLOCK_WIDTH) as f32);
            let from_centre = top - splat.centre[1];
            let first = range.cells().start;
            for (offset, gradient) in gradient[block][range.cells()].iter_mut().enumerate() {
                let cell = first + offset;
                let dy = from_centre + (cell * CELL_HEIGHT) as f32;
                for part in (0..parts::<S>()).filter(|&part| is_listed::<S>(range, cell, part)) {
                    let at = falloff.at(simd, dy, part);
                    sums.add::<GEOMETRY>(simd, splat, &at, index as f32, gradient, part);
                }
            }
        }
        *out = sums.finish(simd);
    }
}

impl<S: Simd> Sums<S> {
    /// Adds vector `part` of a cell and takes its state to the front of the splat.
    #[inline(always)]
    fn add<const GEOMETRY: bool>(
        &mut self,
        simd: S,
        splat: &Splat,
        at: &Falloff<S>,
        index: f32,
        cell: &mut GradientCell,
        part: usize,
    ) {
        let pixels = part * S::f32s::LEN..(part + 1) * S::f32s::LEN;
        let load = |values: &[f32; CELL]| S::f32s::from_slice(simd, &values[pixels.clone()]);
        let used = at.alpha.simd_ge(MIN_ALPHA as f32) & load(&cell.end).simd_gt(index);
        let zero = S::f32s::splat(simd, 0.0);
        let alpha = used.select(at.alpha, zero);
        let transmittance = load(&cell.transmittance) / (S::f32s::splat(simd, 1.0) - alpha);
        let weight = alpha * transmittance;

        let grad_colour =
            [load(&cell.grad_colour[0]), load(&cell.grad_colour[1]), load(&cell.grad_colour[2])];
        let mut worth = zero;
        if GEOMETRY {
            worth = load(&cell.grad_depth).mul_add(at.depth(simd, splat), load(&cell.grad_alpha));
        }
        for (grad_colour, &colour) in grad_colour.iter().zip(&splat.colour) {
            worth = grad_colour.mul_add(colour, worth);
        }
        let behind = load(&cell.behind);
        let gain = worth - behind;
        alpha.mul_add(gain, behind).store_slice(&mut cell.behind[pixels.clone()]);
        transmittance.store_slice(&mut cell.transmittance[pixels.clone()]);

        // At the ceiling alpha does not move.
        let grad_logarithm = at.raw.simd_lt(MAX_ALPHA as f32).select(weight * gain, zero);
        let along_u = grad_logarithm * at.u;
        let along_v = grad_logarithm * at.v;
        let sums = &mut self.0;
        sums[0] += grad_logarithm;
        sums[1] += along_u;
        sums[2] += along_v;
        sums[3] = along_u.mul_add(at.u, sums[3]);
        sums[4] = along_u.mul_add(at.v, sums[4]);
        sums[5] = along_v.mul_add(at.v, sums[5]);
        for (sum, grad_colour) in sums[6..9].iter_mut().zip(grad_colour) {
            *sum = weight.mul_add(grad_colour, *sum);
        }
        if GEOMETRY {
            let grad_depth = weight * load(&cell.grad_depth);
            sums[9] += grad_depth;
            sums[10] = grad_depth.mul_add(at.u, sums[10]);
            sums[11] = grad_depth.mul_add(at.v, sums[11]);
        }
    }

    #[inline(always)]
    fn finish(self, simd: S) -> SplatSums {
        let [a, b, c, d, e, f, g, h, i, j, k, l] = each(
            #[inline(always)]
            |sum| fold(simd, self.0[sum]),
        );
        let mut out = [0.0; 12];
        sum_four(a, b, c, d).store_slice(&mut out[..4]);
        sum_four(e, f, g, h).store_slice(&mut out[4..8]);
        sum_four(i, j, k, l).store_slice(&mut out[8..]);
        out
    }
}

/// The sum of the parts of four numbers of a vector.
#[inline(always)]
fn fold<S: Simd>(simd: S, vector: S::f32s) -> f32x4<S> {
    let part = |k: usize| f32x4::from_slice(simd, &vector.as_slice()[4 * k..4 * k + 4]);
    let mut sum = part(0);
    for k in 1..S::f32s::LEN / 4 {
        sum += part(k);
    }
    sum
}

/// The sums of the elements of four vectors.
#[inline(always)]
fn sum_four<S: Simd>(a: f32x4<S>, b: f32x4<S>, c: f32x4<S>, d: f32x4<S>) -> f32x4<S> {
    let pairs = |x: f32x4<S>, y: f32x4<S>| x.unzip_low(y) + x.unzip_high(y);
    pairs(pairs(a, b), pairs(c, d))
}
