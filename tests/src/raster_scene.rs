//! Random maps and views for the rasterizer, and what the tests compare.

use mba_mapper::gaussians::{Gaussian, Gaussians};
use mba_mapper::raster::pose::ViewGradient;
use mba_mapper::raster::reference::{ReferenceGaussian, ReferencePixelGradient};
use mba_mapper::raster::{GaussianGradients, RasterImage, RasterScratch, RasterView, Rasterizer};
use mba_tracker::simd::Level;
use nalgebra::Vector3;

/// What the fast path makes of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendered {
    /// The image.
    pub image: RasterImage,
    /// Gradients of a loss by the Gaussians.
    pub gradients: GaussianGradients,
    /// Gradient by the pose.
    pub view: ViewGradient,
    /// Gaussians composited per pixel.
    pub contributions: Vec<u32>,
}

impl Rendered {
    /// Renders a view and takes the gradient by its pixels back.
    #[must_use]
    pub fn new(level: Level, gaussians: &Gaussians, view: &RasterView, by_image: &RasterImage) -> Self {
        let rasterizer = Rasterizer::new(level);
        let mut scratch = RasterScratch::default();
        let mut image = RasterImage::default();
        let mut gradients = GaussianGradients::zeros(gaussians.len());
        rasterizer.forward(gaussians, view, &mut scratch, &mut image);
        let view = rasterizer.backward(gaussians, by_image, &mut scratch, &mut gradients);
        let contributions = rasterizer.contributions(&mut scratch);
        Self { image, gradients, view, contributions }
    }
}

/// The parameters that the map stores for a Gaussian.
#[must_use]
pub fn to_parameters(gaussian: &ReferenceGaussian) -> Gaussian {
    Gaussian {
        mean: to_f32(&gaussian.mean),
        log_scale: to_f32(&gaussian.scale.map(f64::ln)),
        rotation: gaussian.rotation.map(|q| q as f32),
        opacity_logit: (gaussian.opacity / (1.0 - gaussian.opacity)).ln() as f32,
        colour: to_f32(&gaussian.colour),
    }
}

/// The gradient by the pixels as the fast path takes it.
#[must_use]
pub fn to_image(view: &RasterView, by_pixels: &ReferencePixelGradient) -> RasterImage {
    let plane = |values: &[f64]| values.iter().map(|&value| value as f32).collect();
    RasterImage {
        width: view.camera.width,
        height: view.camera.height,
        colour: [0, 1, 2].map(|k| by_pixels.colour.iter().map(|colour| colour[k] as f32).collect()),
        depth: plane(&by_pixels.depth),
        alpha: plane(&by_pixels.alpha),
    }
}

fn to_f32(vector: &Vector3<f64>) -> [f32; 3] {
    vector.map(|value| value as f32).into()
}
