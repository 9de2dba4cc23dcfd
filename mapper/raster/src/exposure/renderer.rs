//! Virtual views and their mean.

use mba_tracker::geometry::PinholeCamera;
use mba_tracker::simd::Level;
use mba_tracker::trajectory::SampleRule;
use rayon::prelude::*;

use super::path::ExposurePath;
use super::rows::{RowViews, band_of};
use super::scratch::{ExposureScratch, VirtualPose};
use super::tape::ExposureTape;
use super::timing::RowTimes;
use crate::gaussians::Gaussians;
use crate::raster::{BandView, RasterImage, RasterScratch, RasterView, Rasterizer};

/// Gaussians per piece of work that looks for what is drawn.
const GAUSSIANS_PER_PIECE: usize = 4096;

/// Renders virtual views along an exposure and averages them in linear light.
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

    /// Renders an exposure into `image`, which gets the size of the camera. What is returned takes gradients back.
    ///
    /// Colour is the mean of `views` virtual views at the times of
    /// [`SampleRule::Midpoint`], over `background`, linear RGB; depth and alpha are those of the view at mid
    /// exposure. So that there is such a view, an even number of views counts as the next odd one, and none as one.
    #[expect(clippy::too_many_arguments, reason = "inputs of one image, and where the results go")]
    pub fn forward<'a>(
        &self,
        gaussians: &'a Gaussians,
        camera: &PinholeCamera,
        path: &ExposurePath,
        views: usize,
        background: [f64; 3],
        scratch: &'a mut ExposureScratch,
        image: &mut RasterImage,
    ) -> ExposureTape<'a> {
        let views = views | 1;
        let ExposureScratch { rasters, poses, row_weights, drawn, .. } = &mut *scratch;
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
        ExposureTape { rasterizer: self.rasterizer, gaussians, scratch }
    }

    /// [`Self::forward`] for rows that are exposed one after the other, at the times `times` of the path. `views` are
    /// those of the exposure of one row; those of all rows together are as far apart, from the first opening to the last
    /// closing, at most 48. Depth and alpha are those at the time of the depth image.
    #[expect(clippy::too_many_arguments, reason = "inputs of one image, and where the results go")]
    pub fn forward_rows<'a>(
        &self,
        gaussians: &'a Gaussians,
        camera: &PinholeCamera,
        path: &ExposurePath,
        times: &RowTimes,
        views: usize,
        background: [f64; 3],
        scratch: &'a mut ExposureScratch,
        image: &mut RasterImage,
    ) -> ExposureTape<'a> {
        if times.is_global() {
            return self.forward(gaussians, camera, path, views, background, scratch, image);
        }
        // Every view has a weight in every row; views for depth follow those for colour and have none.
        let rows = RowViews::new(*times, views, camera.height);
        let ExposureScratch { rasters, poses, row_weights, colour_views, drawn, .. } = &mut *scratch;
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
        ExposureTape { rasterizer: self.rasterizer, gaussians, scratch }
    }
}

/// Marks the Gaussians that any of the views drew.
fn mark_drawn(rasters: &[RasterScratch], count: usize, drawn: &mut Vec<bool>) {
    drawn.resize(count, false);
    drawn.par_iter_mut().with_min_len(GAUSSIANS_PER_PIECE).enumerate().for_each(|(k, drawn)| {
        *drawn = rasters.iter().any(|raster| raster.is_drawn(k));
    });
}
