//! An exposure that was rendered, with all that its way back needs.

use nalgebra::SVector;
use rayon::prelude::*;

use super::path::PATH_PARAMETERS;
use super::scratch::ExposureScratch;
use crate::gaussians::Gaussians;
use crate::raster::{ColourShare, GaussianGradients, RasterImage, Rasterizer, ViewShare};

/// What [`ExposureRenderer`](super::ExposureRenderer) leaves for the backward pass of an exposure.
///
/// It holds on to the Gaussians and to the memory of the views: neither can change, nor be mistaken for another, between the
/// two passes.
#[derive(Debug)]
pub struct ExposureTape<'a> {
    pub(super) rasterizer: Rasterizer,
    pub(super) gaussians: &'a Gaussians,
    pub(super) scratch: &'a mut ExposureScratch,
}

impl ExposureTape<'_> {
    /// Adds the gradients of a loss to `gradients`, which has the length of the Gaussians, and returns the gradient by the
    /// parameters of the path, in the order of [`ExposurePath::pose_jacobian`](super::ExposurePath::pose_jacobian).
    /// `grad_image` is the gradient by the image that was rendered.
    ///
    /// [`GaussianGradients::screen`] gets the sum over the virtual views of the lengths of their gradients: the
    /// share of every view in the image is already in them, so that it compares for any number of views.
    ///
    /// # Panics
    /// If image or gradients have other sizes than what was rendered.
    pub fn backward(
        &mut self,
        grad_image: &RasterImage,
        gradients: &mut GaussianGradients,
    ) -> SVector<f64, PATH_PARAMETERS> {
        let Self { rasterizer, gaussians, scratch } = self;
        let ExposureScratch { rasters, poses, row_weights, colour_views, pose_sums, .. } = &mut **scratch;
        let views = poses.len();
        let rasters = &mut rasters[..views];
        assert!(
            rasters.iter().all(|raster| raster.fits(grad_image, gradients)),
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
            rasterizer.replay_share(grad_image, share, raster);
        });
        rasterizer.project_views_backward(gaussians, rasters, pose_sums, gradients);
        // The chain from every pose to the parameters of the path they lie on.
        let grad_view = poses.iter().enumerate();
        grad_view.map(|(k, pose)| pose.grad_path(&pose_sums.of_view(k, views))).sum()
    }
}
