//! The stages in order, each over all threads of the current pool.

use core::cell::Cell;
use core::ops::Range;

use mba_tracker::simd::Level;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::backward::{SplatSums, TileGradient, backward};
use super::bin::Bins;
use super::forward::{TileCounts, TilePixels, TileSplats, composite};
use super::image::{RasterImage, TileRows, ViewTiles, load_gradient, store_mean};
use super::lanes::ViewNumbers;
use super::order::{NO_RANK, Order};
use super::pose::ViewGradient;
use super::project::{Projected, project};
use super::project_backward::{GradientRange, SplatGradients, ViewSums, project_backward};
use super::tile::TileGrid;
use super::view::RasterView;
use super::view_share::ViewShare;
use crate::gaussians::{Gaussians, PARAMETERS};

/// Gaussians per piece of work of the projection and its backward pass.
const GAUSSIANS_PER_PIECE: usize = 512;

thread_local! {
    /// Memory for what a view projects, which is needed only until it is sorted: of every thread, not of every view, since it
    /// has room for all Gaussians, however few of them a view shows.
    static PROJECTED: Cell<Vec<Projected>> = const { Cell::new(Vec::new()) };
}

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
    /// Columns and rows of the image, of which the view may have a band only.
    size: [usize; 2],
    pub(super) background: [f32; 3],
    /// Between the first stage and the second.
    projected: Vec<Projected>,
    order: Order,
    pub(super) bins: Bins,
    pub(super) tiles: Vec<TilePixels>,
    sums: Vec<SplatSums>,
    pose_sums: PoseSums,
}

/// What pieces of Gaussians give to the poses of views, piece by piece.
#[derive(Debug, Default)]
pub(crate) struct PoseSums(Vec<ViewSums>);

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

    /// Whether an image and gradients have the sizes of the last view.
    pub(crate) fn fits(&self, image: &RasterImage, gradients: &GaussianGradients) -> bool {
        [image.width, image.height] == self.size
            && gradients.screen.len() == self.order.rank_from_gaussian.len()
    }

    fn splat_gradients<'a>(&'a self, planes: &'a [&'a [f32]; PARAMETERS]) -> SplatGradients<'a> {
        SplatGradients {
            view: &self.view,
            planes,
            rank_from_gaussian: &self.order.rank_from_gaussian,
            bins: &self.bins,
            sums: &self.sums,
        }
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

    /// All of [`Self::forward`] but the image. Without `geometry` depth is left out.
    pub fn render(
        &self,
        gaussians: &Gaussians,
        view: &RasterView,
        geometry: bool,
        scratch: &mut RasterScratch,
    ) {
        let grid = TileGrid::new(view.camera.width, view.camera.height);
        self.render_grid(gaussians, view, &grid, geometry, scratch);
    }

    /// [`Self::render`] for the rows of tiles in `band` only.
    pub(crate) fn render_band(
        &self,
        gaussians: &Gaussians,
        view: &RasterView,
        band: &Range<usize>,
        geometry: bool,
        scratch: &mut RasterScratch,
    ) {
        let grid = TileGrid::new(view.camera.width, view.camera.height).band(band);
        self.render_grid(gaussians, view, &grid, geometry, scratch);
    }

    fn render_grid(
        &self,
        gaussians: &Gaussians,
        view: &RasterView,
        grid: &TileGrid,
        geometry: bool,
        scratch: &mut RasterScratch,
    ) {
        // While this view waits for its parts, the thread may begin another, which finds nothing here and makes its own.
        scratch.projected = PROJECTED.take();
        self.project_grid(gaussians, view, grid, scratch);
        self.order(scratch);
        PROJECTED.set(core::mem::take(&mut scratch.projected));
        self.bin_grid(grid, scratch);
        if geometry {
            self.composite_tiles::<true>(scratch);
        } else {
            self.composite_tiles::<false>(scratch);
        }
    }

    /// Number of Gaussians composited at every pixel of the last view, row by row.
    #[must_use]
    pub fn contributions(&self, scratch: &mut RasterScratch) -> Vec<u32> {
        let RasterScratch { bins, order, tiles, .. } = scratch;
        let grid = bins.grid;
        tiles.resize(grid.len(), TilePixels::default());
        let mut counts = vec![TileCounts::default(); grid.len()];
        let outputs = tiles.par_iter_mut().zip(&mut counts).enumerate();
        outputs.for_each(|(tile, (pixels, counts))| {
            composite::<true, true>(self.level, tile_splats(order, bins, tile), pixels, counts);
        });
        let count = |pixel: usize| {
            let (x, y) = (pixel % grid.width, pixel / grid.width);
            counts[grid.tile_of(x, y)].at(x, y)
        };
        (0..grid.width * grid.height).map(count).collect()
    }

    /// First stage of [`Self::forward`]: projects every Gaussian.
    pub fn project(&self, gaussians: &Gaussians, view: &RasterView, scratch: &mut RasterScratch) {
        let grid = TileGrid::new(view.camera.width, view.camera.height);
        self.project_grid(gaussians, view, &grid, scratch);
    }

    fn project_grid(
        &self,
        gaussians: &Gaussians,
        view: &RasterView,
        grid: &TileGrid,
        scratch: &mut RasterScratch,
    ) {
        scratch.view = ViewNumbers::new(view).within(grid);
        scratch.size = [view.camera.width, view.camera.height];
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
        scratch.order.sort(&scratch.projected);
        let pieces = scratch.order.pieces_mut().par_bridge();
        pieces.for_each(|mut piece| piece.gather(&scratch.projected));
    }

    /// Third stage of [`Self::forward`]: lists the splats of every tile.
    pub fn bin(&self, view: &RasterView, scratch: &mut RasterScratch) {
        self.bin_grid(&TileGrid::new(view.camera.width, view.camera.height), scratch);
    }

    fn bin_grid(&self, grid: &TileGrid, scratch: &mut RasterScratch) {
        let RasterScratch { bins, order, .. } = scratch;
        bins.reset(*grid, order.len());
        let chunks = bins.chunks_mut().par_iter_mut().enumerate();
        chunks.for_each(|(chunk, entries)| entries.fill(grid, order, chunk));
        bins.gather();
    }

    /// Fourth stage of [`Self::forward`]: composites the splats of every tile.
    pub fn composite(&self, scratch: &mut RasterScratch) {
        self.composite_tiles::<true>(scratch);
    }

    /// Last stage of [`Self::forward`]: copies tiles to an image, which gets the size of the view.
    pub fn store_image(&self, scratch: &RasterScratch, image: &mut RasterImage) {
        self.store_mean(core::slice::from_ref(scratch), image);
    }

    /// The mean colour of views of one size, with depth and alpha of the one in the middle.
    pub(crate) fn store_mean(&self, views: &[RasterScratch], image: &mut RasterImage) {
        let Some(grid) = views.first().map(|view| view.bins.grid) else {
            return;
        };
        image.resize(grid.width, grid.height);
        store_rows(views, 0..grid.down, image.tile_rows());
    }

    fn composite_tiles<const DEPTH: bool>(&self, scratch: &mut RasterScratch) {
        let RasterScratch { bins, order, tiles, .. } = scratch;
        tiles.resize(bins.grid.len(), TilePixels::default());
        tiles.par_iter_mut().with_max_len(4).enumerate().for_each(|(tile, pixels)| {
            let splats = tile_splats(order, bins, tile);
            composite::<DEPTH, false>(self.level, splats, pixels, &mut TileCounts::default());
        });
    }

    /// First stage of [`ViewTape::backward`](super::ViewTape::backward), of which the conditions hold: sums of every splat over every tile.
    pub fn replay(&self, grad_image: &RasterImage, scratch: &mut RasterScratch) {
        self.replay_share(grad_image, ViewShare::WHOLE, scratch);
    }

    /// [`Self::replay`] for an image of which the view has a share.
    pub(crate) fn replay_share(
        &self,
        grad_image: &RasterImage,
        share: ViewShare<'_>,
        scratch: &mut RasterScratch,
    ) {
        let mut sums = core::mem::take(&mut scratch.sums);
        sums.resize(scratch.bins.entries.len(), [0.0; 12]);
        let input = Replay { grad_image, share, scratch };
        self.replay_tiles(&input, 0..scratch.bins.grid.len(), &mut sums);
        scratch.sums = sums;
    }

    /// Replays a range of tiles, whose lists have the length of `sums` together.
    fn replay_tiles(&self, input: &Replay, tiles: Range<usize>, sums: &mut [SplatSums]) {
        if tiles.len() > 1 {
            // Halves until a tile is left: lists are disjoint parts of the sums, and need no lock.
            let middle = tiles.start + tiles.len() / 2;
            let start = &input.scratch.bins.tile_start;
            let (left, right) = sums.split_at_mut((start[middle] - start[tiles.start]) as usize);
            rayon::join(
                || self.replay_tiles(input, tiles.start..middle, left),
                || self.replay_tiles(input, middle..tiles.end, right),
            );
        } else if !sums.is_empty() {
            let Replay { grad_image, share, scratch } = input;
            let tile = tiles.start;
            let mut gradient = TileGradient::default();
            load_gradient(grad_image, *share, &scratch.bins.grid, tile, &mut gradient);
            let splats = tile_splats(&scratch.order, &scratch.bins, tile);
            let (pixels, background) = (&scratch.tiles[tile], &scratch.background);
            let backward = if share.geometry { backward::<true> } else { backward::<false> };
            backward(self.level, splats, background, pixels, &mut gradient, sums);
        }
    }

    /// Last stage of [`ViewTape::backward`](super::ViewTape::backward), of which the conditions hold: sums over tiles, back to the parameters.
    pub fn project_backward(
        &self,
        gaussians: &Gaussians,
        scratch: &mut RasterScratch,
        gradients: &mut GaussianGradients,
    ) -> ViewGradient {
        let mut pose_sums = core::mem::take(&mut scratch.pose_sums);
        let view = core::slice::from_ref(&*scratch);
        self.project_views_backward(gaussians, view, &mut pose_sums, gradients);
        scratch.pose_sums = pose_sums;
        scratch.pose_sums.of_view(0, 1)
    }

    /// [`Self::project_backward`] for views of the same Gaussians, which adds to every gradient view by view.
    pub(crate) fn project_views_backward(
        &self,
        gaussians: &Gaussians,
        views: &[RasterScratch],
        pose_sums: &mut PoseSums,
        gradients: &mut GaussianGradients,
    ) {
        let pieces = gaussians.len().div_ceil(GAUSSIANS_PER_PIECE);
        pose_sums.0.resize(pieces * views.len(), [0.0; 12]);
        let out = GradientRange { planes: gradients.parameters.planes_mut(), screen: &mut gradients.screen };
        self.project_pieces_backward(&slices(gaussians), views, 0, out, &mut pose_sums.0);
    }

    /// Adds the gradients of the Gaussians `first..` to `out`, one piece per number of views of `pose_sums`.
    fn project_pieces_backward(
        &self,
        planes: &[&[f32]; PARAMETERS],
        views: &[RasterScratch],
        first: usize,
        mut out: GradientRange,
        pose_sums: &mut [ViewSums],
    ) {
        let pieces = pose_sums.len() / views.len().max(1);
        if pieces > 1 {
            // The same pieces for any number of threads: sums come out alike.
            let count = pieces / 2 * GAUSSIANS_PER_PIECE;
            let (left_sums, right_sums) = pose_sums.split_at_mut(pieces / 2 * views.len());
            let (left, right) = out.split_at(count);
            rayon::join(
                || self.project_pieces_backward(planes, views, first, left, left_sums),
                || self.project_pieces_backward(planes, views, first + count, right, right_sums),
            );
        } else {
            for (sum, view) in pose_sums.iter_mut().zip(views) {
                *sum = project_backward(self.level, &view.splat_gradients(planes), first, &mut out);
            }
        }
    }
}

/// What replaying a view needs.
struct Replay<'a> {
    grad_image: &'a RasterImage,
    share: ViewShare<'a>,
    scratch: &'a RasterScratch,
}

fn tile_splats<'a>(order: &'a Order, bins: &'a Bins, tile: usize) -> TileSplats<'a> {
    TileSplats { splats: &order.splats, list: bins.list(tile), origin: bins.grid.origin(tile) }
}

/// Stores the mean of views in rows of tiles.
fn store_rows(views: &[RasterScratch], down: Range<usize>, mut rows: TileRows) {
    if down.len() > 1 {
        let middle = down.start + down.len() / 2;
        let (upper, lower) = rows.split_at(middle - down.start);
        rayon::join(
            || store_rows(views, down.start..middle, upper),
            || store_rows(views, middle..down.end, lower),
        );
    } else if !down.is_empty() {
        let tiles =
            |view: usize| ViewTiles { tiles: &views[view].tiles, background: &views[view].background };
        store_mean(&tiles, views.len(), &views[0].bins.grid, down.start, &mut rows);
    }
}

fn slices(gaussians: &Gaussians) -> [&[f32]; PARAMETERS] {
    gaussians.planes().each_ref().map(Vec::as_slice)
}

impl PoseSums {
    /// The gradient by the pose of view `view` of `views`: the pieces in their order.
    pub(crate) fn of_view(&self, view: usize, views: usize) -> ViewGradient {
        let mut total = [0.0; 12];
        for piece in self.0.iter().skip(view).step_by(views.max(1)) {
            total.iter_mut().zip(piece).for_each(|(total, &sum)| *total += f64::from(sum));
        }
        ViewGradient {
            rotation: Matrix3::from_fn(|i, j| total[4 * i + j]),
            translation: Vector3::from_fn(|i, _| total[4 * i + 3]),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::super::ViewTape;
    use super::*;
    use crate::gaussians::Gaussian;
    use mba_tracker::geometry::{PinholeCamera, RigidTransform};

    #[test]
    fn a_view_keeps_four_bytes_of_a_gaussian_that_it_does_not_show() {
        let ball = |x: f32| Gaussian {
            mean: [x, 0.0, 2.0],
            log_scale: [-3.0; 3],
            rotation: [1.0, 0.0, 0.0, 0.0],
            opacity_logit: 3.0,
            ..Gaussian::default()
        };
        // One in front of the camera, all others far to the right.
        let gaussians: Gaussians = (0..5000).map(|k| ball(if k == 7 { 0.0 } else { 50.0 })).collect();
        let camera = PinholeCamera { width: 32, height: 24, fx: 30.0, fy: 30.0, cx: 15.5, cy: 11.5 };
        let view = |x: f64| RasterView {
            camera,
            world_from_camera: RigidTransform {
                translation: Vector3::new(x, 0.0, 0.0),
                ..RigidTransform::identity()
            },
            background: [0.0; 3],
        };
        let (rasterizer, mut image) = (Rasterizer::new(Level::new()), RasterImage::default());
        let mut scratch = [RasterScratch::default(), RasterScratch::default()];
        for (scratch, x) in scratch.iter_mut().zip([0.0, 0.1]) {
            rasterizer.forward(&gaussians, &view(x), scratch, &mut image);
            assert_eq!((scratch.drawn(), scratch.is_drawn(7), scratch.is_drawn(8)), (1, true, false));
            let order = &scratch.order;
            let kept = [scratch.projected.capacity(), order.splats.capacity(), order.extents.capacity()];
            assert!(kept.iter().sum::<usize>() < 100, "{kept:?}");
            assert_eq!(order.rank_from_gaussian.len(), gaussians.len());
        }
        // Gradients find both views as they were rendered.
        let mut gradients = GaussianGradients::zeros(gaussians.len());
        image.colour[0].fill(1.0);
        for scratch in &mut scratch {
            ViewTape { rasterizer, gaussians: &gaussians, scratch }.backward(&image, &mut gradients);
        }
        assert_ne!(gradients.parameters.get(7), gradients.parameters.get(8));
    }
}
