//! The fast path against golden data, at every SIMD level.

use mba_mapper::gaussians::{COLOUR, Gaussians, LOG_SCALE, MEAN, OPACITY_LOGIT, ROTATION};
use mba_mapper::raster::reference::{
    ReferenceGaussian, ReferenceGradient, ReferenceGradients, SplatGradient,
};
use mba_tests::raster_golden::{GoldenScene, scenes};
use mba_tests::raster_scene::{Rendered, to_image, to_parameters};
use mba_tracker::simd::{Level, level_name, levels_up_to};
use nalgebra::Vector3;

/// Times the error of another renderer in f32.
const SLACK: f64 = 3.0;

/// Checks the two renderings of every scene at every level.
fn for_every_level_and_scene(check: impl Fn(&GoldenScene, &[Rendered; 2])) {
    for scene in scenes() {
        for level in levels_up_to(Level::new()) {
            println!("{}", level_name(level));
            let rendered = scene.renderings().map(|part| {
                let gaussians: Gaussians = part.gaussians.iter().map(to_parameters).collect();
                Rendered::new(level, &gaussians, &part.view, &to_image(&part.view, &part.grad_pixels))
            });
            check(&scene, &rendered);
        }
    }
}

/// The gradients by the parameters of the formulas.
fn gradients(rendered: &Rendered, gaussians: &[ReferenceGaussian]) -> ReferenceGradients {
    let planes = rendered.gradients.parameters.planes();
    let of = |(i, gaussian): (usize, &ReferenceGaussian)| {
        let number = |plane: usize| f64::from(planes[plane][i]);
        let triple = |first: usize| Vector3::from_fn(|k, _| number(first + k));
        ReferenceGradient {
            mean: triple(MEAN),
            scale: triple(LOG_SCALE).component_div(&gaussian.scale),
            rotation: core::array::from_fn(|k| number(ROTATION + k)),
            opacity: number(OPACITY_LOGIT) / (gaussian.opacity * (1.0 - gaussian.opacity)),
            colour: triple(COLOUR),
            splat: SplatGradient::default(),
        }
    };
    ReferenceGradients { gaussians: gaussians.iter().enumerate().map(of).collect(), view: rendered.view }
}

/// The gradients of the loss of a scene.
fn total(scene: &GoldenScene, rendered: &[Rendered; 2]) -> ReferenceGradients {
    let gaussians = scene.gaussians();
    scene.total(&rendered.each_ref().map(|part| gradients(part, &gaussians)))
}

#[test]
fn images_are_the_golden_ones() {
    for_every_level_and_scene(|scene, [rendered, depth]| {
        let (image, errors) = (&rendered.image, &scene.float_errors);
        let [red, green, blue] = &image.colour;
        let colour = (0..red.len()).flat_map(|k| [red[k], green[k], blue[k]]);
        scene.assert_image("rgb", colour.map(f64::from), SLACK * errors.colour);
        let depth = depth.image.colour[0].iter().copied().map(f64::from);
        scene.assert_image("depth", depth, SLACK * errors.depth);
        scene.assert_image("alpha", image.alpha.iter().copied().map(f64::from), SLACK * errors.colour);
        scene.assert_image("contributions", rendered.contributions.iter().copied().map(f64::from), 0.0);
    });
}

#[test]
fn gradients_are_the_golden_ones() {
    for_every_level_and_scene(|scene, rendered| {
        let all = total(scene, rendered).gaussians;
        let errors = &scene.float_errors;
        let check = |key: &str, error: f64, numbers: fn(&ReferenceGradient) -> Vec<f64>| {
            scene.assert_gradient(key, all.iter().flat_map(numbers), SLACK * error);
        };
        check("means", errors.means, |g| g.mean.iter().copied().collect());
        check("quats", errors.rotations, |g| g.rotation.to_vec());
        check("scales", errors.scales, |g| g.scale.iter().copied().collect());
        check("opacities", errors.opacities, |g| vec![g.opacity]);
        check("colors", errors.colours, |g| g.colour.iter().copied().collect());
    });
}

#[test]
fn pose_gradients_are_the_golden_ones() {
    for_every_level_and_scene(|scene, rendered| {
        let view = total(scene, rendered).view;
        let rows = (0..3).flat_map(|i| {
            [view.rotation[(i, 0)], view.rotation[(i, 1)], view.rotation[(i, 2)], view.translation[i]]
        });
        scene.assert_gradient("view", rows, SLACK * scene.float_errors.view);
        let left = view.left_tangent(&scene.view().world_from_camera.inverse());
        scene.assert_gradient("pose_left", left.iter().copied(), SLACK * scene.float_errors.pose_left);
    });
}
