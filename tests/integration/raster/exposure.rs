//! Blurred images against the mean of the oracle's views, and gradients by both ends of the exposure.

use mba_mapper::exposure::{ExposurePath, ExposureRenderer, ExposureScratch, PATH_PARAMETERS};
use mba_mapper::gaussians::{COLOUR, Gaussians, LOG_SCALE, MEAN, OPACITY_LOGIT};
use mba_mapper::raster::reference::{
    Cutoff, ReferenceGaussian, ReferenceGradients, ReferenceImage, ReferencePixelGradient, gradients, render,
};
use mba_mapper::raster::{GaussianGradients, RasterImage, RasterView};
use mba_tests::raster_scene::{
    Rendered, random_gaussians, random_pixel_gradient, random_view, to_image, to_parameters,
};
use mba_tests::transfer_scene::Uniform;
use mba_tracker::simd::Level;
use mba_tracker::trajectory::ExposureTrajectory;
use nalgebra::{SMatrix, SVector, Vector3, Vector6};

/// See the tolerances of single views: errors of the views do not add up in their mean.
const IMAGE_TOLERANCE: f64 = 2e-5;

/// Of the largest entry of the same kind.
const GRADIENT_TOLERANCE: f64 = 3e-5;

struct Scene {
    view: RasterView,
    path: ExposurePath,
    truth: Vec<ReferenceGaussian>,
    gaussians: Gaussians,
    grad_pixels: ReferencePixelGradient,
}

/// What the fast path makes of an exposure.
#[derive(Debug, PartialEq)]
struct Exposed {
    image: RasterImage,
    gradients: GaussianGradients,
    grad_path: SVector<f64, PATH_PARAMETERS>,
    drawn: Vec<bool>,
}

impl Scene {
    /// A camera that moves a few centimetres and degrees: some ten pixels.
    fn new(seed: u64, size: [usize; 2], count: usize) -> Self {
        let mut uniform = Uniform::new(seed);
        let view = random_view(&mut uniform, size[0], size[1]);
        let truth = random_gaussians(&mut uniform, &view, count);
        let gaussians: Gaussians = truth.iter().map(to_parameters).collect();
        let grad_pixels = random_pixel_gradient(&mut uniform, &view);
        let motion = Vector6::from_fn(|_, _| uniform.within(-0.1, 0.1));
        let ends = ExposureTrajectory::from_mid_and_motion(&view.world_from_camera, &motion);
        let path = ExposurePath { ends, bow: motion * 0.1 };
        Self { view, path, truth, gaussians, grad_pixels }
    }

    fn exposed(&self, views: usize) -> Exposed {
        let renderer = ExposureRenderer::new(Level::new());
        let (mut scratch, mut image) = (ExposureScratch::default(), RasterImage::default());
        let RasterView { camera, background, .. } = &self.view;
        let (map, path) = (&self.gaussians, &self.path);
        let mut tape = renderer.forward(map, camera, path, views, *background, &mut scratch, &mut image);
        let mut gradients = GaussianGradients::zeros(self.gaussians.len());
        let grad_image = to_image(&self.view, &self.grad_pixels);
        let grad_path = tape.backward(&grad_image, &mut gradients);
        Exposed { image, gradients, grad_path, drawn: scratch.drawn_mask().to_vec() }
    }

    /// The views of the oracle, at the middles of equal parts of the exposure, and the gradient by each.
    fn virtual_views(
        &self,
        views: usize,
    ) -> impl Iterator<Item = (f64, RasterView, ReferencePixelGradient)> + '_ {
        (0..views).map(move |k| {
            let time = (2 * k + 1) as f64 / (2 * views) as f64;
            let view = RasterView { world_from_camera: self.path.at(time), ..self.view };
            let mut grad_pixels = self.grad_pixels.clone();
            grad_pixels.colour.iter_mut().for_each(|colour| *colour /= views as f64);
            if 2 * k + 1 != views {
                grad_pixels.depth.fill(0.0);
                grad_pixels.alpha.fill(0.0);
            }
            (time, view, grad_pixels)
        })
    }

    fn oracle_image(&self, views: usize, cutoff: Cutoff) -> ReferenceImage {
        let images: Vec<ReferenceImage> =
            self.virtual_views(views).map(|(_, view, _)| render(&self.truth, &view, cutoff)).collect();
        let mean = |pixel: usize| images.iter().map(|i| i.colour[pixel]).sum::<Vector3<f64>>() / views as f64;
        let mid = images[views / 2].clone();
        ReferenceImage { colour: (0..mid.depth.len()).map(mean).collect(), ..mid }
    }
}

fn assert_near(what: &str, got: &[f32], want: impl IntoIterator<Item = f64>, tolerance: f64) {
    let want: Vec<f64> = want.into_iter().collect();
    assert_eq!(got.len(), want.len(), "{what}");
    for (k, (&got, want)) in got.iter().zip(want).enumerate() {
        assert!((f64::from(got) - want).abs() <= tolerance, "{what} {k}: {got} instead of {want}");
    }
}

#[test]
fn the_image_is_the_mean_of_the_oracles_views() {
    let scene = Scene::new(1, [70, 51], 60);
    for (asked, views) in [(0, 1), (1, 1), (2, 3), (3, 3), (4, 5)] {
        let (got, want) = (scene.exposed(asked).image, scene.oracle_image(views, Cutoff::Hard));
        for (k, plane) in got.colour.iter().enumerate() {
            assert_near("colour", plane, want.colour.iter().map(|colour| colour[k]), IMAGE_TOLERANCE);
        }
        assert_near("depth", &got.depth, want.depth, IMAGE_TOLERANCE);
        assert_near("alpha", &got.alpha, want.alpha, IMAGE_TOLERANCE);
    }
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
fn gradients_are_the_sums_over_the_oracles_views() {
    let (scene, views) = (Scene::new(2, [70, 51], 60), 3);
    let got = scene.exposed(views);
    let mut colour = vec![Vector3::zeros(); 60];
    let mut mean = vec![Vector3::zeros(); 60];
    let (mut opacity, mut screen) = (vec![0.0; 60], vec![0.0; 60]);
    let mut grad_path = SMatrix::<f64, PATH_PARAMETERS, 1>::zeros();
    for (time, view, grad_pixels) in scene.virtual_views(views) {
        let ReferenceGradients { gaussians, view: grad_view } =
            gradients(&scene.truth, &view, &grad_pixels, Cutoff::Hard);
        grad_path += pose_by_path(&scene.path, time).transpose() * grad_view.tangent(&view.world_from_camera);
        for (k, gradient) in gaussians.iter().enumerate() {
            colour[k] += gradient.colour;
            mean[k] += gradient.mean;
            let at = scene.truth[k].opacity;
            opacity[k] += gradient.opacity * at * (1.0 - at);
            screen[k] += gradient.splat.centre.norm();
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
    for (name, got, want) in
        [("opacity", &planes[OPACITY_LOGIT], opacity), ("screen", &got.gradients.screen, screen)]
    {
        let largest = want.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
        assert_near(name, got, want, GRADIENT_TOLERANCE * largest);
    }
    let ends = got.grad_path.iter();
    for (k, (got, want)) in ends.zip(&grad_path).enumerate() {
        assert!((got - want).abs() <= GRADIENT_TOLERANCE * grad_path.amax(), "end {k}: {got}, not {want}");
    }
}

/// A loss that changes slowly over the image: what enters and leaves at the faintest rims of the splats, which no
/// gradient knows, then nearly cancels.
fn smooth_loss(scene: &mut Scene) {
    let width = scene.view.camera.width;
    let wave = |pixel: usize, k: usize| {
        ((pixel % width) as f64 * 0.02 + (pixel / width) as f64 * 0.03 + k as f64).sin()
    };
    let pixels = scene.grad_pixels.depth.len();
    scene.grad_pixels.colour = (0..pixels).map(|pixel| Vector3::from_fn(|k, _| wave(pixel, k))).collect();
    scene.grad_pixels.depth = (0..pixels).map(|pixel| wave(pixel, 3)).collect();
    scene.grad_pixels.alpha = (0..pixels).map(|pixel| wave(pixel, 4)).collect();
}

fn loss(scene: &Scene, views: usize) -> f64 {
    let (image, grad_image) = (scene.exposed(views).image, to_image(&scene.view, &scene.grad_pixels));
    let products =
        |a: &[f32], b: &[f32]| -> f64 { a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum() };
    let colour: f64 = image.colour.iter().zip(&grad_image.colour).map(|(a, b)| products(a, b)).sum();
    colour + products(&image.depth, &grad_image.depth) + products(&image.alpha, &grad_image.alpha)
}

/// Checks slopes against gradients; what crosses the rims moves a slope by up to 2.5 % of the largest.
fn check_slopes(what: &str, got: &[f64], mut moved: impl FnMut(usize, f64) -> f64) {
    const STEP: f64 = 2e-3;
    let slopes: Vec<f64> =
        (0..got.len()).map(|k| (moved(k, STEP) - moved(k, -STEP)) / (2.0 * STEP)).collect();
    let largest = slopes.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    for (k, (got, want)) in got.iter().zip(&slopes).enumerate() {
        assert!((got - want).abs() <= 0.04 * largest, "{what} {k}: {got} instead of {want} of {slopes:?}");
    }
}

#[test]
fn gradients_are_the_slopes_of_the_loss() {
    let mut scene = Scene::new(3, [96, 80], 30);
    smooth_loss(&mut scene);
    let got = scene.exposed(3);
    let path = scene.path;
    let ends: Vec<f64> = got.grad_path.iter().copied().collect();
    check_slopes("end", &ends, |k, step| {
        scene.path = path.perturbed(&SMatrix::from_fn(|i, _| if i == k { step } else { 0.0 }));
        loss(&scene, 3)
    });
    scene.path = path;
    let before = scene.gaussians.clone();
    for plane in [MEAN, MEAN + 2, LOG_SCALE + 1, COLOUR] {
        let of_plane: Vec<f64> =
            got.gradients.parameters.planes()[plane].iter().copied().map(f64::from).collect();
        check_slopes("plane", &of_plane, |k, step| {
            scene.gaussians = before.clone();
            scene.gaussians.planes_mut().planes[plane][k] += step as f32;
            loss(&scene, 3)
        });
    }
}

#[test]
fn one_view_is_plain_rendering_at_mid_exposure() {
    let mut scene = Scene::new(4, [60, 40], 50);
    scene.path = ExposurePath::linear(scene.path.ends);
    let view = RasterView { world_from_camera: scene.path.mid(), ..scene.view };
    let grad_image = to_image(&scene.view, &scene.grad_pixels);
    let plain = Rendered::new(Level::new(), &scene.gaussians, &view, &grad_image);
    let exposed = scene.exposed(1);
    assert!(exposed.image == plain.image && exposed.gradients == plain.gradients);
    let grad_pose = plain.view.tangent(&view.world_from_camera);
    let whole = exposed.grad_path.fixed_rows::<6>(0) + exposed.grad_path.fixed_rows::<6>(6);
    assert!((whole - grad_pose).amax() <= 1e-9 * grad_pose.amax(), "{whole} instead of {grad_pose}");
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let scene = Scene::new(5, [131, 90], 3000);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
        pool.install(|| scene.exposed(5))
    };
    let one = with(1);
    assert!(one.gradients.screen.iter().sum::<f32>() > 1.0, "there is no gradient");
    for threads in [2, 5] {
        assert!(with(threads) == one, "{threads} threads give another result than one");
    }
}

#[test]
fn used_memory_does_not_matter() {
    let renderer = ExposureRenderer::new(Level::new());
    let (mut scratch, mut image) = (ExposureScratch::default(), RasterImage::default());
    for (seed, width, count, views) in [(1, 131, 900, 5), (2, 40, 17, 1), (3, 90, 800, 7), (4, 40, 0, 3)] {
        let scene = Scene::new(seed, [width, 50], count);
        let RasterView { camera, background, .. } = &scene.view;
        let (map, path) = (&scene.gaussians, &scene.path);
        let mut tape = renderer.forward(map, camera, path, views, *background, &mut scratch, &mut image);
        let mut gradients = GaussianGradients::zeros(count);
        let grad_image = to_image(&scene.view, &scene.grad_pixels);
        let grad_path = tape.backward(&grad_image, &mut gradients);
        let fresh = scene.exposed(views);
        assert!(
            image == fresh.image && gradients == fresh.gradients && grad_path == fresh.grad_path,
            "{seed}"
        );
        assert!(scratch.drawn_mask() == fresh.drawn, "scene {seed}");
    }
}

#[test]
fn only_what_is_drawn_in_a_view_gets_gradients() {
    let scene = Scene::new(6, [60, 40], 200);
    let exposed = scene.exposed(3);
    let mid = scene.exposed(1);
    let count = |drawn: &[bool]| drawn.iter().filter(|&&drawn| drawn).count();
    assert!(count(&mid.drawn) < count(&exposed.drawn), "the motion shows nothing new");
    assert!(count(&exposed.drawn) < 200, "everything is drawn");
    let planes = exposed.gradients.parameters.planes();
    for (k, _) in exposed.drawn.iter().enumerate().filter(|(_, drawn)| !**drawn) {
        assert!(planes.iter().all(|plane| plane[k] == 0.0), "Gaussian {k} is not drawn");
    }
}

#[test]
#[should_panic(expected = "the size of the exposure that was rendered before")]
fn images_of_another_size_are_refused() {
    let scene = Scene::new(7, [60, 40], 20);
    let renderer = ExposureRenderer::new(Level::new());
    let (mut scratch, mut image) = (ExposureScratch::default(), RasterImage::default());
    let RasterView { camera, background, .. } = &scene.view;
    let (map, path) = (&scene.gaussians, &scene.path);
    let mut tape = renderer.forward(map, camera, path, 3, *background, &mut scratch, &mut image);
    tape.backward(&RasterImage::zeros(40, 60), &mut GaussianGradients::zeros(20));
}
