//! A view, and the way back from it.

use super::driver::{GaussianGradients, RasterScratch, Rasterizer};
use super::image::RasterImage;
use super::pose::ViewGradient;
use super::view::RasterView;
use crate::gaussians::Gaussians;

/// What [`Rasterizer::forward`] leaves for the backward pass.
///
/// It holds on to the Gaussians and to the memory of the view: neither can change, nor be mistaken for another, between the
/// two passes.
///
/// ```compile_fail,E0506
/// # use mba_raster::gaussians::{Gaussian, Gaussians};
/// # use mba_raster::raster::{GaussianGradients, RasterImage, RasterScratch, RasterView, Rasterizer};
/// # fn wrong(rasterizer: Rasterizer, mut map: Gaussians, view: RasterView, grad_image: &RasterImage) {
/// let (mut scratch, mut image) = (RasterScratch::default(), RasterImage::default());
/// let mut tape = rasterizer.forward(&map, &view, &mut scratch, &mut image);
/// map = Gaussians::zeros(3);
/// tape.backward(grad_image, &mut GaussianGradients::zeros(3));
/// # }
/// ```
#[derive(Debug)]
pub struct ViewTape<'a> {
    pub(super) rasterizer: Rasterizer,
    pub(super) gaussians: &'a Gaussians,
    pub(super) scratch: &'a mut RasterScratch,
}

impl Rasterizer {
    /// Renders a view into `image`, which gets its size. What is returned takes gradients back.
    ///
    /// Gaussians are left out if they are behind the camera or nearer than 1 cm, fainter than a step of 8 bits,
    /// outside of the image, or have a parameter that is not finite or without meaning.
    pub fn forward<'a>(
        &self,
        gaussians: &'a Gaussians,
        view: &RasterView,
        scratch: &'a mut RasterScratch,
        image: &mut RasterImage,
    ) -> ViewTape<'a> {
        self.render(gaussians, view, true, scratch);
        self.store_image(scratch, image);
        ViewTape { rasterizer: *self, gaussians, scratch }
    }
}

impl ViewTape<'_> {
    /// Adds the gradients of a loss to `gradients`, which has the length of the Gaussians, and returns the gradient by the
    /// pose. `grad_image` is the gradient by the image that was rendered.
    ///
    /// # Panics
    /// If image or gradients have other sizes than what was rendered.
    pub fn backward(&mut self, grad_image: &RasterImage, gradients: &mut GaussianGradients) -> ViewGradient {
        let Self { rasterizer, gaussians, scratch } = self;
        assert!(
            scratch.fits(grad_image, gradients),
            "backward is for the Gaussians and the size of the view that was rendered before"
        );
        rasterizer.replay(grad_image, scratch);
        rasterizer.project_backward(gaussians, scratch, gradients)
    }
}
