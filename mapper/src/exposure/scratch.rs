//! Memory of the virtual views.

use mba_tracker::geometry::RigidTransform;
use nalgebra::SMatrix;

use crate::raster::{RasterImage, RasterScratch};

/// Everything that rendering an exposure leaves for its backward pass; reused from exposure to exposure, so that
/// nothing is allocated once the largest one has been seen.
#[derive(Debug, Default)]
pub struct ExposureScratch {
    /// Virtual views; those beyond the last exposure keep their memory.
    pub(super) views: Vec<VirtualView>,
    pub(super) used: usize,
    /// By Gaussian.
    pub(super) drawn: Vec<bool>,
}

/// One virtual view.
#[derive(Debug)]
pub(super) struct VirtualView {
    pub(super) raster: RasterScratch,
    pub(super) image: RasterImage,
    pub(super) world_from_camera: RigidTransform,
    /// Derivative of its pose by those at opening and closing.
    pub(super) by_ends: SMatrix<f64, 6, 12>,
}

impl Default for VirtualView {
    fn default() -> Self {
        Self {
            raster: RasterScratch::default(),
            image: RasterImage::default(),
            world_from_camera: RigidTransform::identity(),
            by_ends: SMatrix::zeros(),
        }
    }
}

impl ExposureScratch {
    /// Whether any view of the last exposure drew Gaussian `index`.
    #[must_use]
    pub fn is_drawn(&self, index: usize) -> bool {
        self.drawn.get(index).is_some_and(|&drawn| drawn)
    }

    /// For every Gaussian whether any view of the last exposure drew it: all others have no gradient.
    #[must_use]
    pub fn drawn_mask(&self) -> &[bool] {
        &self.drawn
    }

    /// Number of virtual views of the last exposure; odd.
    #[must_use]
    pub fn views(&self) -> usize {
        self.used
    }

    /// Number of (tile, splat) pairs of the last exposure, of all views together.
    #[must_use]
    pub fn pairs(&self) -> usize {
        self.views[..self.used].iter().map(|view| view.raster.pairs()).sum()
    }

    /// The virtual views in use.
    pub(super) fn used_mut(&mut self) -> &mut [VirtualView] {
        &mut self.views[..self.used]
    }

    /// Makes room for `views` views.
    pub(super) fn reset(&mut self, views: usize) {
        self.used = views;
        if self.views.len() < views {
            self.views.resize_with(views, VirtualView::default);
        }
    }
}
