//! Memory of the virtual views.

use mba_tracker::geometry::RigidTransform;
use nalgebra::{SMatrix, SVector};

use super::path::{ExposurePath, PATH_PARAMETERS};
use crate::raster::pose::ViewGradient;
use crate::raster::{PoseSums, RasterScratch};

/// Everything that rendering an exposure leaves for its backward pass; reused from exposure to exposure, so that
/// nothing is allocated once the largest one has been seen.
#[derive(Debug, Default)]
pub struct ExposureScratch {
    /// What was rendered, view by view; views beyond the last exposure keep their memory.
    pub(super) rasters: Vec<RasterScratch>,
    /// The poses of the views in use.
    pub(super) poses: Vec<VirtualPose>,
    /// Weight of every view in the colour of every row, for views that do not count alike; none for those of depth.
    pub(super) row_weights: Vec<Vec<f32>>,
    /// Views of colour; those of depth follow.
    pub(super) colour_views: usize,
    pub(super) pose_sums: PoseSums,
    /// By Gaussian.
    pub(super) drawn: Vec<bool>,
}

/// Pose of a virtual view.
#[derive(Clone, Copy, Debug)]
pub(super) struct VirtualPose {
    pub(super) world_from_camera: RigidTransform,
    /// Its derivative by the parameters of the path.
    pub(super) grad_path: SMatrix<f64, 6, PATH_PARAMETERS>,
}

impl VirtualPose {
    /// The pose on the path at `time`.
    pub(super) fn new(path: &ExposurePath, time: f64) -> Self {
        Self { world_from_camera: path.at(time), grad_path: path.pose_jacobian(time) }
    }

    /// The gradient by the parameters of the path.
    pub(super) fn grad_path(&self, grad_view: &ViewGradient) -> SVector<f64, PATH_PARAMETERS> {
        self.grad_path.transpose() * grad_view.tangent(&self.world_from_camera)
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

    /// Number of views of the last exposure, those of depth included.
    #[must_use]
    pub fn views(&self) -> usize {
        self.poses.len()
    }

    /// Number of (tile, splat) pairs of the last exposure, of all views together.
    #[must_use]
    pub fn pairs(&self) -> usize {
        self.rasters[..self.views()].iter().map(RasterScratch::pairs).sum()
    }
}
