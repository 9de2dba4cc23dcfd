//! The fast path against golden data, at every SIMD level.

use mba_mapper::gaussians::{COLOUR, Gaussians, LOG_SCALE, MEAN, OPACITY_LOGIT, ROTATION};
use mba_mapper::raster::reference::ReferenceGaussian;
use mba_tests::raster_golden::{GoldenScene, scenes};
use mba_tests::raster_scene::{Rendered, to_image, to_parameters};
use mba_tracker::simd::{Level, level_name, levels_up_to};

/// Times the error of another renderer in f32.
const SLACK: f64 = 3.0;

fn for_every_level_and_scene(check: impl Fn(&GoldenScene, &Rendered)) {
    for scene in scenes() {
        let gaussians: Gaussians = scene.gaussians().iter().map(to_parameters).collect();
        let by_image = to_image(&scene.view(), &scene.pixel_gradient());
        for level in levels_up_to(Level::new()) {
            println!("{}", level_name(level));
            check(&scene, &Rendered::new(level, &gaussians, &scene.view(), &by_image));
        }
    }
}

#[test]
fn images_are_the_golden_ones() {
    for_every_level_and_scene(|scene, rendered| {
        let (image, errors) = (&rendered.image, &scene.float_errors);
        let [red, green, blue] = &image.colour;
        let colour = (0..red.len()).flat_map(|k| [red[k], green[k], blue[k]]);
        scene.assert_image("rgb", colour.map(f64::from), SLACK * errors.colour);
        scene.assert_image("depth", image.depth.iter().copied().map(f64::from), SLACK * errors.depth);
        scene.assert_image("alpha", image.alpha.iter().copied().map(f64::from), SLACK * errors.colour);
        scene.assert_image("contributions", rendered.contributions.iter().copied().map(f64::from), 0.0);
    });
}

#[test]
fn gradients_are_the_golden_ones() {
    for_every_level_and_scene(|scene, rendered| {
        let planes = rendered.gradients.parameters.planes();
        let truth = scene.gaussians();
        let check = |key: &str,
                     first: usize,
                     width: usize,
                     error: f64,
                     unit: fn(&ReferenceGaussian, usize) -> f64| {
            let numbers = truth.iter().enumerate().flat_map(|(i, gaussian)| {
                (0..width).map(move |k| f64::from(planes[first + k][i]) / unit(gaussian, k))
            });
            scene.assert_gradient(key, numbers, SLACK * error);
        };
        let errors = &scene.float_errors;
        check("means", MEAN, 3, errors.means, |_, _| 1.0);
        check("quats", ROTATION, 4, errors.rotations, |_, _| 1.0);
        check("scales", LOG_SCALE, 3, errors.scales, |gaussian, k| gaussian.scale[k]);
        check("opacities", OPACITY_LOGIT, 1, errors.opacities, |gaussian, _| {
            gaussian.opacity * (1.0 - gaussian.opacity)
        });
        check("colors", COLOUR, 3, errors.colours, |_, _| 1.0);
    });
}

#[test]
fn pose_gradients_are_the_golden_ones() {
    for_every_level_and_scene(|scene, rendered| {
        let view = &rendered.view;
        let rows = (0..3).flat_map(|i| {
            [view.rotation[(i, 0)], view.rotation[(i, 1)], view.rotation[(i, 2)], view.translation[i]]
        });
        scene.assert_gradient("view", rows, SLACK * scene.float_errors.view);
        let left = view.left_tangent(&scene.view().world_from_camera.inverse());
        scene.assert_gradient("pose_left", left.iter().copied(), SLACK * scene.float_errors.pose_left);
    });
}
