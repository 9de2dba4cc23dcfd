//! The oracle of the rasterizer: every Gaussian against every pixel, in f64, as plainly as it can be written.
//!
//! The fast path is tested against this module, this module against published renderers' values and finite
//! differences. It shares no arithmetic with the fast path.

mod composite;
mod projection;
mod render;

use nalgebra::{Vector2, Vector3};

pub use render::{gradients, render};

use super::pose::ViewGradient;
use crate::gaussians::Gaussian;

/// One Gaussian in the parameters of the formulas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceGaussian {
    /// Centre in the world, metres.
    pub mean: Vector3<f64>,
    /// Standard deviations along its own axes, metres.
    pub scale: Vector3<f64>,
    /// Rotation from its own axes to the world, quaternion w x y z of any length but zero.
    pub rotation: [f64; 4],
    /// Opacity at its centre, in (0, 1).
    pub opacity: f64,
    /// Linear RGB.
    pub colour: Vector3<f64>,
}

impl From<&Gaussian> for ReferenceGaussian {
    fn from(gaussian: &Gaussian) -> Self {
        let vector = |values: [f32; 3]| Vector3::from(values.map(f64::from));
        Self {
            mean: vector(gaussian.mean),
            scale: vector(gaussian.log_scale).map(f64::exp),
            rotation: gaussian.rotation.map(f64::from),
            opacity: 1.0 / (1.0 + (-f64::from(gaussian.opacity_logit)).exp()),
            colour: vector(gaussian.colour),
        }
    }
}

/// How the faintest parts of a splat are treated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cutoff {
    /// Skipped, as the conventions say; finished pixels stop.
    Hard,
    /// Faded out smoothly, and no pixel stops. The image is then differentiable, so that finite differences can
    /// check the gradients.
    Smooth,
}

/// A rendered view, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReferenceImage {
    /// Linear RGB including the background.
    pub colour: Vec<Vector3<f64>>,
    /// Sum of weight times camera z, metres; not divided by alpha.
    pub depth: Vec<f64>,
    /// One minus the transmittance behind everything.
    pub alpha: Vec<f64>,
    /// Number of Gaussians that were composited.
    pub contributions: Vec<u32>,
}

/// Gradient of a loss by the pixels of a view, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReferencePixelGradient {
    /// By the colour.
    pub colour: Vec<Vector3<f64>>,
    /// By the depth.
    pub depth: Vec<f64>,
    /// By alpha.
    pub alpha: Vec<f64>,
}

/// Gradient of a loss by the parameters of one Gaussian, and by what it projects to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReferenceGradient {
    /// By the centre.
    pub mean: Vector3<f64>,
    /// By the standard deviations.
    pub scale: Vector3<f64>,
    /// By the quaternion w x y z through its normalisation.
    pub rotation: [f64; 4],
    /// By the opacity.
    pub opacity: f64,
    /// By the colour.
    pub colour: Vector3<f64>,
    /// What passes through the projected splat.
    pub splat: SplatGradient,
}

/// Gradient of a loss by a projected Gaussian.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SplatGradient {
    /// By the projected centre, per pixel.
    pub centre: Vector2<f64>,
    /// By the elements (xx, xy, yy) of the inverse covariance, xy counted once.
    pub conic: [f64; 3],
    /// By the opacity.
    pub opacity: f64,
    /// By the colour.
    pub colour: Vector3<f64>,
    /// By the camera z of the centre, as far as it is composited into the depth.
    pub depth: f64,
    /// By the change of depth, metres per pixel to the right and down.
    pub tilt: Vector2<f64>,
}

/// Gradients of a loss by everything that was rendered.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReferenceGradients {
    /// By every Gaussian; zero for those that are not drawn.
    pub gaussians: Vec<ReferenceGradient>,
    /// By the pose of the camera.
    pub view: ViewGradient,
}
