//! The same bits for any number of threads and any history of the scratch memory.

use mba_mapper::gaussians::Gaussians;
use mba_mapper::raster::{GaussianGradients, RasterImage, RasterScratch, RasterView, Rasterizer};
use mba_tests::raster_scene::{
    Rendered, random_gaussians, random_pixel_gradient, random_view, to_image, to_parameters,
};
use mba_tests::transfer_scene::Uniform;
use mba_tracker::simd::Level;

/// Enough Gaussians for several pieces of work in every stage.
fn scene(seed: u64, width: usize, count: usize) -> (Gaussians, RasterView, RasterImage) {
    let mut uniform = Uniform::new(seed);
    let view = random_view(&mut uniform, width, 90);
    let gaussians = random_gaussians(&mut uniform, &view, count).iter().map(to_parameters).collect();
    let grad_image = to_image(&view, &random_pixel_gradient(&mut uniform, &view));
    (gaussians, view, grad_image)
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let (gaussians, view, grad_image) = scene(1, 131, 3000);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
        pool.install(|| Rendered::new(Level::new(), &gaussians, &view, &grad_image))
    };
    let one = with(1);
    assert!(one.image.alpha.iter().sum::<f32>() > 1000.0, "there is nothing to see");
    for threads in [2, 5] {
        assert!(with(threads) == one, "{threads} threads give another result than one");
    }
}

#[test]
fn used_memory_does_not_matter() {
    let rasterizer = Rasterizer::new(Level::new());
    let mut scratch = RasterScratch::default();
    let mut image = RasterImage::default();
    for (seed, width, count) in [(1, 131, 3000), (2, 40, 17), (3, 90, 800), (4, 40, 0)] {
        let (gaussians, view, grad_image) = scene(seed, width, count);
        let mut tape = rasterizer.forward(&gaussians, &view, &mut scratch, &mut image);
        let mut gradients = GaussianGradients::zeros(count);
        let grad_view = tape.backward(&grad_image, &mut gradients);
        let fresh = Rendered::new(Level::new(), &gaussians, &view, &grad_image);
        assert!(
            image == fresh.image && gradients == fresh.gradients && grad_view == fresh.view,
            "scene {seed}"
        );
    }
}

#[test]
fn gradients_add_up() {
    let (gaussians, view, grad_image) = scene(5, 60, 100);
    let rasterizer = Rasterizer::new(Level::new());
    let (mut scratch, mut image) = (RasterScratch::default(), RasterImage::default());
    let mut tape = rasterizer.forward(&gaussians, &view, &mut scratch, &mut image);
    let mut twice = GaussianGradients::zeros(100);
    tape.backward(&grad_image, &mut twice);
    let once = twice.clone();
    tape.backward(&grad_image, &mut twice);
    for (once, twice) in once.parameters.planes().iter().zip(twice.parameters.planes()) {
        assert!(once.iter().zip(twice).all(|(once, twice)| 2.0 * once == *twice), "gradients are not added");
    }
}
