//! Wrong sizes and states are refused with a message, never answered with zeros.

use mba_mapper::gaussians::{ForViewers, Gaussian, Gaussians, format_ply_for_viewers};
use mba_mapper::raster::{GaussianGradients, RasterImage, RasterScratch, RasterView, Rasterizer};
use mba_tests::raster_scene::{random_gaussians, random_view, to_parameters};
use mba_tests::transfer_scene::Uniform;
use mba_tracker::simd::Level;

fn scene() -> (Gaussians, RasterView) {
    let mut uniform = Uniform::new(6);
    let view = random_view(&mut uniform, 60, 90);
    (random_gaussians(&mut uniform, &view, 20).iter().map(to_parameters).collect(), view)
}

/// The backward pass after a forward pass, with an image gradient of `size` and gradients for `count` Gaussians.
fn backward([width, height]: [usize; 2], count: usize) {
    let (gaussians, view) = scene();
    let rasterizer = Rasterizer::new(Level::new());
    let (mut scratch, mut image) = (RasterScratch::default(), RasterImage::default());
    let mut tape = rasterizer.forward(&gaussians, &view, &mut scratch, &mut image);
    tape.backward(&RasterImage::zeros(width, height), &mut GaussianGradients::zeros(count));
}

#[test]
fn right_sizes_pass() {
    backward([60, 90], 20);
}

#[test]
#[should_panic(expected = "the size of the view that was rendered before")]
fn an_image_of_another_size_is_refused() {
    backward([59, 90], 20);
}

#[test]
#[should_panic(expected = "the size of the view that was rendered before")]
fn gradients_of_another_map_are_refused() {
    backward([60, 90], 19);
}

#[test]
#[should_panic(expected = "Gaussian 3 of a map of 3 Gaussians")]
fn a_gaussian_that_is_not_there_is_not_replaced() {
    Gaussians::zeros(3).set(3, &Gaussian::default());
}

#[test]
#[should_panic(expected = "colours and sizes of 2 Gaussians for a map of 3")]
fn a_file_for_viewers_needs_colours_of_all_gaussians() {
    let planes = || [0; 3].map(|_| vec![0.5; 2]);
    let viewing = ForViewers { colours: planes(), log_scales: planes(), comments: Vec::new() };
    let _ = format_ply_for_viewers(&Gaussians::zeros(3), &viewing);
}
