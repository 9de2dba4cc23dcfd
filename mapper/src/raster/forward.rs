//! Compositing of one tile, front to back.
//!
//! # Layout
//!
//! A vector is one row of a block of eight columns; what the row has accumulated lies together in memory. One splat
//! after the other is blended into the rows it touches. Nothing branches on a lane.
//!
//! # Finished pixels
//!
//! A pixel stops before the splat that would take its transmittance below the limit. From then on its
//! transmittance is kept with a negative sign, which fails the test of every later splat.

use fearless_simd::{Level, dispatch, f32x8, prelude::*};

use super::constants::{MIN_ALPHA, MIN_TRANSMITTANCE};
use super::falloff::BlockFalloff;
use super::project::Splat;
use super::tile::{BLOCK_WIDTH, TILE_COLUMNS, TILE_HEIGHT, TILE_WIDTH, TileEntry};

/// Splats after which a tile is tested for being finished.
const TEST_INTERVAL: usize = 8;

/// One row of a block.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(super) struct PixelRow {
    /// Remaining transmittance; negative once the pixel is finished.
    pub(super) transmittance: [f32; BLOCK_WIDTH],
    pub(super) colour: [[f32; BLOCK_WIDTH]; 3],
    pub(super) depth: [f32; BLOCK_WIDTH],
    /// One more than the index in the list of the last splat composited; zero if there was none.
    pub(super) end: [f32; BLOCK_WIDTH],
}

/// All pixels of a tile, block by block.
#[derive(Clone, Debug)]
pub(super) struct TilePixels {
    pub(super) blocks: [[PixelRow; TILE_HEIGHT]; TILE_COLUMNS],
    /// Number of splats composited; only if asked for.
    pub(super) contributions: [[[f32; BLOCK_WIDTH]; TILE_HEIGHT]; TILE_COLUMNS],
    /// Entries of the list in front of which everything composited lies.
    pub(super) end: u32,
}

impl Default for TilePixels {
    fn default() -> Self {
        let row = PixelRow {
            transmittance: [1.0; BLOCK_WIDTH],
            colour: [[0.0; BLOCK_WIDTH]; 3],
            depth: [0.0; BLOCK_WIDTH],
            end: [0.0; BLOCK_WIDTH],
        };
        Self {
            blocks: [[row; TILE_HEIGHT]; TILE_COLUMNS],
            contributions: [[[0.0; BLOCK_WIDTH]; TILE_HEIGHT]; TILE_COLUMNS],
            end: 0,
        }
    }
}

impl TilePixels {
    /// Number of splats composited at a pixel of the image.
    pub(super) fn contributions_at(&self, x: usize, y: usize) -> u32 {
        let block = x % TILE_WIDTH / BLOCK_WIDTH;
        self.contributions[block][y % TILE_HEIGHT][x % BLOCK_WIDTH] as u32
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

/// Composites the splats of a tile into its pixels. With `COUNT`, counts the splats of every pixel.
pub(super) fn composite<const COUNT: bool>(level: Level, tile: TileSplats, pixels: &mut TilePixels) {
    *pixels = TilePixels::default();
    dispatch!(level, simd => composite_list::<_, COUNT>(simd, tile, pixels));
}

#[inline(always)]
fn composite_list<S: Simd, const COUNT: bool>(simd: S, tile: TileSplats, pixels: &mut TilePixels) {
    let TileSplats { splats, list, origin } = tile;
    let [left, top] = origin.map(|pixel| pixel as f32);
    for (index, entry) in list.iter().enumerate() {
        let splat = &splats[entry.rank as usize];
        let end = f32x8::splat(simd, (index + 1) as f32);
        for (block, range) in entry.rows.iter().enumerate() {
            let falloff = BlockFalloff::new(simd, splat, left + (block * BLOCK_WIDTH) as f32);
            let range = usize::from(range.start)..usize::from(range.end);
            let mut dy = top + range.start as f32 - splat.centre[1];
            let counts = &mut pixels.contributions[block];
            for (offset, row) in pixels.blocks[block][range.clone()].iter_mut().enumerate() {
                let used = blend(simd, splat, &falloff, dy, end, row);
                if COUNT {
                    let count = &mut counts[range.start + offset];
                    (f32x8::from_slice(simd, count) + used).store_slice(count);
                }
                dy += 1.0;
            }
        }
        if (index + 1) % TEST_INTERVAL == 0 && is_finished(simd, pixels) {
            break;
        }
    }
    pixels.end = last_end(simd, pixels);
}

/// Blends a splat into a row; returns 1 where it was composited, else 0.
#[inline(always)]
fn blend<S: Simd>(
    simd: S,
    splat: &Splat,
    falloff: &BlockFalloff<S>,
    dy: f32,
    end: f32x8<S>,
    row: &mut PixelRow,
) -> f32x8<S> {
    let load = |values: &[f32; BLOCK_WIDTH]| f32x8::from_slice(simd, values);
    let alpha = falloff.row(dy).alpha;
    let transmittance = load(&row.transmittance);
    let weight = alpha * transmittance;
    let behind = transmittance * (f32x8::splat(simd, 1.0) - alpha);
    let visible = alpha.simd_ge(MIN_ALPHA as f32);
    let used = visible & behind.simd_gt(MIN_TRANSMITTANCE as f32);
    let zero = f32x8::splat(simd, 0.0);
    let weight = used.select(weight, zero);
    for (colour, sum) in splat.colour.iter().zip(&mut row.colour) {
        weight.mul_add(*colour, load(sum)).store_slice(sum);
    }
    weight.mul_add(splat.depth, load(&row.depth)).store_slice(&mut row.depth);
    let next = used.select(behind, -transmittance.abs());
    visible.select(next, transmittance).store_slice(&mut row.transmittance);
    used.select(end, load(&row.end)).store_slice(&mut row.end);
    used.select(f32x8::splat(simd, 1.0), zero)
}

/// Whether no pixel takes any more splats.
#[inline(always)]
fn is_finished<S: Simd>(simd: S, pixels: &TilePixels) -> bool {
    let mut largest = f32x8::splat(simd, -1.0);
    for row in pixels.blocks.as_flattened() {
        largest = largest.max(f32x8::from_slice(simd, &row.transmittance));
    }
    largest.simd_le(0.0).all_true()
}

#[inline(always)]
fn last_end<S: Simd>(simd: S, pixels: &TilePixels) -> u32 {
    let mut largest = f32x8::splat(simd, 0.0);
    for row in pixels.blocks.as_flattened() {
        largest = largest.max(f32x8::from_slice(simd, &row.end));
    }
    largest.reduce_max() as u32
}
