//! Every SIMD level against the oracle, on random scenes of awkward sizes.

use mba_mapper::gaussians::{COLOUR, Gaussians, LOG_SCALE, MEAN, OPACITY_LOGIT, ROTATION};
use mba_mapper::raster::reference::{
    Cutoff, ReferenceGaussian, ReferenceGradient, ReferenceGradients, ReferenceImage, gradients, render,
};
use mba_tests::raster_scene::{
    Rendered, random_gaussians, random_pixel_gradient, random_view, to_image, to_parameters,
};
use mba_tests::transfer_scene::Uniform;
use mba_tracker::simd::{Level, level_name, levels_up_to};

/// A pixel sums some ten splats of depth up to 4 m; single precision places a splat within 1e-5 px.
const IMAGE_TOLERANCE: f64 = 2e-5;

/// Of the largest entry of the same kind.
const GRADIENT_TOLERANCE: f64 = 3e-5;

/// Smaller than a tile, not a multiple of a tile, several tiles; a count that is not a multiple of the lanes.
const SIZES: [(usize, usize, usize); 3] = [(9, 5, 6), (37, 29, 43), (70, 51, 150)];

fn assert_near(what: &str, got: &[f32], want: impl IntoIterator<Item = f64>, tolerance: f64) {
    let want: Vec<f64> = want.into_iter().collect();
    assert_eq!(got.len(), want.len(), "{what}");
    for (k, (&got, want)) in got.iter().zip(want).enumerate() {
        assert!((f64::from(got) - want).abs() <= tolerance, "{what} {k}: {got} instead of {want}");
    }
}

fn assert_images_agree(got: &Rendered, want: &ReferenceImage) {
    let differ = got.contributions.iter().zip(&want.contributions).filter(|(got, want)| got != want).count();
    assert!(differ == 0, "{differ} pixels composite another number of splats");
    for (k, plane) in got.image.colour.iter().enumerate() {
        assert_near("colour", plane, want.colour.iter().map(|colour| colour[k]), IMAGE_TOLERANCE);
    }
    assert_near("depth", &got.image.depth, want.depth.iter().copied(), IMAGE_TOLERANCE);
    assert_near("alpha", &got.image.alpha, want.alpha.iter().copied(), IMAGE_TOLERANCE);
}

/// A gradient by parameter `k` of a kind, in the units of the map.
type Element = fn(&ReferenceGradient, &ReferenceGaussian, usize) -> f64;

const KINDS: [(&str, usize, usize, Element); 5] = [
    ("mean", MEAN, 3, |g, _, k| g.mean[k]),
    ("log-scale", LOG_SCALE, 3, |g, gaussian, k| g.scale[k] * gaussian.scale[k]),
    ("rotation", ROTATION, 4, |g, _, k| g.rotation[k]),
    ("opacity", OPACITY_LOGIT, 1, |g, gaussian, _| g.opacity * gaussian.opacity * (1.0 - gaussian.opacity)),
    ("colour", COLOUR, 3, |g, _, k| g.colour[k]),
];

fn assert_gradients_agree(got: &Rendered, want: &ReferenceGradients, gaussians: &[ReferenceGaussian]) {
    let planes = got.gradients.parameters.planes();
    let pairs = || want.gaussians.iter().zip(gaussians);
    for (name, first, width, element) in KINDS {
        let of_plane = |k: usize| pairs().map(move |(gradient, gaussian)| element(gradient, gaussian, k));
        let largest = (0..width).flat_map(of_plane).fold(0.0, |largest: f64, x| largest.max(x.abs()));
        for k in 0..width {
            assert_near(name, &planes[first + k], of_plane(k), GRADIENT_TOLERANCE * largest);
        }
    }
    let screen = want.gaussians.iter().map(|gradient| gradient.splat.centre.norm());
    let largest = screen.clone().fold(0.0, f64::max);
    assert_near("screen", &got.gradients.screen, screen, GRADIENT_TOLERANCE * largest);
    let (rotation, translation) = (want.view.rotation, want.view.translation);
    let off_rotation = (got.view.rotation - rotation).amax() / rotation.amax();
    let off_translation = (got.view.translation - translation).amax() / translation.amax();
    assert!(off_rotation.max(off_translation) <= GRADIENT_TOLERANCE, "{off_rotation}, {off_translation}");
}

#[test]
fn every_level_agrees_with_the_oracle() {
    for (seed, (width, height, count)) in SIZES.into_iter().enumerate() {
        let mut uniform = Uniform::new(seed as u64);
        let view = random_view(&mut uniform, width, height);
        let stored: Gaussians =
            random_gaussians(&mut uniform, &view, count).iter().map(to_parameters).collect();
        let gaussians: Vec<ReferenceGaussian> =
            (0..count).filter_map(|i| stored.get(i)).map(|g| ReferenceGaussian::from(&g)).collect();
        let grad_pixels = random_pixel_gradient(&mut uniform, &view);
        let image = render(&gaussians, &view, Cutoff::Hard);
        let want = gradients(&gaussians, &view, &grad_pixels, Cutoff::Hard);
        for level in levels_up_to(Level::new()) {
            println!("{width}x{height}, {}", level_name(level));
            let got = Rendered::new(level, &stored, &view, &to_image(&view, &grad_pixels));
            assert_images_agree(&got, &image);
            assert_gradients_agree(&got, &want, &gaussians);
        }
    }
}
