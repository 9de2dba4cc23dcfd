//! The stages in order, each over all threads of the current pool.

use mba_tracker::simd::Level;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::backward::{SplatSums, TileGradient, backward};
use super::bin::Bins;
use super::forward::{TilePixels, TileSplats, composite};
use super::image::{RasterImage, TileRows, load_gradient};
use super::lanes::ViewNumbers;
use super::order::{NO_RANK, Order};
use super::pose::ViewGradient;
use super::project::{Projected, project};
use super::project_backward::{GradientRange, SplatGradients, ViewSums, project_backward};
use super::tile::TileGrid;
use super::view::RasterView;
use crate::gaussians::{Gaussians, PARAMETERS};

/// Gaussians per piece of work of the projection and its backward pass.
const GAUSSIANS_PER_PIECE: usize = 512;

/// Renders Gaussians and takes gradients back to them.
#[derive(Clone, Copy, Debug)]
pub struct Rasterizer {
    level: Level,
}

/// What the stages hand on, and all memory they need; reused from view to view, so that nothing is allocated once
/// the largest view has been seen.
#[derive(Debug, Default)]
pub struct RasterScratch {
    view: ViewNumbers,
    background: [f32; 3],
    projected: Vec<Projected>,
    order: Order,
    bins: Bins,
    tiles: Vec<TilePixels>,
    sums: Vec<SplatSums>,
    view_sums: Vec<ViewSums>,
}

/// Gradients of a loss by Gaussians, summed over views.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GaussianGradients {
    /// By the parameters.
    pub parameters: Gaussians,
    /// Length of the gradient by the projected centre, per pixel, summed over views: large where a Gaussian is
    /// torn between neighbours.
    pub screen: Vec<f32>,
}

impl GaussianGradients {
    /// No gradient for `count` Gaussians.
    #[must_use]
    pub fn zeros(count: usize) -> Self {
        Self { parameters: Gaussians::zeros(count), screen: vec![0.0; count] }
    }

    /// Forgets everything and makes room for `count` Gaussians.
    pub fn reset(&mut self, count: usize) {
        self.parameters.resize(count);
        self.parameters.fill_zero();
        self.screen.clear();
        self.screen.resize(count, 0.0);
    }
}

impl RasterScratch {
    /// Whether Gaussian `index` was drawn in the last view.
    #[must_use]
    pub fn is_drawn(&self, index: usize) -> bool {
        self.order.rank_from_gaussian.get(index).is_some_and(|&rank| rank != NO_RANK)
    }

    /// Number of Gaussians drawn in the last view.
    #[must_use]
    pub fn drawn(&self) -> usize {
        self.order.len()
    }

    /// Number of (tile, splat) pairs of the last view.
    #[must_use]
    pub fn pairs(&self) -> usize {
        self.bins.entries.len()
    }
}

impl Rasterizer {
    /// A rasterizer with the instruction set `level`; levels differ by rounding only.
    #[must_use]
    pub fn new(level: Level) -> Self {
        Self { level }
    }

    /// Renders a view into `image`, which gets its size.
    ///
    /// Gaussians are left out if they are behind the camera or nearer than 1 cm, fainter than a step of 8 bits,
    /// outside of the image, or have a parameter that is not finite or without meaning.
    pub fn forward(
        &self,
        gaussians: &Gaussians,
        view: &RasterView,
        scratch: &mut RasterScratch,
        image: &mut RasterImage,
    ) {
        self.project(gaussians, view, scratch);
        self.order(scratch);
        self.bin(view, scratch);
        self.composite(scratch);
        self.store_image(scratch, image);
    }

    /// Adds the gradients of a loss to `gradients`, which has the length of `gaussians`, and returns the gradient
    /// by the pose. `by_image` is the gradient by the image of the last call of [`Self::forward`], which had the
    /// same Gaussians and the same scratch memory.
    ///
    /// Gaussians and images of other sizes than in that call give no gradient.
    pub fn backward(
        &self,
        gaussians: &Gaussians,
        by_image: &RasterImage,
        scratch: &mut RasterScratch,
        gradients: &mut GaussianGradients,
    ) -> ViewGradient {
        let grid = scratch.bins.grid;
        let same_image = (by_image.width, by_image.height) == (grid.width, grid.height);
        let same_gaussians = gaussians.len() == scratch.projected.len();
        if !same_image || !same_gaussians || gradients.screen.len() != gaussians.len() {
            return ViewGradient::default();
        }
        self.replay(by_image, scratch);
        self.project_backward(gaussians, scratch, gradients)
    }

    /// Number of Gaussians composited at every pixel of the last view, row by row.
    #[must_use]
    pub fn contributions(&self, scratch: &mut RasterScratch) -> Vec<u32> {
        self.composite_tiles::<true>(scratch);
        let grid = scratch.bins.grid;
        let count = |pixel: usize| {
            let (x, y) = (pixel % grid.width, pixel / grid.width);
            scratch.tiles[grid.tile_of(x, y)].contributions_at(x, y)
        };
        (0..grid.width * grid.height).map(count).collect()
    }

    /// First stage of [`Self::forward`]: projects every Gaussian.
    pub fn project(&self, gaussians: &Gaussians, view: &RasterView, scratch: &mut RasterScratch) {
        scratch.view = ViewNumbers::new(view);
        scratch.background = view.background.map(|channel| channel as f32);
        scratch.projected.resize(gaussians.len(), Projected::default());
        let planes = slices(gaussians);
        let pieces = scratch.projected.par_chunks_mut(GAUSSIANS_PER_PIECE).enumerate();
        pieces.for_each(|(piece, out)| {
            project(self.level, &scratch.view, &planes, piece * GAUSSIANS_PER_PIECE, out);
        });
    }

    /// Second stage of [`Self::forward`]: sorts what is drawn by depth.
    pub fn order(&self, scratch: &mut RasterScratch) {
        scratch.order.update(&scratch.projected);
    }

    /// Third stage of [`Self::forward`]: lists the splats of every tile.
    pub fn bin(&self, view: &RasterView, scratch: &mut RasterScratch) {
        let RasterScratch { bins, order, .. } = scratch;
        let grid = TileGrid::new(view.camera.width, view.camera.height);
        bins.reset(grid, order.len());
        let chunks = bins.chunks_mut().par_iter_mut().enumerate();
        chunks.for_each(|(chunk, entries)| entries.fill(&grid, order, chunk));
        bins.gather();
    }

    /// Fourth stage of [`Self::forward`]: composites the splats of every tile.
    pub fn composite(&self, scratch: &mut RasterScratch) {
        self.composite_tiles::<false>(scratch);
    }

    /// Last stage of [`Self::forward`]: copies tiles to an image, which gets the size of the view.
    pub fn store_image(&self, scratch: &RasterScratch, image: &mut RasterImage) {
        let grid = scratch.bins.grid;
        image.resize(grid.width, grid.height);
        store_tiles(&scratch.tiles, &grid, &scratch.background, image.tile_rows());
    }

    fn composite_tiles<const COUNT: bool>(&self, scratch: &mut RasterScratch) {
        let RasterScratch { bins, order, tiles, .. } = scratch;
        tiles.resize(bins.grid.len(), TilePixels::default());
        tiles.par_iter_mut().with_max_len(4).enumerate().for_each(|(tile, pixels)| {
            composite::<COUNT>(self.level, tile_splats(order, bins, tile), pixels);
        });
    }

    /// First stage of [`Self::backward`], of which the conditions hold: sums of every splat over every tile.
    pub fn replay(&self, by_image: &RasterImage, scratch: &mut RasterScratch) {
        let mut sums = core::mem::take(&mut scratch.sums);
        sums.resize(scratch.bins.entries.len(), [0.0; 12]);
        self.replay_tiles(by_image, scratch, 0..scratch.bins.grid.len(), &mut sums);
        scratch.sums = sums;
    }

    /// Replays a range of tiles, whose lists have the length of `sums` together.
    fn replay_tiles(
        &self,
        by_image: &RasterImage,
        scratch: &RasterScratch,
        tiles: core::ops::Range<usize>,
        sums: &mut [SplatSums],
    ) {
        if tiles.len() > 1 {
            let middle = tiles.start + tiles.len() / 2;
            let start = &scratch.bins.tile_start;
            let (left, right) = sums.split_at_mut((start[middle] - start[tiles.start]) as usize);
            rayon::join(
                || self.replay_tiles(by_image, scratch, tiles.start..middle, left),
                || self.replay_tiles(by_image, scratch, middle..tiles.end, right),
            );
        } else if !sums.is_empty() {
            let (tile, grid) = (tiles.start, &scratch.bins.grid);
            let mut gradient = TileGradient::default();
            load_gradient(by_image, grid, tile, &mut gradient);
            let splats = tile_splats(&scratch.order, &scratch.bins, tile);
            let (pixels, background) = (&scratch.tiles[tile], &scratch.background);
            backward(self.level, splats, background, pixels, &mut gradient, sums);
        }
    }

    /// Last stage of [`Self::backward`], of which the conditions hold: sums over tiles, back to the parameters.
    pub fn project_backward(
        &self,
        gaussians: &Gaussians,
        scratch: &mut RasterScratch,
        gradients: &mut GaussianGradients,
    ) -> ViewGradient {
        let pieces = gaussians.len().div_ceil(GAUSSIANS_PER_PIECE);
        scratch.view_sums.resize(pieces, [0.0; 12]);
        let input = SplatGradients {
            view: &scratch.view,
            planes: &slices(gaussians),
            rank_from_gaussian: &scratch.order.rank_from_gaussian,
            bins: &scratch.bins,
            sums: &scratch.sums,
        };
        let out = GradientRange { planes: gradients.parameters.planes_mut(), screen: &mut gradients.screen };
        self.project_pieces_backward(&input, 0, out, &mut scratch.view_sums);
        sum_in_order(&scratch.view_sums)
    }

    /// Adds the gradients of the Gaussians `first..` to `out`, one piece per element of `view_sums`.
    fn project_pieces_backward(
        &self,
        input: &SplatGradients,
        first: usize,
        mut out: GradientRange,
        view_sums: &mut [ViewSums],
    ) {
        match view_sums {
            [] => {}
            [sum] => *sum = project_backward(self.level, input, first, &mut out),
            _ => {
                let middle = view_sums.len() / 2;
                let count = middle * GAUSSIANS_PER_PIECE;
                let (left_sums, right_sums) = view_sums.split_at_mut(middle);
                let (left, right) = out.split_at(count);
                rayon::join(
                    || self.project_pieces_backward(input, first, left, left_sums),
                    || self.project_pieces_backward(input, first + count, right, right_sums),
                );
            }
        }
    }
}

fn tile_splats<'a>(order: &'a Order, bins: &'a Bins, tile: usize) -> TileSplats<'a> {
    TileSplats { splats: &order.splats, list: bins.list(tile), origin: bins.grid.origin(tile) }
}

/// Copies tiles to the rows of an image.
fn store_tiles(tiles: &[TilePixels], grid: &TileGrid, background: &[f32; 3], mut rows: TileRows) {
    let down = tiles.len() / grid.across.max(1);
    if down > 1 {
        let (upper_tiles, lower_tiles) = tiles.split_at(down / 2 * grid.across);
        let (upper, lower) = rows.split_at(down / 2);
        rayon::join(
            || store_tiles(upper_tiles, grid, background, upper),
            || store_tiles(lower_tiles, grid, background, lower),
        );
    } else {
        rows.store(tiles, background);
    }
}

fn slices(gaussians: &Gaussians) -> [&[f32]; PARAMETERS] {
    gaussians.planes().each_ref().map(Vec::as_slice)
}

fn sum_in_order(pieces: &[ViewSums]) -> ViewGradient {
    let mut total = [0.0; 12];
    for piece in pieces {
        total.iter_mut().zip(piece).for_each(|(total, &sum)| *total += f64::from(sum));
    }
    ViewGradient {
        rotation: Matrix3::from_fn(|i, j| total[4 * i + j]),
        translation: Vector3::from_fn(|i, _| total[4 * i + 3]),
    }
}
