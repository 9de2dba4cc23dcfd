//! Virtual views, their mean, and the way back.

use mba_tracker::geometry::PinholeCamera;
use mba_tracker::simd::Level;
use mba_tracker::trajectory::{ExposureTrajectory, SampleRule};
use nalgebra::{SMatrix, Vector6};
use rayon::prelude::*;

use super::scratch::{ExposureScratch, VirtualPose};
use crate::gaussians::Gaussians;
use crate::raster::pose::ViewGradient;
use crate::raster::{GaussianGradients, RasterImage, RasterScratch, RasterView, Rasterizer, ViewShare};

/// Gaussians per piece of work that looks for what is drawn.
const GAUSSIANS_PER_PIECE: usize = 4096;

/// Renders virtual views along an exposure, averages them in linear light, and takes gradients back.
#[derive(Clone, Copy, Debug)]
pub struct ExposureRenderer {
    rasterizer: Rasterizer,
}

/// Gradient of a loss by the poses at shutter opening and closing.
///
/// Both by the tangent of [`mba_tracker::geometry::RigidTransform::perturbed`]: translation in the world, metres,
/// then rotation in the camera frame, radians.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExposureGradient {
    /// By the pose at opening.
    pub start: Vector6<f64>,
    /// By the pose at closing.
    pub end: Vector6<f64>,
}

impl ExposureRenderer {
    /// A renderer with the instruction set `level`; levels differ by rounding only.
    #[must_use]
    pub fn new(level: Level) -> Self {
        Self { rasterizer: Rasterizer::new(level) }
    }

    /// Renders an exposure into `image`, which gets the size of the camera.
    ///
    /// `path` holds poses `world_from_camera`. Colour is the mean of `views` virtual views at the times of
    /// [`SampleRule::Midpoint`], over `background`, linear RGB; depth and alpha are those of the view at mid
    /// exposure. So that there is such a view, an even number of views counts as the next odd one, and none as one.
    #[expect(clippy::too_many_arguments, reason = "inputs of one image, and where the results go")]
    pub fn forward(
        &self,
        gaussians: &Gaussians,
        camera: &PinholeCamera,
        path: &ExposureTrajectory,
        views: usize,
        background: [f64; 3],
        scratch: &mut ExposureScratch,
        image: &mut RasterImage,
    ) {
        let views = views | 1;
        let ExposureScratch { rasters, poses, drawn, .. } = scratch;
        poses.clear();
        poses.extend((0..views).map(|k| VirtualPose::new(path, SampleRule::Midpoint.time(k, views))));
        if rasters.len() < views {
            rasters.resize_with(views, RasterScratch::default);
        }
        let rasters = &mut rasters[..views];
        rasters.par_iter_mut().zip(&*poses).enumerate().for_each(|(k, (raster, pose))| {
            let view = RasterView { camera: *camera, world_from_camera: pose.world_from_camera, background };
            self.rasterizer.render(gaussians, &view, k == views / 2, raster);
        });
        self.rasterizer.store_mean(rasters, image);
        drawn.resize(gaussians.len(), false);
        drawn.par_iter_mut().with_min_len(GAUSSIANS_PER_PIECE).enumerate().for_each(|(k, drawn)| {
            *drawn = rasters.iter().any(|raster| raster.is_drawn(k));
        });
    }

    /// Adds the gradients of a loss to `gradients`, which has the length of `gaussians`, and returns the gradient
    /// by the poses at both ends. `by_image` is the gradient by the image of the last call of [`Self::forward`],
    /// which had the same Gaussians and the same scratch memory.
    ///
    /// [`GaussianGradients::screen`] gets the sum over the virtual views of the lengths of their gradients: the
    /// share of every view in the image is already in them, so that it compares for any number of views.
    ///
    /// Gaussians and images of other sizes than in that call give no gradient.
    pub fn backward(
        &self,
        gaussians: &Gaussians,
        by_image: &RasterImage,
        scratch: &mut ExposureScratch,
        gradients: &mut GaussianGradients,
    ) -> ExposureGradient {
        let ExposureScratch { rasters, poses, pose_sums, .. } = scratch;
        let views = poses.len();
        let rasters = &mut rasters[..views];
        if views == 0 || !rasters.iter().all(|raster| raster.fits(gaussians, by_image, gradients)) {
            return ExposureGradient::default();
        }
        rasters.par_iter_mut().enumerate().for_each(|(k, raster)| {
            let share = ViewShare { colour: 1.0 / views as f32, geometry: k == views / 2 };
            self.rasterizer.replay_share(by_image, share, raster);
        });
        self.rasterizer.project_views_backward(gaussians, rasters, pose_sums, gradients);
        let by_view = poses.iter().enumerate().map(|(k, pose)| pose.by_ends(&pose_sums.of_view(k, views)));
        let by_ends: SMatrix<f64, 12, 1> = by_view.sum();
        ExposureGradient {
            start: by_ends.fixed_rows::<6>(0).into_owned(),
            end: by_ends.fixed_rows::<6>(6).into_owned(),
        }
    }
}

impl VirtualPose {
    fn new(path: &ExposureTrajectory, time: f64) -> Self {
        Self { world_from_camera: path.at(time), by_ends: path.pose_jacobian(time) }
    }

    /// The gradient by the poses at both ends.
    fn by_ends(&self, by_view: &ViewGradient) -> SMatrix<f64, 12, 1> {
        self.by_ends.transpose() * by_view.tangent(&self.world_from_camera)
    }
}
