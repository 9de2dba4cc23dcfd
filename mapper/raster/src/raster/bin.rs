//! Lists of splats per tile, in depth order.
//!
//! A splat is listed only where its ellipse of visibility, which depends on its opacity, reaches a pixel centre:
//! along the chord of every column of blocks the rows follow from the ellipse itself, not from a bounding box. The
//! rows go with the list, so the pixel loops skip the rest. Fixed chunks of splats are tested in parallel, then a
//! stable counting sort puts their entries in place; the result does not depend on threads.

use super::order::Order;
use super::project::{Extent, Splat};
use super::tile::{BLOCK_WIDTH, RowRange, TILE_COLUMNS, TILE_HEIGHT, TILE_WIDTH, TileEntry, TileGrid};

/// Splats that are tested in one piece of work.
pub(super) const CHUNK: usize = 1024;

/// Added to the borders of visibility, in pixels and relative to the coordinates at hand, so that rounding never
/// clips a visible pixel.
const MARGIN: [f32; 2] = [1e-3, 1e-6];

/// Entries of a chunk of splats, splat by splat.
#[derive(Debug, Default)]
pub(super) struct ChunkEntries {
    entries: Vec<(u32, TileEntry)>,
    /// Number of entries of every splat of the chunk.
    counts: Vec<u32>,
}

/// The lists of all tiles.
#[derive(Debug, Default)]
pub(super) struct Bins {
    pub(super) grid: TileGrid,
    /// Chunks of splats; those beyond the splats of the view keep their memory.
    chunks: Vec<ChunkEntries>,
    used_chunks: usize,
    /// Where the list of every tile starts, and the end of the last.
    pub(super) tile_start: Vec<u32>,
    /// The lists, tile by tile.
    pub(super) entries: Vec<TileEntry>,
    /// Where the entries of every rank start in `slot_from_emission`, and the end of the last.
    pub(super) first_emission: Vec<u32>,
    /// Index into `entries` of the entries of every rank, rank by rank.
    pub(super) slot_from_emission: Vec<u32>,
}

/// Where blocks are cut by the ellipse of a splat.
struct Outline {
    centre: [f32; 2],
    extent: Extent,
    inverse_radius: f32,
    margin: f32,
}

impl Bins {
    /// Prepares for an image and a number of splats; the chunks are then to be filled.
    pub(super) fn reset(&mut self, grid: TileGrid, splats: usize) {
        self.grid = grid;
        self.used_chunks = splats.div_ceil(CHUNK);
        if self.chunks.len() < self.used_chunks {
            self.chunks.resize_with(self.used_chunks, ChunkEntries::default);
        }
    }

    /// The chunks that are to be filled.
    pub(super) fn chunks_mut(&mut self) -> &mut [ChunkEntries] {
        &mut self.chunks[..self.used_chunks]
    }

    /// The list of a tile.
    pub(super) fn list(&self, tile: usize) -> &[TileEntry] {
        &self.entries[self.tile_start[tile] as usize..self.tile_start[tile + 1] as usize]
    }

    /// Slots of the entries of a rank.
    pub(super) fn slots(&self, rank: usize) -> &[u32] {
        let range = self.first_emission[rank] as usize..self.first_emission[rank + 1] as usize;
        &self.slot_from_emission[range]
    }

    /// Sorts the entries of the chunks into the lists.
    pub(super) fn gather(&mut self) {
        self.count();
        let chunks = &self.chunks[..self.used_chunks];
        let total = chunks.iter().map(|chunk| chunk.entries.len()).sum();
        self.entries.resize(total, TileEntry::default());
        self.slot_from_emission.clear();
        for (tile, entry) in chunks.iter().flat_map(|chunk| &chunk.entries) {
            let slot = &mut self.tile_start[*tile as usize];
            self.entries[*slot as usize] = *entry;
            self.slot_from_emission.push(*slot);
            *slot += 1;
        }
        // Every start has moved on to the start of the next tile.
        self.tile_start.pop();
        self.tile_start.insert(0, 0);
    }

    /// Start of every tile and first emission of every rank.
    fn count(&mut self) {
        self.tile_start.clear();
        self.tile_start.resize(self.grid.len() + 1, 0);
        self.first_emission.clear();
        let mut emissions = 0;
        for chunk in &self.chunks[..self.used_chunks] {
            for &count in &chunk.counts {
                self.first_emission.push(emissions);
                emissions += count;
            }
            chunk.entries.iter().for_each(|(tile, _)| self.tile_start[*tile as usize] += 1);
        }
        self.first_emission.push(emissions);
        let mut start = 0;
        for count in &mut self.tile_start {
            start += core::mem::replace(count, start);
        }
    }
}

impl ChunkEntries {
    /// Finds the tiles of chunk number `chunk` of the splats.
    pub(super) fn fill(&mut self, grid: &TileGrid, order: &Order, chunk: usize) {
        self.entries.clear();
        self.counts.clear();
        let ranks = chunk * CHUNK..((chunk + 1) * CHUNK).min(order.len());
        for rank in ranks {
            // Emissions of one rank follow each other; their number is kept for the sums of the backward pass.
            let before = self.entries.len();
            let outline = Outline::new(&order.splats[rank], &order.extents[rank]);
            outline.for_each_tile(grid, |tile, rows| {
                let entry = TileEntry { rank: rank as u32, rows };
                if !entry.is_empty() {
                    self.entries.push((tile as u32, entry));
                }
            });
            self.counts.push((self.entries.len() - before) as u32);
        }
    }
}

impl Outline {
    fn new(splat: &Splat, extent: &Extent) -> Self {
        let ([u, v], [width, height]) = (splat.centre, extent.radius);
        let largest = u.abs().max(v.abs()) + width.max(height);
        Self {
            centre: splat.centre,
            extent: *extent,
            inverse_radius: 1.0 / width,
            margin: MARGIN[0] + MARGIN[1] * largest,
        }
    }

    /// Visits every tile of the bounding box with the rows of its blocks, some or all of which may be empty.
    fn for_each_tile(&self, grid: &TileGrid, mut visit: impl FnMut(usize, [RowRange; TILE_COLUMNS])) {
        let [columns, mut rows] = [0, 1].map(|i| {
            let (centre, radius) = (self.centre[i], self.extent.radius[i] + self.margin);
            pixel_range(centre - radius, centre + radius, [grid.width, grid.height][i])
        });
        rows.0 = rows.0.max(grid.top());
        if columns.0 >= columns.1 || rows.0 >= rows.1 {
            return;
        }
        for across in columns.0 / TILE_WIDTH..columns.1.div_ceil(TILE_WIDTH) {
            let first = across * TILE_COLUMNS;
            let blocks: [(usize, usize); TILE_COLUMNS] =
                core::array::from_fn(|block| self.rows_of_block(grid, first + block));
            for down in rows.0 / TILE_HEIGHT..rows.1.div_ceil(TILE_HEIGHT) {
                visit(
                    (down - grid.above) * grid.across + across,
                    blocks.map(|rows| rows_within(rows, down * TILE_HEIGHT)),
                );
            }
        }
    }

    /// First row and end of the rows in which the ellipse reaches a column of blocks.
    fn rows_of_block(&self, grid: &TileGrid, block: usize) -> (usize, usize) {
        let [radius, _] = self.extent.radius;
        let left = (block * BLOCK_WIDTH) as f32 - self.centre[0];
        // The part of the ellipse within the columns of the block.
        let low = (left - self.margin).max(-radius);
        let high = (left + (BLOCK_WIDTH - 1) as f32 + self.margin).min(radius);
        if low > high || high.is_nan() {
            return (0, 0);
        }
        let chord = |dx: f32, side: f32| {
            let x = dx * self.inverse_radius;
            let half = self.extent.half_height * (1.0 - x * x).max(0.0).sqrt();
            self.centre[1] + self.extent.lean * dx + side * half
        };
        // The chord is highest at the top of the ellipse, or at the edge of the block next to it.
        let upper = chord((-self.extent.top).max(low).min(high), -1.0);
        let lower = chord(self.extent.top.max(low).min(high), 1.0);
        pixel_range(upper - self.margin, lower + self.margin, grid.height)
    }
}

/// First pixel centre and end of those from `low` to `high`, of a row or column of `size` pixels.
fn pixel_range(low: f32, high: f32, size: usize) -> (usize, usize) {
    // Casts truncate and saturate: negative numbers become 0, large ones exceed any size. Rounding functions would be
    // calls: the baseline instruction set has none.
    let first = (low as u32).saturating_add(u32::from(low > low as u32 as f32));
    let end = if high >= 0.0 { (high as usize).saturating_add(1).min(size) } else { 0 };
    ((first as usize).min(end), end)
}

/// The part of the rows within the tile whose first row is `top`.
fn rows_within(rows: (usize, usize), top: usize) -> RowRange {
    let within = |row: usize| row.saturating_sub(top).min(TILE_HEIGHT) as u8;
    RowRange { start: within(rows.0), end: within(rows.1) }
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::{PinholeCamera, RigidTransform};
    use mba_tracker::simd::Level;

    use super::*;
    use crate::gaussians::{Gaussian, Gaussians};
    use crate::raster::RasterView;
    use crate::raster::lanes::ViewNumbers;
    use crate::raster::project::{Projected, project};

    const SIZE: [usize; 2] = [70, 45];

    /// Splats of all shapes and opacities, in depth order, and their lists.
    fn lists() -> (Order, Bins) {
        let fraction =
            |i: usize, k: usize| ((i * (k + 3) * 7919 + i * i * (31 + k)) % 10_007) as f32 / 10_007.0;
        let gaussians: Gaussians = (0..3000)
            .map(|i| Gaussian {
                mean: [4.0 * fraction(i, 0) - 2.0, 3.0 * fraction(i, 1) - 1.5, 1.0 + fraction(i, 2)],
                log_scale: [3, 4, 5].map(|k| 5.0 * fraction(i, k) - 7.0),
                rotation: [6, 7, 8, 9].map(|k| fraction(i, k) - 0.5),
                opacity_logit: 12.0 * fraction(i, 10) - 6.0,
                colour: [0.5; 3],
            })
            .collect();
        let camera =
            PinholeCamera { width: SIZE[0], height: SIZE[1], fx: 50.0, fy: 50.0, cx: 35.0, cy: 22.0 };
        let view = RasterView { camera, world_from_camera: RigidTransform::identity(), background: [0.0; 3] };
        let mut projected = vec![Projected::default(); gaussians.len()];
        let planes = gaussians.planes().each_ref().map(Vec::as_slice);
        project(Level::new(), &ViewNumbers::new(&view), &planes, 0, &mut projected);
        let (mut order, mut bins) = (Order::default(), Bins::default());
        order.sort(&projected);
        order.pieces_mut().for_each(|mut piece| piece.gather(&projected));
        let grid = TileGrid::new(SIZE[0], SIZE[1]);
        bins.reset(grid, order.len());
        bins.chunks_mut()
            .iter_mut()
            .enumerate()
            .for_each(|(chunk, entries)| entries.fill(&grid, &order, chunk));
        bins.gather();
        (order, bins)
    }

    /// Opacity of a splat at a pixel.
    fn alpha(splat: &Splat, x: usize, y: usize) -> f64 {
        let [dx, dy] = [x as f64 - f64::from(splat.centre[0]), y as f64 - f64::from(splat.centre[1])];
        let [a, b, c] = splat.whitening.map(f64::from);
        let (u, v) = (a * dx + b * dy, c * dy);
        f64::from(splat.opacity) * (-(u * u + v * v)).exp2()
    }

    /// Whether the list of the block around a pixel has the splat in the pixel's row.
    fn is_listed(bins: &Bins, rank: u32, x: usize, y: usize) -> bool {
        let tile = bins.grid.tile_of(x, y);
        let [left, top] = bins.grid.origin(tile);
        let entry = bins.list(tile).binary_search_by_key(&rank, |entry| entry.rank);
        entry.is_ok_and(|index| {
            let rows = bins.list(tile)[index].rows[(x - left) / BLOCK_WIDTH];
            (usize::from(rows.start)..usize::from(rows.end)).contains(&(y - top))
        })
    }

    #[test]
    fn the_rows_of_a_block_are_listed_if_and_hardly_unless_a_pixel_of_them_is_visible() {
        let (order, bins) = lists();
        let (mut visible, mut listed) = (0_usize, 0_usize);
        for (splat, rank) in order.splats.iter().zip(0..) {
            for (y, left) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).step_by(BLOCK_WIDTH).map(move |x| (y, x)))
            {
                let mut columns = left..(left + BLOCK_WIDTH).min(SIZE[0]);
                let is_visible = columns.any(|x| alpha(splat, x, y) >= 1.0 / 255.0);
                let is_listed = is_listed(&bins, rank, left, y);
                assert!(is_listed || !is_visible, "row {y} of splat {rank} misses a pixel from {left} on");
                visible += usize::from(is_visible);
                listed += usize::from(is_listed);
            }
        }
        assert!(visible > 5000 && listed * 20 < visible * 21, "{listed} listed, {visible} visible");
    }

    #[test]
    fn lists_are_in_depth_order_and_slots_lead_back() {
        let (order, bins) = lists();
        assert!(order.splats.windows(2).all(|pair| pair[0].depth <= pair[1].depth));
        for tile in 0..bins.grid.len() {
            assert!(bins.list(tile).windows(2).all(|pair| pair[0].rank < pair[1].rank), "tile {tile}");
        }
        let mut slots: Vec<u32> = Vec::new();
        for rank in 0..order.len() {
            assert!(bins.slots(rank).iter().all(|&slot| bins.entries[slot as usize].rank == rank as u32));
            slots.extend(bins.slots(rank));
        }
        slots.sort_unstable();
        assert!(slots.iter().copied().eq(0..bins.entries.len() as u32), "slots are not used once each");
        assert!(bins.entries.iter().all(|entry| !entry.is_empty()), "an entry touches no row");
    }
}
