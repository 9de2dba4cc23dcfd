//! The oracle against golden data and finite differences.

use mba_mapper::raster::reference::{Cutoff, ReferenceGradient, ReferenceGradients, gradients, render};
use mba_tests::raster_golden::{GoldenScene, scenes};

/// The files carry 12 digits of results; inputs are exact but for the view, which becomes a quaternion here.
const TOLERANCE: f64 = 1e-10;

/// The golden files were compared with another renderer at this level, relative to the largest entry.
const GRADIENT_TOLERANCE: f64 = 1e-10;

fn gradients_of(scene: &GoldenScene) -> ReferenceGradients {
    let parts = scene.renderings();
    scene.total(&parts.map(|part| gradients(&part.gaussians, &part.view, &part.grad_pixels, Cutoff::Hard)))
}

#[test]
fn images_are_the_golden_ones() {
    for scene in scenes() {
        let renderings = scene.renderings();
        let [image, depth] = renderings.map(|part| render(&part.gaussians, &part.view, Cutoff::Hard));
        scene.assert_image("rgb", image.colour.iter().flat_map(|c| [c.x, c.y, c.z]), TOLERANCE);
        scene.assert_image("depth", depth.colour.iter().map(|c| c.x), TOLERANCE);
        scene.assert_image("alpha", image.alpha, TOLERANCE);
        scene.assert_image("contributions", image.contributions.into_iter().map(f64::from), 0.0);
    }
}

#[test]
fn gradients_are_the_golden_ones() {
    for scene in scenes() {
        let all = gradients_of(&scene);
        let each = |numbers: fn(&ReferenceGradient) -> Vec<f64>| -> Vec<f64> {
            all.gaussians.iter().flat_map(numbers).collect()
        };
        let check = |key: &str, got: Vec<f64>| scene.assert_gradient(key, got, GRADIENT_TOLERANCE);
        check("means", each(|g| g.mean.iter().copied().collect()));
        check("quats", each(|g| g.rotation.to_vec()));
        check("scales", each(|g| g.scale.iter().copied().collect()));
        check("opacities", each(|g| vec![g.opacity]));
        check("colors", each(|g| g.colour.iter().copied().collect()));
        check("means2d", each(|g| g.splat.centre.iter().copied().collect()));
        check("conics", each(|g| g.splat.conic.to_vec()));
        check("z_depth", each(|g| vec![g.splat.depth]));
    }
}

#[test]
fn pose_gradients_are_the_golden_ones() {
    for scene in scenes() {
        let view = gradients_of(&scene).view;
        let twelve = (0..3).flat_map(|i| {
            [view.rotation[(i, 0)], view.rotation[(i, 1)], view.rotation[(i, 2)], view.translation[i]]
        });
        scene.assert_gradient("view", twelve, GRADIENT_TOLERANCE);
        let camera_from_world = scene.view().world_from_camera.inverse();
        let left = view.left_tangent(&camera_from_world);
        scene.assert_gradient("pose_left", left.iter().copied(), GRADIENT_TOLERANCE);
    }
}
