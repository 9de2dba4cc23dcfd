//! Random maps and views for the rasterizer, and what the tests compare.

use mba_mapper::gaussians::{Gaussian, Gaussians};
use mba_mapper::raster::pose::ViewGradient;
use mba_mapper::raster::reference::{ReferenceGaussian, ReferencePixelGradient};
use mba_mapper::raster::{GaussianGradients, RasterImage, RasterScratch, RasterView, Rasterizer};
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::simd::Level;
use nalgebra::{Vector3, Vector6};

use crate::transfer_scene::Uniform;

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
    pub fn new(level: Level, gaussians: &Gaussians, view: &RasterView, grad_image: &RasterImage) -> Self {
        let rasterizer = Rasterizer::new(level);
        let mut scratch = RasterScratch::default();
        let mut image = RasterImage::default();
        let mut gradients = GaussianGradients::zeros(gaussians.len());
        let mut tape = rasterizer.forward(gaussians, view, &mut scratch, &mut image);
        let view = tape.backward(grad_image, &mut gradients);
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
pub fn to_image(view: &RasterView, grad_pixels: &ReferencePixelGradient) -> RasterImage {
    let plane = |values: &[f64]| values.iter().map(|&value| value as f32).collect();
    RasterImage {
        width: view.camera.width,
        height: view.camera.height,
        colour: [0, 1, 2].map(|k| grad_pixels.colour.iter().map(|colour| colour[k] as f32).collect()),
        depth: plane(&grad_pixels.depth),
        alpha: plane(&grad_pixels.alpha),
    }
}

fn to_f32(vector: &Vector3<f64>) -> [f32; 3] {
    vector.map(|value| value as f32).into()
}

/// A camera that looks at a cloud of Gaussians from an oblique pose, with a background.
#[must_use]
pub fn random_view(uniform: &mut Uniform, width: usize, height: usize) -> RasterView {
    let mut draw = |range: f64| uniform.within(-range, range);
    let tangent = Vector6::new(draw(0.3), draw(0.3), draw(0.3), draw(0.6), draw(0.6), draw(0.6));
    RasterView {
        camera: PinholeCamera {
            width,
            height,
            fx: 0.9 * width as f64,
            fy: 1.1 * width as f64,
            cx: 0.5 * width as f64 - 2.3,
            cy: 0.5 * height as f64 + 1.7,
        },
        world_from_camera: RigidTransform::identity().perturbed(&tangent),
        background: [0.3, 0.1, 0.6],
    }
}

/// Gaussians in front of the camera, a few beyond the borders of the image, with quaternions of any length.
#[must_use]
pub fn random_gaussians(uniform: &mut Uniform, view: &RasterView, count: usize) -> Vec<ReferenceGaussian> {
    let camera = &view.camera;
    (0..count)
        .map(|_| {
            let z = uniform.within(0.6, 4.0);
            let u = uniform.within(-0.2, 1.2) * camera.width as f64;
            let v = uniform.within(-0.2, 1.2) * camera.height as f64;
            ReferenceGaussian {
                mean: view.world_from_camera.transform_point(&(camera.ray(u, v) * z)),
                scale: Vector3::from_fn(|_, _| uniform.within(-4.5, -1.2).exp()),
                rotation: core::array::from_fn(|_| uniform.within(-1.5, 1.5)),
                opacity: uniform.within(0.05, 0.98),
                colour: Vector3::from_fn(|_, _| uniform.within(0.0, 1.0)),
            }
        })
        .collect()
}

/// A random gradient by the pixels of a view.
#[must_use]
pub fn random_pixel_gradient(uniform: &mut Uniform, view: &RasterView) -> ReferencePixelGradient {
    let pixels = view.camera.width * view.camera.height;
    ReferencePixelGradient {
        colour: (0..pixels).map(|_| Vector3::from_fn(|_, _| uniform.within(-1.0, 1.0))).collect(),
        depth: (0..pixels).map(|_| uniform.within(-1.0, 1.0)).collect(),
        alpha: (0..pixels).map(|_| uniform.within(-1.0, 1.0)).collect(),
    }
}
