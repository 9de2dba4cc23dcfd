//! Rows that are exposed one after the other: the gradient by all parameters of a path with bow against finite
//! differences, and a band of the whole image with rows at the same time against the plain kernel.

use mba_tests::transfer_scene::TransferScene;
use mba_tracker::geometry::{PinholeCamera, RigidTransform, so3};
use mba_tracker::simd::{Level, level_name, levels_up_to};
use mba_tracker::trajectory::{BowedTrajectory, FrameTiming};
use mba_tracker::transfer::{
    BOWED_PATH, BowedSums, PATCH_PIXELS, PatchCost, PatchSite, RowBand, RowDelay, TransferProblem,
    VirtualView, evaluate_cost, linearize, linearize_bowed,
};
use nalgebra::{SVector, Vector3, Vector6};

const VIEWS: usize = 5;
const STEP: f64 = 2e-4;
const INVERSE_DEPTH: f64 = 0.4;

type Path = SVector<f64, BOWED_PATH>;

fn timing() -> FrameTiming {
    FrameTiming { exposure: 0.4, readout: 0.6, bands: 8, ..FrameTiming::GLOBAL }
}

fn path(scene: &TransferScene) -> BowedTrajectory {
    let bow = Vector6::new(0.02, -0.01, 0.015, -0.02, 0.03, 0.01);
    BowedTrajectory { bow, ..BowedTrajectory::without_bow(scene.exposure) }
}

/// Nothing, and a change of the acceleration that is as large as it.
const JERKS: [[f64; 6]; 2] = [[0.0; 6], [-0.01, 0.02, 0.01, 0.03, -0.01, 0.02]];

/// The path after a step in the kernel's parameters: left rotations of the ends, right ones of the bow.
fn stepped(path: &BowedTrajectory, step: &Path) -> BowedTrajectory {
    let moved = |pose: &RigidTransform, first: usize| {
        let turn = Vector3::from(step.fixed_rows::<3>(first + 3));
        let shift = Vector3::from(step.fixed_rows::<3>(first));
        RigidTransform::new(so3::exp(&turn) * pose.rotation, pose.translation + shift)
    };
    let mut stepped = *path;
    stepped.linear.start = moved(&path.linear.start, 0);
    stepped.linear.end = moved(&path.linear.end, 6);
    stepped.bow += step.fixed_rows::<6>(12);
    stepped
}

fn problem<'a>(scene: &'a TransferScene, views: &'a [VirtualView], band: RowBand) -> TransferProblem<'a> {
    let step = (timing().readout / scene.camera.height as f64) as f32;
    TransferProblem { rows: RowDelay { centre: band.centre() as f32, step }, ..scene.problem_with(views) }
}

fn views_of_band(
    band: &RowBand,
    path: &BowedTrajectory,
    timing: &FrameTiming,
    camera: &PinholeCamera,
) -> Vec<VirtualView> {
    let mut views = Default::default();
    band.fill_views(path, timing, VIEWS, camera, INVERSE_DEPTH, &mut views);
    views.to_vec()
}

fn bowed_sums(
    level: Level,
    problem: TransferProblem,
    sites: &[PatchSite],
    patches: &mut [PatchCost],
) -> BowedSums {
    let mut parts = Some((problem, 0..sites.len()));
    linearize_bowed(level, &mut parts, sites, &TransferScene::residual_model(), patches)
}

/// Relative errors of the gradient by (the ends, the bow), against differences of the cost in the `index`-th of `bands`.
fn gradient_errors(
    level: Level,
    seed: u64,
    sites: usize,
    (index, bands): (usize, usize),
    jerk: [f64; 6],
) -> [f64; 2] {
    let model = TransferScene::residual_model();
    let mut scene = TransferScene::random(seed, sites, VIEWS);
    let (w, h) = (scene.camera.width, scene.camera.height);
    let band = RowBand::new(index, bands, h);
    let timing = FrameTiming { bands, ..timing() };
    let views_of =
        |path: &BowedTrajectory, scene: &TransferScene| views_of_band(&band, path, &timing, &scene.camera);
    scene.sites.retain(|site| {
        let in_band = (band.first..band.end).contains(&(site.v.max(0) as usize));
        in_band && site.u > 60 && site.u < w as i16 - 60
    });
    let path = BowedTrajectory { jerk: jerk.into(), ..path(&scene) };
    let views = views_of(&path, &scene);
    let mut patches = vec![PatchCost::default(); scene.sites.len()];
    bowed_sums(level, problem(&scene, &views, band), &scene.sites, &mut patches);
    let mut whole = patches.iter().map(|patch| patch.pixels == PATCH_PIXELS as f32);
    scene.sites.retain(|_| whole.next().unwrap_or(false));
    patches.truncate(scene.sites.len());
    assert!(patches.len() > 20, "{} sites", patches.len());
    let mut cost = |path: &BowedTrajectory| {
        let views = views_of(path, &scene);
        evaluate_cost(level, &problem(&scene, &views, band), &scene.sites, &model, &mut patches);
        patches.iter().map(|patch| f64::from(patch.cost)).sum::<f64>()
    };
    let difference = Path::from_fn(|i, _| {
        let mut step = Path::zeros();
        // The bow is seen through the square of a time below one.
        step[i] = if i < 12 { STEP } else { 4.0 * STEP };
        (cost(&stepped(&path, &step)) - cost(&stepped(&path, &-step))) / (2.0 * step[i])
    });
    let sums = bowed_sums(level, problem(&scene, &views, band), &scene.sites, &mut patches);
    let gradient = sums.gradient.fixed_rows::<BOWED_PATH>(0);
    [(0, 12), (12, 6)].map(|(first, count)| {
        let (found, expected) = (gradient.rows(first, count), difference.rows(first, count));
        (found - expected).norm() / expected.norm()
    })
}

#[test]
fn gradient_by_a_path_with_bow_equals_finite_differences() {
    // The columns take a patch's middle row for all of its rows. That is felt near the middle of the path, where the
    // square of the time, and with it what the bow moves, is small.
    let bands = [(7200, (1, 8), [0.01, 0.02]), (7200, (6, 8), [0.01, 0.02]), (900, (5, 8), [0.02, 0.08])];
    for level in levels_up_to(Level::new()) {
        for (sites, band, most) in bands {
            for seed in 30..34 {
                let [ends, bow] = gradient_errors(level, seed, sites, band, JERKS[0]);
                assert!(
                    ends < most[0] && bow < most[1],
                    "{}, band {band:?}, seed {seed}: relative errors {ends} of the ends, {bow} of the bow",
                    level_name(level)
                );
            }
        }
    }
}

#[test]
fn the_gradient_holds_where_acceleration_changes() {
    // Of eleven scenes the median: in one of many a pixel's residual crosses the edge of the robust cost within a step.
    for (band, most) in [((1, 8), [0.01, 0.02]), ((6, 8), [0.01, 0.02])] {
        let mut errors: Vec<[f64; 2]> =
            (30..41).map(|seed| gradient_errors(Level::new(), seed, 7200, band, JERKS[1])).collect();
        for (part, most) in most.into_iter().enumerate() {
            errors.sort_by(|a, b| a[part].total_cmp(&b[part]));
            assert!(errors[5][part] < most, "band {band:?}: {errors:?}");
        }
    }
}

#[test]
fn rows_at_the_same_time_are_those_of_the_plain_kernel() {
    let (level, model) = (Level::new(), TransferScene::residual_model());
    let scene = TransferScene::random(40, 200, VIEWS);
    let still = FrameTiming::GLOBAL;
    let straight = BowedTrajectory::without_bow(scene.exposure);
    let band = RowBand::whole(scene.camera.height);
    let views = views_of_band(&band, &straight, &still, &scene.camera);
    let mut patches = vec![PatchCost::default(); scene.sites.len()];
    let plain = linearize(level, &scene.problem(), &scene.sites, &model, &mut patches);
    let bowed = bowed_sums(level, scene.problem_with(&views), &scene.sites, &mut patches);
    assert_eq!(plain.pixels, bowed.pixels);
    assert!((plain.cost - bowed.cost).abs() < 1e-5 * plain.cost);
    let ends = bowed.gradient.fixed_rows::<12>(0) - plain.gradient.fixed_rows::<12>(0);
    assert!(ends.norm() < 1e-4 * plain.gradient.norm(), "{}", ends.norm() / plain.gradient.norm());
}
