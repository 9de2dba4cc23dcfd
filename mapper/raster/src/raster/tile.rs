//! Tiles: the unit of lists and of work.

use core::ops::Range;

/// Width of a block, the unit in which the lists of splats know columns, in pixels.
pub(super) const BLOCK_WIDTH: usize = 8;

/// Rows of a cell. What is accumulated at the pixels of a cell lies together in memory, so that a cell is one vector
/// of the widest instruction set, and a whole number of those of the others.
pub(super) const CELL_HEIGHT: usize = 2;

/// Pixels of a cell, row by row.
pub(super) const CELL: usize = CELL_HEIGHT * BLOCK_WIDTH;

/// Cells of a block, one below the other.
pub(super) const CELLS: usize = TILE_HEIGHT / CELL_HEIGHT;

/// Blocks side by side in a tile.
pub(super) const TILE_COLUMNS: usize = 2;

/// Width of a tile in pixels.
pub(super) const TILE_WIDTH: usize = TILE_COLUMNS * BLOCK_WIDTH;

/// Height of a tile in pixels.
pub(crate) const TILE_HEIGHT: usize = 16;

/// The tiles of an image or of a band of its rows, row by row; those at the right and bottom border may stick out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct TileGrid {
    pub(super) width: usize,
    /// End of the rows of pixels, counted from the top of the image.
    pub(super) height: usize,
    /// Tiles per row and rows of tiles.
    pub(super) across: usize,
    pub(super) down: usize,
    /// Rows of tiles of the image above the first.
    pub(super) above: usize,
}

impl TileGrid {
    pub(super) fn new(width: usize, height: usize) -> Self {
        let down = height.div_ceil(TILE_HEIGHT);
        Self { width, height, across: width.div_ceil(TILE_WIDTH), down, above: 0 }
    }

    /// Those of the rows of tiles in `band`.
    pub(super) fn band(&self, band: &Range<usize>) -> Self {
        let end = band.end.min(self.down);
        let above = band.start.min(end);
        Self { height: self.height.min(end * TILE_HEIGHT), down: end - above, above, ..*self }
    }

    /// The first row of pixels.
    pub(super) fn top(&self) -> usize {
        self.above * TILE_HEIGHT
    }

    /// Number of tiles.
    pub(super) fn len(&self) -> usize {
        self.across * self.down
    }

    /// The tile of a pixel.
    pub(super) fn tile_of(&self, x: usize, y: usize) -> usize {
        (y / TILE_HEIGHT - self.above) * self.across + x / TILE_WIDTH
    }

    /// Column and row of the first pixel of a tile.
    pub(super) fn origin(&self, tile: usize) -> [usize; 2] {
        [tile % self.across * TILE_WIDTH, (tile / self.across + self.above) * TILE_HEIGHT]
    }
}

/// Rows of a block that a splat touches, counted from the top of the tile.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct RowRange {
    pub(super) start: u8,
    pub(super) end: u8,
}

/// A splat in the list of a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct TileEntry {
    pub(super) rank: u32,
    /// Rows of every block of the tile that the splat touches.
    pub(super) rows: [RowRange; TILE_COLUMNS],
}

impl RowRange {
    /// The cells in which the rows lie.
    pub(super) fn cells(self) -> Range<usize> {
        usize::from(self.start) / CELL_HEIGHT..usize::from(self.end).div_ceil(CELL_HEIGHT)
    }
}

impl TileEntry {
    pub(super) fn is_empty(&self) -> bool {
        self.rows.iter().all(|rows| rows.start >= rows.end)
    }
}
