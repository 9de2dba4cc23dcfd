//! Virtual views, their mean, and the way back.

use mba_tracker::geometry::PinholeCamera;
use mba_tracker::simd::Level;
use mba_tracker::trajectory::SampleRule;
use nalgebra::SVector;
use rayon::prelude::*;

use super::path::{ExposurePath, PATH_PARAMETERS};
use super::rows::{RowViews, band_of};
use super::scratch::{ExposureScratch, VirtualPose};
use super::timing::RowTimes;
use crate::gaussians::Gaussians;
use crate::raster::pose::ViewGradient;
use crate::raster::{
    BandView, ColourShare, GaussianGradients, RasterImage, RasterScratch, RasterView, Rasterizer, ViewShare,
};

/// Gaussians per piece of work that looks for what is drawn.
const GAUSSIANS_PER_PIECE: usize = 4096;

/// Renders virtual views along an exposure, averages them in linear light, and takes gradients back.
#[derive(Clone, Copy, Debug)]
pub struct ExposureRenderer {
    rasterizer: Rasterizer,
}

impl ExposureRenderer {
    /// A renderer with the instruction set `level`; levels differ by rounding only.
    #[must_use]
    pub fn new(level: Level) -> Self {
        Self { rasterizer: Rasterizer::new(level) }
    }

    /// Renders an exposure into `image`, which gets the size of the camera.
    ///
    /// Colour is the mean of `views` virtual views at the times of
    /// [`SampleRule::Midpoint`], over `background`, linear RGB; depth and alpha are those of the view at mid
    /// exposure. So that there is such a view, an even number of views counts as the next odd one, and none as one.
    #[expect(clippy::too_many_arguments, reason = "inputs of one image, and where the results go")]
    pub fn forward(
        &self,
        gaussians: &Gaussians,
        camera: &PinholeCamera,
        path: &ExposurePath,
        views: usize,
        background: [f64; 3],
        scratch: &mut ExposureScratch,
        image: &mut RasterImage,
    ) {
        let views = views | 1;
        let ExposureScratch { rasters, poses, row_weights, drawn, .. } = scratch;
        row_weights.clear();
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
        mark_drawn(rasters, gaussians.len(), drawn);
    }

    /// [`Self::forward`] for rows that are exposed one after the other, at the times `times` of the path. `views` are
    /// those of the exposure of one row; those of all rows together are as far apart, from the first opening to the last
    /// closing, at most 48. Depth and alpha are those at the time of the depth image.
    #[expect(clippy::too_many_arguments, reason = "inputs of one image, and where the results go")]
    pub fn forward_rows(
        &self,
        gaussians: &Gaussians,
        camera: &PinholeCamera,
        path: &ExposurePath,
        times: &RowTimes,
        views: usize,
        background: [f64; 3],
        scratch: &mut ExposureScratch,
        image: &mut RasterImage,
    ) {
        if times.is_global() {
            return self.forward(gaussians, camera, path, views, background, scratch, image);
        }
        // Every view has a weight in every row; views for depth follow those for colour and have none.
        let rows = RowViews::new(*times, views, camera.height);
        let ExposureScratch { rasters, poses, row_weights, colour_views, drawn, .. } = scratch;
        *colour_views = rows.count();
        let bands: Vec<_> = rows.depth_bands().collect();
        row_weights.resize_with(rows.count() + bands.len(), Vec::new);
        for (k, weights) in row_weights.iter_mut().enumerate() {
            weights.clear();
            if k < rows.count() {
                weights.extend(rows.weights(k));
            }
        }
        // Poses at the times of all views.
        let depth_times = bands.iter().map(|(_, time)| *time);
        let all_times = (0..rows.count()).map(|k| rows.time(k)).chain(depth_times);
        poses.clear();
        poses.extend(all_times.map(|time| VirtualPose::new(path, time)));
        if rasters.len() < poses.len() {
            rasters.resize_with(poses.len(), RasterScratch::default);
        }
        // Only the rows in which a view counts are drawn.
        let rasters = &mut rasters[..poses.len()];
        rasters.par_iter_mut().zip(&*poses).enumerate().for_each(|(k, (raster, pose))| {
            let view = RasterView { camera: *camera, world_from_camera: pose.world_from_camera, background };
            match k.checked_sub(rows.count()) {
                None => {
                    let band = band_of(&row_weights[k]);
                    self.rasterizer.render_band(gaussians, &view, &band, false, raster);
                }
                Some(k) => self.rasterizer.render_band(gaussians, &view, &bands[k].0, true, raster),
            }
        });
        // The weighted mean, row by row.
        let parts = rasters.iter().zip(&*row_weights).enumerate();
        let parts: Vec<_> = parts
            .map(|(k, (scratch, weights))| BandView { scratch, weights, geometry: k >= rows.count() })
            .collect();
        self.rasterizer.store_bands([camera.width, camera.height], &parts, image);
        mark_drawn(rasters, gaussians.len(), drawn);
    }

    /// Adds the gradients of a loss to `gradients`, which has the length of `gaussians`, and returns the gradient
    /// by the parameters of the path, in the order of [`ExposurePath::pose_jacobian`]. `grad_image` is the gradient by the image of the last call of [`Self::forward`]
    /// or [`Self::forward_rows`], which had the same Gaussians and the same scratch memory.
    ///
    /// [`GaussianGradients::screen`] gets the sum over the virtual views of the lengths of their gradients: the
    /// share of every view in the image is already in them, so that it compares for any number of views.
    ///
    /// # Panics
    /// If there was no such call, or Gaussians, image or gradients have other sizes than in it.
    pub fn backward(
        &self,
        gaussians: &Gaussians,
        grad_image: &RasterImage,
        scratch: &mut ExposureScratch,
        gradients: &mut GaussianGradients,
    ) -> SVector<f64, PATH_PARAMETERS> {
        let ExposureScratch { rasters, poses, row_weights, colour_views, pose_sums, .. } = scratch;
        let views = poses.len();
        let rasters = &mut rasters[..views];
        assert!(views > 0, "backward is for an exposure, and none was rendered before");
        assert!(
            rasters.iter().all(|raster| raster.fits(gaussians, grad_image, gradients)),
            "backward is for the Gaussians and the size of the exposure that was rendered before"
        );
        rasters.par_iter_mut().enumerate().for_each(|(k, raster)| {
            // The share that the view had in the image: of all rows alike, of some rows, or of depth alone.
            let share = match row_weights.get(k) {
                None => ViewShare { colour: ColourShare::Same(1.0 / views as f32), geometry: k == views / 2 },
                Some(weights) if k < *colour_views => {
                    ViewShare { colour: ColourShare::Rows(weights), geometry: false }
                }
                Some(_) => ViewShare { colour: ColourShare::Same(0.0), geometry: true },
            };
            self.rasterizer.replay_share(grad_image, share, raster);
        });
        self.rasterizer.project_views_backward(gaussians, rasters, pose_sums, gradients);
        // The chain from every pose to the parameters of the path they lie on.
        let grad_view = poses.iter().enumerate();
        grad_view.map(|(k, pose)| pose.grad_path(&pose_sums.of_view(k, views))).sum()
    }
}

/// Marks the Gaussians that any of the views drew.
fn mark_drawn(rasters: &[RasterScratch], count: usize, drawn: &mut Vec<bool>) {
    drawn.resize(count, false);
    drawn.par_iter_mut().with_min_len(GAUSSIANS_PER_PIECE).enumerate().for_each(|(k, drawn)| {
        *drawn = rasters.iter().any(|raster| raster.is_drawn(k));
    });
}

impl VirtualPose {
    fn new(path: &ExposurePath, time: f64) -> Self {
        Self { world_from_camera: path.at(time), grad_path: path.pose_jacobian(time) }
    }

    /// The gradient by the parameters of the path.
    fn grad_path(&self, grad_view: &ViewGradient) -> SVector<f64, PATH_PARAMETERS> {
        self.grad_path.transpose() * grad_view.tangent(&self.world_from_camera)
    }
}
