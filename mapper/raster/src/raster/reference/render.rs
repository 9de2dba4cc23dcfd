//! A whole view and its gradients.

use nalgebra::{Vector2, Vector3};

use super::composite::{Pixel, PixelGradient, composite};
use super::projection::{Splat, project, project_backward};
use super::{
    Cutoff, ReferenceGaussian, ReferenceGradient, ReferenceGradients, ReferenceImage, ReferencePixelGradient,
    SplatGradient,
};
use crate::raster::view::RasterView;

/// The Gaussians that are drawn, sorted by depth, ties by index.
struct Sorted {
    gaussian_from_rank: Vec<usize>,
    splats: Vec<Splat>,
}

impl Sorted {
    fn new(gaussians: &[ReferenceGaussian], view: &RasterView) -> Self {
        let mut drawn: Vec<(usize, Splat)> = gaussians
            .iter()
            .enumerate()
            .filter_map(|(index, gaussian)| Some((index, project(gaussian, view)?)))
            .collect();
        drawn.sort_by(|a, b| a.1.depth.total_cmp(&b.1.depth));
        let (gaussian_from_rank, splats) = drawn.into_iter().unzip();
        Self { gaussian_from_rank, splats }
    }
}

/// Renders a view.
#[must_use]
pub fn render(gaussians: &[ReferenceGaussian], view: &RasterView, cutoff: Cutoff) -> ReferenceImage {
    let sorted = Sorted::new(gaussians, view);
    let mut image = ReferenceImage::default();
    for_each_pixel(&sorted, view, cutoff, |_, pixel| {
        image.colour.push(pixel.colour);
        image.depth.push(pixel.depth);
        image.alpha.push(pixel.alpha);
        image.contributions.push(pixel.contributions());
    });
    image
}

/// Gradients of a loss whose gradient by the rendered pixels is `grad_pixels`; it has the size of the view.
#[must_use]
pub fn gradients(
    gaussians: &[ReferenceGaussian],
    view: &RasterView,
    grad_pixels: &ReferencePixelGradient,
    cutoff: Cutoff,
) -> ReferenceGradients {
    let sorted = Sorted::new(gaussians, view);
    let background = background(view);
    let mut grad_splat = vec![SplatGradient::default(); sorted.splats.len()];
    for_each_pixel(&sorted, view, cutoff, |index, pixel| {
        let grad_pixel = PixelGradient {
            colour: grad_pixels.colour[index],
            depth: grad_pixels.depth[index],
            alpha: grad_pixels.alpha[index],
        };
        pixel.backward(&sorted.splats, &background, &grad_pixel, &mut grad_splat);
    });
    // From the splats in their order of depth back to the Gaussians.
    let mut result = ReferenceGradients {
        gaussians: vec![ReferenceGradient::default(); gaussians.len()],
        ..ReferenceGradients::default()
    };
    for (&index, splat) in sorted.gaussian_from_rank.iter().zip(&grad_splat) {
        result.gaussians[index] = project_backward(&gaussians[index], view, splat, &mut result.view);
    }
    result
}

fn for_each_pixel(sorted: &Sorted, view: &RasterView, cutoff: Cutoff, mut visit: impl FnMut(usize, &Pixel)) {
    let background = background(view);
    for row in 0..view.camera.height {
        for column in 0..view.camera.width {
            let at = Vector2::new(column as f64, row as f64);
            let pixel = composite(&sorted.splats, at, &background, cutoff);
            visit(row * view.camera.width + column, &pixel);
        }
    }
}

fn background(view: &RasterView) -> Vector3<f64> {
    Vector3::from(view.background)
}
