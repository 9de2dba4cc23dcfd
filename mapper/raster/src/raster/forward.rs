//! Compositing of one tile, front to back.
//!
//! # Layout
//!
//! What a cell of two rows of eight columns has accumulated lies together in memory; it is one vector of the widest
//! instruction set, else several. One splat after the other is blended into the cells it touches. Nothing branches on
//! a lane.
//!
//! # Finished pixels
//!
//! A pixel stops before the splat that would take its transmittance below the limit. From then on its
//! transmittance is kept with a negative sign, which fails the test of every later splat.

use fearless_simd::{Level, dispatch, prelude::*};

use super::constants::{MIN_ALPHA, MIN_TRANSMITTANCE};
use super::falloff::{BlockFalloff, Falloff, is_listed, parts};
use super::project::Splat;
use super::tile::{BLOCK_WIDTH, CELL, CELL_HEIGHT, CELLS, TILE_COLUMNS, TILE_HEIGHT, TILE_WIDTH, TileEntry};

/// Splats after which a tile is tested for being finished.
const TEST_INTERVAL: usize = 8;

/// What two rows of a block have accumulated.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct PixelCell {
    /// Remaining transmittance; negative once the pixel is finished.
    pub(super) transmittance: [f32; CELL],
    pub(super) colour: [[f32; CELL]; 3],
    pub(super) depth: [f32; CELL],
    /// One more than the index in the list of the last splat composited; zero if there was none.
    pub(super) end: [f32; CELL],
}

/// All pixels of a tile, block by block.
#[derive(Clone, Debug)]
pub(super) struct TilePixels {
    pub(super) blocks: [[PixelCell; CELLS]; TILE_COLUMNS],
    /// Entries of the list in front of which everything composited lies.
    pub(super) end: u32,
}

/// Number of splats composited at every pixel of a tile, block by block.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TileCounts {
    blocks: [[[f32; CELL]; CELLS]; TILE_COLUMNS],
}

impl Default for TilePixels {
    fn default() -> Self {
        let cell = PixelCell {
            transmittance: [1.0; CELL],
            colour: [[0.0; CELL]; 3],
            depth: [0.0; CELL],
            end: [0.0; CELL],
        };
        Self { blocks: [[cell; CELLS]; TILE_COLUMNS], end: 0 }
    }
}

impl TileCounts {
    /// Number at a pixel of the image.
    pub(super) fn at(&self, x: usize, y: usize) -> u32 {
        let (x, y) = (x % TILE_WIDTH, y % TILE_HEIGHT);
        let cell = &self.blocks[x / BLOCK_WIDTH][y / CELL_HEIGHT];
        cell[y % CELL_HEIGHT * BLOCK_WIDTH + x % BLOCK_WIDTH] as u32
    }
}

/// The splats of a tile.
#[derive(Clone, Copy)]
pub(super) struct TileSplats<'a> {
    /// All splats by rank.
    pub(super) splats: &'a [Splat],
    /// Those of the tile.
    pub(super) list: &'a [TileEntry],
    /// Column and row of the first pixel of the tile.
    pub(super) origin: [usize; 2],
}

/// Composites the splats of a tile into its pixels, their depth only with `DEPTH`. With `COUNT`, counts the splats of
/// every pixel in `counts`.
pub(super) fn composite<const DEPTH: bool, const COUNT: bool>(
    level: Level,
    tile: TileSplats,
    pixels: &mut TilePixels,
    counts: &mut TileCounts,
) {
    *pixels = TilePixels::default();
    dispatch!(level, simd => composite_list::<_, DEPTH, COUNT>(simd, tile, pixels, counts));
}

#[inline(always)]
fn composite_list<S: Simd, const DEPTH: bool, const COUNT: bool>(
    simd: S,
    tile: TileSplats,
    pixels: &mut TilePixels,
    counts: &mut TileCounts,
) {
    let TileSplats { splats, list, origin } = tile;
    let [left, top] = origin.map(|pixel| pixel as f32);
    for (index, entry) in list.iter().enumerate() {
        let splat = &splats[entry.rank as usize];
        let end = (index + 1) as f32;
        // Only the cells of a block that the ellipse reaches.
        for (block, &range) in entry.rows.iter().enumerate() {
            let falloff = BlockFalloff::new(simd, splat, left + (block * BLOCK_WIDTH) as f32);
            let from_centre = top - splat.centre[1];
            let first = range.cells().start;
            for (offset, pixels) in pixels.blocks[block][range.cells()].iter_mut().enumerate() {
                let cell = first + offset;
                let dy = from_centre + (cell * CELL_HEIGHT) as f32;
                for part in (0..parts::<S>()).filter(|&part| is_listed::<S>(range, cell, part)) {
                    // alpha = opacity exp(-d^T C d / 2), and front-to-back compositing.
                    let at = falloff.at(simd, dy, part);
                    let used = blend::<_, DEPTH>(simd, splat, &at, end, pixels, part);
                    if COUNT {
                        let count = &mut counts.blocks[block][cell][part * S::f32s::LEN..][..S::f32s::LEN];
                        (S::f32s::from_slice(simd, count) + used).store_slice(count);
                    }
                }
            }
        }
        // What lies behind opaque pixels is not looked at.
        if (index + 1) % TEST_INTERVAL == 0 && is_finished(simd, pixels) {
            break;
        }
    }
    pixels.end = last_end(simd, pixels);
}

/// Blends a splat into vector `part` of a cell; returns 1 where it was composited, else 0.
#[inline(always)]
fn blend<S: Simd, const DEPTH: bool>(
    simd: S,
    splat: &Splat,
    at: &Falloff<S>,
    end: f32,
    cell: &mut PixelCell,
    part: usize,
) -> S::f32s {
    let pixels = part * S::f32s::LEN..(part + 1) * S::f32s::LEN;
    let load = |values: &[f32; CELL]| S::f32s::from_slice(simd, &values[pixels.clone()]);
    let transmittance = load(&cell.transmittance);
    let (zero, one) = (S::f32s::splat(simd, 0.0), S::f32s::splat(simd, 1.0));
    let visible = at.alpha.simd_ge(MIN_ALPHA as f32);
    // A splat that would make the pixel opaque is the first that is left out.
    let behind = transmittance * (one - at.alpha);
    let used = visible & behind.simd_gt(MIN_TRANSMITTANCE as f32);
    let weight = used.select(at.alpha * transmittance, zero);
    for (&colour, sum) in splat.colour.iter().zip(&mut cell.colour) {
        weight.mul_add(colour, load(sum)).store_slice(&mut sum[pixels.clone()]);
    }
    if DEPTH {
        weight.mul_add(at.depth(simd, splat), load(&cell.depth)).store_slice(&mut cell.depth[pixels.clone()]);
    }
    let next = used.select(behind, -transmittance.abs());
    visible.select(next, transmittance).store_slice(&mut cell.transmittance[pixels.clone()]);
    used.select(S::f32s::splat(simd, end), load(&cell.end)).store_slice(&mut cell.end[pixels.clone()]);
    used.select(one, zero)
}

/// The largest of what `select` picks from every cell.
#[inline(always)]
fn largest<S: Simd>(simd: S, pixels: &TilePixels, select: impl Fn(&PixelCell) -> &[f32; CELL]) -> S::f32s {
    let mut largest = S::f32s::splat(simd, -1.0);
    for cell in pixels.blocks.as_flattened() {
        for vector in select(cell).chunks_exact(S::f32s::LEN) {
            largest = largest.max(S::f32s::from_slice(simd, vector));
        }
    }
    largest
}

/// Whether no pixel takes any more splats.
#[inline(always)]
fn is_finished<S: Simd>(simd: S, pixels: &TilePixels) -> bool {
    largest(
        simd,
        pixels,
        #[inline(always)]
        |cell| &cell.transmittance,
    )
    .simd_le(0.0)
    .all_true()
}

#[inline(always)]
fn last_end<S: Simd>(simd: S, pixels: &TilePixels) -> u32 {
    let largest = largest(
        simd,
        pixels,
        #[inline(always)]
        |cell| &cell.end,
    );
    largest.reduce_max() as u32
}
