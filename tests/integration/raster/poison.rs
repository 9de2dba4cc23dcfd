//! Parameters without meaning never reach a pixel or a gradient.

use mba_mapper::gaussians::{Gaussian, Gaussians, LOG_SCALE, PARAMETERS, ROTATION};
use mba_mapper::raster::reference::ReferenceGaussian;
use mba_mapper::raster::{RasterImage, RasterView};
use mba_tests::raster_scene::{
    Rendered, random_gaussians, random_pixel_gradient, random_view, to_image, to_parameters,
};
use mba_tests::transfer_scene::Uniform;
use mba_tracker::simd::{Level, levels_up_to};

const SANE: usize = 21;

const NOT_FINITE: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

const EXTREME: [f32; 8] = [f32::MAX, f32::MIN, 1e30, -1e30, 1e15, -1e15, f32::MIN_POSITIVE, 1e-42];

struct Scene {
    view: RasterView,
    sane: Gaussians,
    grad_image: RasterImage,
}

impl Scene {
    fn new() -> Self {
        let mut uniform = Uniform::new(3);
        let view = random_view(&mut uniform, 40, 30);
        let sane: Vec<ReferenceGaussian> = random_gaussians(&mut uniform, &view, SANE);
        let grad_image = to_image(&view, &random_pixel_gradient(&mut uniform, &view));
        Self { view, sane: sane.iter().map(to_parameters).collect(), grad_image }
    }

    fn render(&self, level: Level, gaussians: &Gaussians) -> Rendered {
        Rendered::new(level, gaussians, &self.view, &self.grad_image)
    }

    /// The sane Gaussians and behind them copies of the first of which one parameter is `value`.
    fn with(&self, value: f32) -> Gaussians {
        let mut gaussians = self.sane.clone();
        let first = self.sane.get(0).expect("there are sane Gaussians").to_array();
        for k in 0..PARAMETERS {
            let mut poisoned = first;
            poisoned[k] = value;
            gaussians.push(&Gaussian::from_array(poisoned));
        }
        gaussians
    }
}

fn assert_finite(rendered: &Rendered, value: f32) {
    let image = &rendered.image;
    let planes = image.colour.iter().chain([&image.depth, &image.alpha]);
    let gradients = rendered.gradients.parameters.planes().iter().chain([&rendered.gradients.screen]);
    assert!(planes.chain(gradients).flatten().all(|x| x.is_finite()), "{value} got through");
    assert!(rendered.view.rotation.iter().chain(&rendered.view.translation).all(|x| x.is_finite()));
}

#[test]
fn what_is_not_finite_changes_nothing() {
    let scene = Scene::new();
    for level in levels_up_to(Level::new()) {
        let want = scene.render(level, &scene.sane);
        for value in NOT_FINITE {
            let mut got = scene.render(level, &scene.with(value));
            for plane in got.gradients.parameters.planes() {
                assert!(plane[SANE..].iter().all(|&x| x == 0.0), "{value} got a gradient");
            }
            got.gradients.parameters.resize(SANE);
            got.gradients.screen.truncate(SANE);
            // The number of pieces over which the pose is summed differs.
            assert!((got.view.rotation - want.view.rotation).amax() <= 1e-4 * want.view.rotation.amax());
            got.view = want.view;
            assert!(got == want, "{value} changes the image or a gradient");
        }
    }
}

#[test]
fn extreme_values_stay_finite() {
    let scene = Scene::new();
    for level in levels_up_to(Level::new()) {
        for value in EXTREME.into_iter().chain([0.0, -100.0, 100.0]) {
            assert_finite(&scene.render(level, &scene.with(value)), value);
        }
    }
}

#[test]
fn degenerate_shapes_stay_finite() {
    let scene = Scene::new();
    let first = scene.sane.get(0).expect("there are sane Gaussians").to_array();
    let all = |first_plane: usize, width: usize, value: f32| {
        let mut values = first;
        values[first_plane..first_plane + width].fill(value);
        Gaussian::from_array(values)
    };
    let shapes = [
        all(ROTATION, 4, 0.0),
        all(ROTATION, 4, 1e-30),
        all(LOG_SCALE, 3, -80.0),
        all(LOG_SCALE, 3, -1000.0),
        all(LOG_SCALE, 3, 30.0),
        all(LOG_SCALE, 3, 88.0),
    ];
    for level in levels_up_to(Level::new()) {
        for shape in &shapes {
            let gaussians: Gaussians = (0..SANE).filter_map(|i| scene.sane.get(i)).chain([*shape]).collect();
            assert_finite(&scene.render(level, &gaussians), shape.log_scale[0]);
        }
    }
}
