//! Rendered images, and gradients by them.

use super::backward::{GradientCell, TileGradient};
use super::forward::{PixelCell, TilePixels};
use super::tile::{BLOCK_WIDTH, CELL, CELL_HEIGHT, CELLS, TILE_COLUMNS, TILE_HEIGHT, TILE_WIDTH, TileGrid};
use super::view_share::ViewShare;

/// A rendered view, or the gradient of a loss by one: five planes of numbers, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RasterImage {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Red, green and blue in linear light, the background included.
    pub colour: [Vec<f32>; 3],
    /// Sum of weight times camera z, metres; divided by alpha it is the mean depth.
    pub depth: Vec<f32>,
    /// One minus the transmittance behind everything, in `[0, 1]`.
    pub alpha: Vec<f32>,
}

impl RasterImage {
    /// An image of zeros.
    #[must_use]
    pub fn zeros(width: usize, height: usize) -> Self {
        let plane = || vec![0.0; width * height];
        Self { width, height, colour: [plane(), plane(), plane()], depth: plane(), alpha: plane() }
    }

    /// Makes it that large; the pixels are those of an arbitrary image.
    pub fn resize(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        let planes = self.colour.iter_mut().chain([&mut self.depth, &mut self.alpha]);
        planes.for_each(|plane| plane.resize(width * height, 0.0));
    }

    /// Red, green, blue, depth and alpha.
    fn planes(&self) -> [&[f32]; 5] {
        let [red, green, blue] = self.colour.each_ref().map(Vec::as_slice);
        [red, green, blue, &self.depth, &self.alpha]
    }

    /// The rows of tiles from the top, each with its five planes.
    pub(super) fn tile_rows(&mut self) -> TileRows<'_> {
        let [red, green, blue] = self.colour.each_mut().map(Vec::as_mut_slice);
        TileRows { width: self.width, planes: [red, green, blue, &mut self.depth, &mut self.alpha] }
    }
}

/// Whole rows of tiles of the five planes of an image.
pub(super) struct TileRows<'a> {
    width: usize,
    planes: [&'a mut [f32]; 5],
}

impl TileRows<'_> {
    /// The upper `rows` rows of tiles and the rest.
    pub(super) fn split_at(self, rows: usize) -> (Self, Self) {
        let width = self.width;
        let middle = (rows * TILE_HEIGHT * width).min(self.planes[0].len());
        let mut lower: [&mut [f32]; 5] = Default::default();
        let mut k = 0;
        let upper = self.planes.map(|plane| {
            let (head, tail) = plane.split_at_mut(middle);
            lower[k] = tail;
            k += 1;
            head
        });
        (Self { width, planes: upper }, Self { width, planes: lower })
    }

    /// Stores one row of tiles, given by the planes of their cells.
    fn store(&mut self, grid: &TileGrid, mean: impl Fn(usize, usize, usize) -> [[f32; CELL]; 5]) {
        let rows = self.planes[0].len() / grid.width.max(1);
        for across in 0..grid.across {
            for block in 0..TILE_COLUMNS {
                let left = across * TILE_WIDTH + block * BLOCK_WIDTH;
                if left >= grid.width {
                    break;
                }
                for cell in 0..CELLS {
                    let mean = mean(across, block, cell);
                    let first = cell * CELL_HEIGHT;
                    for (row, y) in (first..rows.min(first + CELL_HEIGHT)).enumerate() {
                        let to = y * grid.width + left..(y + 1) * grid.width;
                        for (plane, values) in self.planes.iter_mut().zip(&mean) {
                            let values = &values[row * BLOCK_WIDTH..(row + 1) * BLOCK_WIDTH];
                            store_columns(values, &mut plane[to.clone()]);
                        }
                    }
                }
            }
        }
    }
}

/// Copies as many of the columns of a block as the rest of the row has.
#[inline(always)]
fn store_columns(values: &[f32], rest: &mut [f32]) {
    if let Some(whole) = rest.first_chunk_mut::<BLOCK_WIDTH>() {
        whole.copy_from_slice(values);
    } else {
        rest.copy_from_slice(&values[..rest.len()]);
    }
}

/// What a view has composited.
#[derive(Clone, Copy)]
pub(super) struct ViewTiles<'a> {
    pub(super) tiles: &'a [TilePixels],
    pub(super) background: &'a [f32; 3],
}

/// Stores the mean of `count` views in row `down` of the tiles, with depth and alpha of the view in the middle.
pub(super) fn store_mean<'a>(
    view: &impl Fn(usize) -> ViewTiles<'a>,
    count: usize,
    grid: &TileGrid,
    down: usize,
    rows: &mut TileRows,
) {
    rows.store(grid, |across, block, cell| {
        let tile = down * grid.across + across;
        let mid = &view(count / 2).tiles[tile].blocks[block][cell];
        let [red, green, blue] = mean_colour(view, count, |tiles| &tiles[tile].blocks[block][cell]);
        [red, green, blue, mid.depth, mid.transmittance.map(|left| 1.0 - left.abs())]
    });
}

/// The mean colour of a cell over the views.
#[inline]
fn mean_colour<'a>(
    view: &impl Fn(usize) -> ViewTiles<'a>,
    count: usize,
    cell: impl Fn(&'a [TilePixels]) -> &'a PixelCell,
) -> [[f32; CELL]; 3] {
    let mut sums = [[0.0; CELL]; 3];
    for ViewTiles { tiles, background } in (0..count).map(view) {
        let cell = cell(tiles);
        for ((sums, colour), background) in sums.iter_mut().zip(&cell.colour).zip(background) {
            for (pixel, sum) in sums.iter_mut().enumerate() {
                *sum += colour[pixel] + cell.transmittance[pixel].abs() * background;
            }
        }
    }
    let share = 1.0 / count as f32;
    sums.map(|channel| channel.map(|sum| sum * share))
}

/// What a view gives to a row of tiles of an image.
pub(super) struct RowPart<'a> {
    /// The tiles of the row.
    pub(super) tiles: &'a [TilePixels],
    pub(super) background: &'a [f32; 3],
    /// Weight of its colours in every row of pixels.
    pub(super) weights: [f32; TILE_HEIGHT],
    /// Whether depth and alpha are those of this view.
    pub(super) geometry: bool,
}

/// Stores the weighted sum of the colours of views in a row of tiles, with depth and alpha of the one that has them.
pub(super) fn store_weighted(parts: &[RowPart<'_>], grid: &TileGrid, rows: &mut TileRows) {
    rows.store(grid, |across, block, cell| {
        let mut planes = [[0.0; CELL]; 5];
        for RowPart { tiles, background, weights, geometry } in parts {
            // What is left of the light of a pixel is the background's; the sign of transmittance is a mark.
            let pixels = &tiles[across].blocks[block][cell];
            for row in 0..CELL_HEIGHT {
                let weight = weights[cell * CELL_HEIGHT + row];
                if weight == 0.0 {
                    continue;
                }
                let in_row = row * BLOCK_WIDTH..(row + 1) * BLOCK_WIDTH;
                let behind = &pixels.transmittance[in_row.clone()];
                for (channel, background) in background.iter().enumerate() {
                    let colours = pixels.colour[channel][in_row.clone()].iter().zip(behind);
                    let sums = planes[channel][in_row.clone()].iter_mut();
                    sums.zip(colours).for_each(|(sum, (colour, behind))| {
                        *sum += weight * (colour + behind.abs() * background);
                    });
                }
            }
            // Depth and alpha have one time: they are no mean.
            if *geometry {
                planes[3] = pixels.depth;
                planes[4] = pixels.transmittance.map(|left| 1.0 - left.abs());
            }
        }
        planes
    });
}

/// The gradient by the pixels of a tile of a view with a share in the image; zero beyond the image.
pub(super) fn load_gradient(
    image: &RasterImage,
    share: ViewShare<'_>,
    grid: &TileGrid,
    tile: usize,
    out: &mut TileGradient,
) {
    let planes = if share.geometry { 5 } else { 3 };

    let [left, top] = grid.origin(tile);
    if left + TILE_WIDTH > grid.width || top + TILE_HEIGHT > grid.height {
        out.as_flattened_mut().iter_mut().for_each(GradientCell::clear);
    }
    for (block, cells) in out.iter_mut().enumerate() {
        let left = left + block * BLOCK_WIDTH;
        if left >= grid.width {
            break;
        }
        for y in 0..TILE_HEIGHT.min(grid.height - top) {
            let from = (top + y) * grid.width + left..(top + y + 1) * grid.width;
            let colour = share.colour.of_row(top + y);
            let at = y % CELL_HEIGHT * BLOCK_WIDTH;
            let rows = cells[y / CELL_HEIGHT].given_mut().map(|values| &mut values[at..at + BLOCK_WIDTH]);
            for (k, (row, plane)) in rows.into_iter().zip(image.planes()).take(planes).enumerate() {
                let weight = if k < 3 { colour } else { 1.0 };
                load_columns(weight, &plane[from.clone()], row);
            }
        }
    }
}

/// Multiplies as many columns of a block as the rest of the row has.
#[inline(always)]
fn load_columns(weight: f32, rest: &[f32], values: &mut [f32]) {
    if let Some(whole) = rest.first_chunk::<BLOCK_WIDTH>() {
        values.iter_mut().zip(whole).for_each(|(value, given)| *value = weight * given);
    } else {
        values.iter_mut().zip(rest).for_each(|(value, given)| *value = weight * given);
    }
}
