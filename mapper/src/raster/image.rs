//! Rendered images, and gradients by them.

use super::backward::{GradientRow, TileGradient};
use super::forward::TilePixels;
use super::tile::{BLOCK_WIDTH, TILE_HEIGHT, TILE_WIDTH, TileGrid};

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

    /// Copies the tiles of one row of tiles.
    pub(super) fn store(&mut self, tiles: &[TilePixels], background: &[f32; 3]) {
        for (across, tile) in tiles.iter().enumerate() {
            for (block, rows) in tile.blocks.iter().enumerate() {
                let left = across * TILE_WIDTH + block * BLOCK_WIDTH;
                let columns = BLOCK_WIDTH.min(self.width.saturating_sub(left));
                for (y, row) in rows.iter().enumerate() {
                    let first = y * self.width + left;
                    if columns == 0 || first + columns > self.planes[0].len() {
                        break;
                    }
                    let [red, green, blue, depth, alpha] =
                        self.planes.each_mut().map(|plane| &mut plane[first..first + columns]);
                    for x in 0..columns {
                        let transmittance = row.transmittance[x].abs();
                        red[x] = row.colour[0][x] + transmittance * background[0];
                        green[x] = row.colour[1][x] + transmittance * background[1];
                        blue[x] = row.colour[2][x] + transmittance * background[2];
                        depth[x] = row.depth[x];
                        alpha[x] = 1.0 - transmittance;
                    }
                }
            }
        }
    }
}

/// The gradient by the pixels of a tile; zero beyond the image.
pub(super) fn load_gradient(image: &RasterImage, grid: &TileGrid, tile: usize, out: &mut TileGradient) {
    *out = TileGradient::default();
    let [left, top] = grid.origin(tile);
    for (block, rows) in out.iter_mut().enumerate() {
        let left = left + block * BLOCK_WIDTH;
        let columns = BLOCK_WIDTH.min(grid.width.saturating_sub(left));
        if columns == 0 {
            break;
        }
        for (row, y) in rows.iter_mut().zip(top..grid.height) {
            let GradientRow { by_colour, by_depth, by_alpha, .. } = row;
            let first = y * grid.width + left;
            let planes = image.colour.iter().chain([&image.depth, &image.alpha]);
            for (row, plane) in by_colour.iter_mut().chain([by_depth, by_alpha]).zip(planes) {
                row[..columns].copy_from_slice(&plane[first..first + columns]);
            }
        }
    }
}
