//! Pictures whose rows are exposed one after the other, against the oracle's views of each row, and their gradients.

use mba_mapper::exposure::{ExposurePath, ExposureRenderer, ExposureScratch, PATH_PARAMETERS, RowTimes};
use mba_mapper::gaussians::{COLOUR, Gaussians, MEAN, OPACITY_LOGIT};
use mba_mapper::raster::reference::{Cutoff, ReferenceGaussian, ReferencePixelGradient, gradients, render};
use mba_mapper::raster::{GaussianGradients, RasterImage, RasterView};
use mba_tests::raster_scene::{
    random_gaussians, random_pixel_gradient, random_view, to_image, to_parameters,
};
use mba_tests::transfer_scene::Uniform;
use mba_tracker::simd::Level;
use mba_tracker::trajectory::ExposureTrajectory;
use nalgebra::{SMatrix, SVector, Vector3, Vector6};

/// Columns and rows: three and a quarter rows of tiles.
const SIZE: [usize; 2] = [70, 52];
const COUNT: usize = 60;
/// Views of a row, and those of all rows together: three times as long.
const VIEWS: usize = 3;
const ALL_VIEWS: usize = 9;

/// As of single views.
const IMAGE_TOLERANCE: f64 = 2e-5;
/// Of the largest entry of the same kind.
const GRADIENT_TOLERANCE: f64 = 3e-5;

/// A third of the path is exposed, rows take two thirds, from the bottom up; depth is late.
const TIMES: RowTimes =
    RowTimes { exposure: 1.0 / 3.0, readout: -2.0 / 3.0, depth_offset: 0.25, depth_readout: 0.0 };

struct Scene {
    view: RasterView,
    path: ExposurePath,
    truth: Vec<ReferenceGaussian>,
    gaussians: Gaussians,
    grad_pixels: ReferencePixelGradient,
}

struct Exposed {
    image: RasterImage,
    gradients: GaussianGradients,
    grad_path: SVector<f64, PATH_PARAMETERS>,
}

impl Scene {
    fn new(seed: u64) -> Self {
        let mut uniform = Uniform::new(seed);
        let view = random_view(&mut uniform, SIZE[0], SIZE[1]);
        let truth = random_gaussians(&mut uniform, &view, COUNT);
        let gaussians = truth.iter().map(to_parameters).collect();
        let grad_pixels = random_pixel_gradient(&mut uniform, &view);
        let motion = Vector6::from_fn(|_, _| uniform.within(-0.1, 0.1));
        let ends = ExposureTrajectory::from_mid_and_motion(&view.world_from_camera, &motion);
        let bow = Vector6::from_fn(|_, _| uniform.within(-0.02, 0.02));
        Self { view, path: ExposurePath { ends, bow }, truth, gaussians, grad_pixels }
    }

    fn exposed(&self, times: &RowTimes, views: usize) -> Exposed {
        let renderer = ExposureRenderer::new(Level::new());
        let (mut scratch, mut image) = (ExposureScratch::default(), RasterImage::default());
        let RasterView { camera, background, .. } = &self.view;
        let (map, path) = (&self.gaussians, &self.path);
        let (scratch, target) = (&mut scratch, &mut image);
        let mut tape = renderer.forward_rows(map, camera, path, times, views, *background, scratch, target);
        let mut gradients = GaussianGradients::zeros(map.len());
        let grad_image = to_image(&self.view, &self.grad_pixels);
        let grad_path = tape.backward(&grad_image, &mut gradients);
        Exposed { image, gradients, grad_path }
    }

    fn seen_at(&self, time: f64) -> RasterView {
        RasterView { world_from_camera: self.path.at(time), ..self.view }
    }

    /// Path times of the views of colour.
    fn times() -> [f64; ALL_VIEWS] {
        core::array::from_fn(|k| (2 * k + 1) as f64 / (2 * ALL_VIEWS) as f64)
    }

    /// Share of view `k` in row `v`: how much of the row's exposure lies in the k-th part of the path.
    fn share(k: usize, v: usize) -> f64 {
        let middle = 0.5 - (2.0 / 3.0) * ((v as f64 + 0.5) / SIZE[1] as f64 - 0.5);
        let (open, close) = (middle - 1.0 / 6.0, middle + 1.0 / 6.0);
        let part = [k, k + 1].map(|edge| edge as f64 / ALL_VIEWS as f64);
        (close.min(part[1]) - open.max(part[0])).max(0.0) * 3.0
    }

    /// The gradient by the pixels that a view of colour gets.
    fn colour_share(&self, k: usize) -> ReferencePixelGradient {
        let share = |(pixel, colour): (usize, &Vector3<f64>)| colour * Self::share(k, pixel / SIZE[0]);
        let none = vec![0.0; SIZE[0] * SIZE[1]];
        let colour = self.grad_pixels.colour.iter().enumerate().map(share).collect();
        ReferencePixelGradient { colour, depth: none.clone(), alpha: none }
    }
}

fn assert_near(what: &str, got: &[f32], want: impl Iterator<Item = f64>, tolerance: f64) {
    for (k, (&got, want)) in got.iter().zip(want).enumerate() {
        assert!((f64::from(got) - want).abs() <= tolerance, "{what} {k}: {got} instead of {want}");
    }
}

#[test]
fn every_row_is_the_mean_of_the_oracles_views_of_its_own_exposure() {
    let scene = Scene::new(1);
    let got = scene.exposed(&TIMES, VIEWS).image;
    let views = Scene::times().map(|time| render(&scene.truth, &scene.seen_at(time), Cutoff::Hard));
    let colour = |pixel: usize| -> Vector3<f64> {
        let shares = views.iter().enumerate().map(|(k, view)| (Scene::share(k, pixel / SIZE[0]), view));
        shares.map(|(share, view)| view.colour[pixel] * share).sum()
    };
    for (channel, plane) in got.colour.iter().enumerate() {
        assert_near("colour", plane, (0..plane.len()).map(|pixel| colour(pixel)[channel]), IMAGE_TOLERANCE);
    }
    let depth = render(&scene.truth, &scene.seen_at(0.75), Cutoff::Hard);
    assert_near("depth", &got.depth, depth.depth.into_iter(), IMAGE_TOLERANCE);
    assert_near("alpha", &got.alpha, depth.alpha.into_iter(), IMAGE_TOLERANCE);
}

#[test]
fn depth_that_rolls_is_that_of_the_middle_of_each_band() {
    let scene = Scene::new(1);
    let times = RowTimes { depth_readout: 0.4, ..TIMES };
    let got = scene.exposed(&times, VIEWS).image;
    for band in 0..4 {
        let (top, end) = (16 * band, (16 * band + 16).min(SIZE[1]));
        let time = 0.75 + 0.4 * (0.5 * (top + end) as f64 / SIZE[1] as f64 - 0.5);
        let want = render(&scene.truth, &scene.seen_at(time), Cutoff::Hard);
        let pixels = top * SIZE[0]..end * SIZE[0];
        assert_near("depth", &got.depth[pixels.clone()], want.depth[pixels].iter().copied(), IMAGE_TOLERANCE);
    }
}

#[test]
fn one_exposure_for_all_rows_is_the_same_bit_for_bit() {
    let scene = Scene::new(2);
    let rows = scene.exposed(&RowTimes::GLOBAL, 5);
    let renderer = ExposureRenderer::new(Level::new());
    let (mut scratch, mut image) = (ExposureScratch::default(), RasterImage::default());
    let RasterView { camera, background, .. } = &scene.view;
    // Memory that has seen rows before.
    renderer.forward_rows(
        &scene.gaussians,
        camera,
        &scene.path,
        &TIMES,
        VIEWS,
        *background,
        &mut scratch,
        &mut image,
    );
    let (map, path) = (&scene.gaussians, &scene.path);
    let mut tape = renderer.forward(map, camera, path, 5, *background, &mut scratch, &mut image);
    let mut gradients = GaussianGradients::zeros(COUNT);
    let grad_image = to_image(&scene.view, &scene.grad_pixels);
    let grad_path = tape.backward(&grad_image, &mut gradients);
    assert!(image == rows.image && gradients == rows.gradients && grad_path == rows.grad_path);
}

/// Derivative of the pose at `time` by the parameters of the path, by central differences.
fn pose_by_path(path: &ExposurePath, time: f64) -> SMatrix<f64, 6, PATH_PARAMETERS> {
    const STEP: f64 = 1e-6;
    let pose = path.at(time);
    let mut jacobian = SMatrix::<f64, 6, PATH_PARAMETERS>::zeros();
    for k in 0..PATH_PARAMETERS {
        let tangent = SMatrix::<f64, PATH_PARAMETERS, 1>::from_fn(|i, _| if i == k { STEP } else { 0.0 });
        let moved = |sign: f64| pose.tangent_to(&path.perturbed(&(tangent * sign)).at(time));
        jacobian.set_column(k, &((moved(1.0) - moved(-1.0)) / (2.0 * STEP)));
    }
    jacobian
}

#[test]
fn gradients_are_the_sums_over_the_oracles_views_of_all_rows() {
    let scene = Scene::new(2);
    let got = scene.exposed(&TIMES, VIEWS);
    let none = vec![Vector3::zeros(); SIZE[0] * SIZE[1]];
    let of_depth = ReferencePixelGradient { colour: none, ..scene.grad_pixels.clone() };
    let of_colour = Scene::times().into_iter().enumerate().map(|(k, time)| (time, scene.colour_share(k)));
    let mut mean = vec![Vector3::zeros(); COUNT];
    let mut colour = vec![Vector3::zeros(); COUNT];
    let mut opacity = vec![0.0; COUNT];
    let mut grad_path = SMatrix::<f64, PATH_PARAMETERS, 1>::zeros();
    for (time, grad_pixels) in of_colour.chain([(0.75, of_depth)]) {
        let view = scene.seen_at(time);
        let found = gradients(&scene.truth, &view, &grad_pixels, Cutoff::Hard);
        grad_path +=
            pose_by_path(&scene.path, time).transpose() * found.view.tangent(&view.world_from_camera);
        for (k, gradient) in found.gaussians.iter().enumerate() {
            mean[k] += gradient.mean;
            colour[k] += gradient.colour;
            let at = scene.truth[k].opacity;
            opacity[k] += gradient.opacity * at * (1.0 - at);
        }
    }
    let planes = got.gradients.parameters.planes();
    let largest = |vectors: &[Vector3<f64>]| vectors.iter().map(Vector3::amax).fold(0.0, f64::max);
    for k in 0..3 {
        let tolerance = GRADIENT_TOLERANCE * largest(&mean);
        assert_near("mean", &planes[MEAN + k], mean.iter().map(|g| g[k]), tolerance);
        let tolerance = GRADIENT_TOLERANCE * largest(&colour);
        assert_near("colour", &planes[COLOUR + k], colour.iter().map(|g| g[k]), tolerance);
    }
    let tolerance = GRADIENT_TOLERANCE * opacity.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    assert_near("opacity", &planes[OPACITY_LOGIT], opacity.into_iter(), tolerance);
    for (k, (got, want)) in got.grad_path.iter().zip(&grad_path).enumerate() {
        let tolerance = GRADIENT_TOLERANCE * grad_path.amax();
        assert!((got - want).abs() <= tolerance, "parameter {k}: {got}, not {want}");
    }
}
