//! Images put together from views of bands of their rows.

use core::ops::Range;

use super::driver::{RasterScratch, Rasterizer};
use super::image::{RasterImage, RowPart, TileRows, store_weighted};
use super::tile::{TILE_HEIGHT, TileGrid};

/// What a view of some rows of tiles gives to an image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BandView<'a> {
    /// What its forward pass left.
    pub scratch: &'a RasterScratch,
    /// Its weight in the colour of every row of the image; empty if it has none.
    pub weights: &'a [f32],
    /// Whether depth and alpha of its rows are those of the image.
    pub geometry: bool,
}

impl Rasterizer {
    /// The weighted sum of the colours of views of an image of `size` columns and rows, with depth and alpha of the
    /// view that has them for each row of tiles.
    pub(crate) fn store_bands(&self, size: [usize; 2], views: &[BandView<'_>], image: &mut RasterImage) {
        let [width, height] = size;
        image.resize(width, height);
        let grid = TileGrid::new(width, height);
        store_band_rows(views, &grid, 0..grid.down, image.tile_rows());
    }
}

/// Stores the weighted sum of views in rows of tiles.
fn store_band_rows(views: &[BandView<'_>], grid: &TileGrid, down: Range<usize>, mut rows: TileRows) {
    if down.len() > 1 {
        let middle = down.start + down.len() / 2;
        let (upper, lower) = rows.split_at(middle - down.start);
        rayon::join(
            || store_band_rows(views, grid, down.start..middle, upper),
            || store_band_rows(views, grid, middle..down.end, lower),
        );
    } else if !down.is_empty() {
        let parts: Vec<RowPart<'_>> = views.iter().filter_map(|view| view.part(grid, down.start)).collect();
        store_weighted(&parts, grid, &mut rows);
    }
}

impl<'a> BandView<'a> {
    /// What the view gives to row `down` of the tiles of the image, if it has that row.
    fn part(&self, grid: &TileGrid, down: usize) -> Option<RowPart<'a>> {
        let RasterScratch { bins, tiles, background, .. } = self.scratch;
        let row = down.checked_sub(bins.grid.above).filter(|row| *row < bins.grid.down)?;
        let top = down * TILE_HEIGHT;
        let weights = core::array::from_fn(|row| self.weights.get(top + row).copied().unwrap_or(0.0));
        let tiles = &tiles[row * grid.across..(row + 1) * grid.across];
        Some(RowPart { tiles, background, weights, geometry: self.geometry })
    }
}
