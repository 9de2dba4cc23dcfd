//! The gradients of the oracle against central differences, with the smooth cutoff.

use mba_mapper::raster::RasterView;
use mba_mapper::raster::reference::{
    Cutoff, ReferenceGaussian, ReferenceGradients, ReferencePixelGradient, gradients, render,
};
use mba_tests::raster_scene::{random_gaussians, random_pixel_gradient, random_view};
use mba_tests::transfer_scene::Uniform;
use nalgebra::Vector6;

const STEP: f64 = 1e-6;

/// Of the largest entry of the same kind. The step squared times a third derivative, and rounding of the loss over
/// the step, are some 1e-8.
const TOLERANCE: f64 = 1e-6;

struct Scene {
    view: RasterView,
    gaussians: Vec<ReferenceGaussian>,
    grad_pixels: ReferencePixelGradient,
}

impl Scene {
    fn new(seed: u64) -> Self {
        let mut uniform = Uniform::new(seed);
        let view = random_view(&mut uniform, 24, 18);
        let gaussians = random_gaussians(&mut uniform, &view, 12);
        Self { view, gaussians, grad_pixels: random_pixel_gradient(&mut uniform, &view) }
    }

    fn gradients(&self) -> ReferenceGradients {
        gradients(&self.gaussians, &self.view, &self.grad_pixels, Cutoff::Smooth)
    }

    fn loss(&self) -> f64 {
        let image = render(&self.gaussians, &self.view, Cutoff::Smooth);
        let colour: f64 = image.colour.iter().zip(&self.grad_pixels.colour).map(|(a, b)| a.dot(b)).sum();
        let depth: f64 = image.depth.iter().zip(&self.grad_pixels.depth).map(|(a, b)| a * b).sum();
        let alpha: f64 = image.alpha.iter().zip(&self.grad_pixels.alpha).map(|(a, b)| a * b).sum();
        colour + depth + alpha
    }

    /// Slope of the loss when `change` moves the scene by its argument.
    fn slope(&mut self, change: impl Fn(&mut Self, f64)) -> f64 {
        let before = (self.view, self.gaussians.clone());
        let mut at = |step| {
            change(self, step);
            let loss = self.loss();
            (self.view, self.gaussians) = before.clone();
            loss
        };
        (at(STEP) - at(-STEP)) / (2.0 * STEP)
    }
}

type Parameter = fn(&mut ReferenceGaussian, usize) -> &mut f64;

fn check(kind: &str, got: &[f64], want: &[f64]) {
    let largest = want.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    assert!(largest > 0.0, "{kind}: there is no gradient");
    for (k, (got, want)) in got.iter().zip(want).enumerate() {
        assert!((got - want).abs() <= TOLERANCE * largest, "{kind} {k}: {got} instead of {want}");
    }
}

#[test]
fn gradients_are_the_slopes_of_the_loss() {
    for seed in 0..3 {
        let mut scene = Scene::new(seed);
        let got = scene.gradients().gaussians;
        let mut slopes = |width: usize, parameter: Parameter| -> Vec<f64> {
            let one = |k: usize| {
                move |scene: &mut Scene, step| *parameter(&mut scene.gaussians[k / width], k % width) += step
            };
            (0..12 * width).map(|k| scene.slope(one(k))).collect()
        };
        let means: Vec<f64> = got.iter().flat_map(|g| [g.mean.x, g.mean.y, g.mean.z]).collect();
        check("mean", &means, &slopes(3, |g, k| &mut g.mean[k]));
        let scales: Vec<f64> = got.iter().flat_map(|g| [g.scale.x, g.scale.y, g.scale.z]).collect();
        check("scale", &scales, &slopes(3, |g, k| &mut g.scale[k]));
        let rotations: Vec<f64> = got.iter().flat_map(|g| g.rotation).collect();
        check("rotation", &rotations, &slopes(4, |g, k| &mut g.rotation[k]));
        let opacities: Vec<f64> = got.iter().map(|g| g.opacity).collect();
        check("opacity", &opacities, &slopes(1, |g, _| &mut g.opacity));
        let colours: Vec<f64> = got.iter().flat_map(|g| [g.colour.x, g.colour.y, g.colour.z]).collect();
        check("colour", &colours, &slopes(3, |g, k| &mut g.colour[k]));
    }
}

#[test]
fn the_tangent_of_the_pose_is_the_slope_of_the_loss() {
    for seed in 0..3 {
        let mut scene = Scene::new(seed);
        let got = scene.gradients().view.tangent(&scene.view.world_from_camera);
        let slopes: Vec<f64> = (0..6)
            .map(|k| {
                scene.slope(|scene, step| {
                    let tangent = Vector6::from_fn(|i, _| if i == k { step } else { 0.0 });
                    scene.view.world_from_camera = scene.view.world_from_camera.perturbed(&tangent);
                })
            })
            .collect();
        check("pose", got.as_slice(), &slopes);
    }
}

#[test]
fn quaternions_get_nothing_along_themselves() {
    let scene = Scene::new(7);
    for (gradient, gaussian) in scene.gradients().gaussians.iter().zip(&scene.gaussians) {
        let radial: f64 = gradient.rotation.iter().zip(gaussian.rotation).map(|(g, q)| g * q).sum();
        let size: f64 = gradient.rotation.iter().map(|g| g.abs()).sum();
        assert!(radial.abs() <= 1e-12 * size, "{radial} of {size}");
    }
}
