//! Rows and gradients against finite differences over the twelve pose parameters.

use mba_tests::transfer_scene::TransferScene;
use mba_tracker::simd::Level;
use mba_tracker::trajectory::{ExposureTrajectory, SampleRule, left_from_right};
use mba_tracker::transfer::{
    PATCH_PIXELS, PatchCost, PatchRows, PatchValues, VirtualView, evaluate_cost, linearize, transfer_rows,
    transfer_values, virtual_views,
};
use nalgebra::{SMatrix, SVector};

const VIEWS: usize = 7;

type Tangent = SVector<f64, 12>;

/// Half the distance of the differences, metres or radians: moves pixels by about a tenth of a pixel, much less
/// than a cell and a thousand times the rounding of a sample's position.
const STEP: f64 = 2e-4;

/// For images without kinks: moves pixels by about one pixel.
const LONG_STEP: f64 = 2e-3;

fn views_of(scene: &TransferScene, exposure: &ExposureTrajectory) -> Vec<VirtualView> {
    virtual_views(exposure, VIEWS, SampleRule::Midpoint, &scene.camera).to_vec()
}

/// The views at both ends of a step along one parameter of the project's tangent.
fn views_beside(scene: &TransferScene, parameter: usize, step: f64) -> [Vec<VirtualView>; 2] {
    [step, -step].map(|size| {
        let mut tangent = Tangent::zeros();
        tangent[parameter] = size;
        views_of(scene, &scene.exposure.perturbed(&tangent))
    })
}

/// Turns a derivative by left rotations into one by the project's tangent.
fn right_from_left(scene: &TransferScene, derivative: &Tangent) -> Tangent {
    let mut e = SMatrix::<f64, 12, 12>::zeros();
    let block = |pose: &mba_tracker::geometry::RigidTransform| left_from_right(&pose.rotation_matrix());
    e.fixed_view_mut::<6, 6>(0, 0).copy_from(&block(&scene.exposure.start));
    e.fixed_view_mut::<6, 6>(6, 6).copy_from(&block(&scene.exposure.end));
    e.transpose() * derivative
}

/// Derivative of the mean of every pixel that is valid throughout: (from rows, from finite differences).
fn pixel_derivatives(scene: &TransferScene, step: f64) -> Vec<(Tangent, Tangent)> {
    let level = Level::new();
    let mut rows = vec![PatchRows::default(); scene.sites.len()];
    transfer_rows(level, &scene.problem(), &scene.sites, &mut rows);
    let beside: Vec<[Vec<PatchValues>; 2]> = (0..12)
        .map(|parameter| {
            views_beside(scene, parameter, step).map(|views| {
                let mut values = vec![PatchValues::default(); scene.sites.len()];
                transfer_values(level, &scene.problem_with(&views), &scene.sites, &mut values);
                values
            })
        })
        .collect();
    let mut pairs = Vec::new();
    for (site, rows) in rows.iter().enumerate() {
        for k in 0..PATCH_PIXELS {
            let always_valid = rows.values.valid[k] > 0.0
                && beside.iter().flatten().all(|values| values[site].valid[k] > 0.0);
            if always_valid {
                let left = Tangent::from_fn(|i, _| f64::from(rows.pose[i][k]));
                let difference = Tangent::from_fn(|i, _| {
                    let [after, before] = &beside[i];
                    (f64::from(after[site].mean[k]) - f64::from(before[site].mean[k])) / (2.0 * step)
                });
                pairs.push((right_from_left(scene, &left), difference));
            }
        }
    }
    assert!(pairs.len() > 500, "only {} pixels", pairs.len());
    pairs
}

/// Per parameter: the relative root mean square error, and the slope of differences over rows.
fn agreement(pairs: &[(Tangent, Tangent)], parameter: usize) -> (f64, f64) {
    let (mut error, mut square, mut product) = (0.0, 0.0, 0.0);
    for (row, difference) in pairs {
        error += (row[parameter] - difference[parameter]).powi(2);
        square += row[parameter].powi(2);
        product += row[parameter] * difference[parameter];
    }
    ((error / square).sqrt(), product / square)
}

/// On a ramp the interpolant has no kinks: what remains is the third order of the step and rounding, both far
/// below the bound.
#[test]
fn rows_on_a_ramp_equal_finite_differences() {
    for seed in 0..4 {
        let mut scene = TransferScene::random(seed, 60, VIEWS);
        let (width, height) = (scene.camera.width, scene.camera.height);
        scene.reference = (0..width * height)
            .map(|k| (2 * (k % width) + 3 * (k / width)) as f32 / (2 * width + 3 * height) as f32)
            .collect();
        let pairs = pixel_derivatives(&scene, LONG_STEP);
        for parameter in 0..12 {
            let (error, slope) = agreement(&pairs, parameter);
            assert!(error < 5e-4, "parameter {parameter}: relative error {error:e}");
            assert!((slope - 1.0).abs() < 5e-5, "parameter {parameter}: slope {slope}");
        }
    }
}

/// On a smooth texture a difference straddles cells of different slope: single pixels deviate, their mean does
/// not.
#[test]
fn rows_on_smooth_texture_equal_finite_differences_on_average() {
    for seed in 10..14 {
        let pairs = pixel_derivatives(&TransferScene::random(seed, 60, VIEWS), STEP);
        for parameter in 0..12 {
            let (error, slope) = agreement(&pairs, parameter);
            assert!(error < 0.03, "parameter {parameter}: relative error {error:e}");
            assert!((slope - 1.0).abs() < 3e-3, "parameter {parameter}: slope {slope}");
        }
    }
}

/// The gradient of the robust cost, over sites that stay wholly inside.
#[test]
fn gradient_equals_finite_differences_of_the_cost() {
    let (level, model) = (Level::new(), TransferScene::residual_model());
    for seed in 20..24 {
        let mut scene = TransferScene::random(seed, 300, VIEWS);
        let mut patches = vec![PatchCost::default(); scene.sites.len()];
        linearize(level, &scene.problem(), &scene.sites, &model, &mut patches);
        let mut whole = patches.iter().map(|patch| patch.pixels == PATCH_PIXELS as f32);
        scene.sites.retain(|_| whole.next().unwrap_or(false));
        let (w, h) = (scene.camera.width as i16, scene.camera.height as i16);
        scene.sites.retain(|site| site.u > 60 && site.v > 60 && site.u < w - 60 && site.v < h - 60);
        let cost = |views: &[VirtualView]| {
            let mut patches = vec![PatchCost::default(); scene.sites.len()];
            evaluate_cost(level, &scene.problem_with(views), &scene.sites, &model, &mut patches);
            // The total is rounded to f32; its parts are summed here in f64.
            patches.iter().map(|patch| f64::from(patch.cost)).sum::<f64>()
        };
        let difference = Tangent::from_fn(|i, _| {
            let [after, before] = views_beside(&scene, i, STEP);
            (cost(&after) - cost(&before)) / (2.0 * STEP)
        });
        let sums = linearize(level, &scene.problem(), &scene.sites, &model, &mut patches);
        let gradient = right_from_left(&scene, &sums.gradient.fixed_rows::<12>(0).into_owned());
        let error = (gradient - difference).norm() / gradient.norm();
        assert!(scene.sites.len() > 50 && error < 0.02, "relative error {error:e}");
    }
}
