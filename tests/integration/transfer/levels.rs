//! Every instruction set the CPU offers against the scalar oracle, on random problems.

use mba_tests::transfer_scene::TransferScene;
use mba_tracker::geometry::{RigidTransform, so3};
use mba_tracker::simd::{Level, level_name, levels_up_to};
use mba_tracker::trajectory::{ExposureTrajectory, SampleRule};
use mba_tracker::transfer::{
    PATCH_PIXELS, PATTERN_DU, PATTERN_DV, PatchCost, PatchRows, PatchSite, PatchValues, PhotometricSums,
    ROW_LENGTH, VirtualView, accumulate_rows, evaluate_cost, linearize, reference, transfer_pixel,
    transfer_rows, transfer_values,
};
use nalgebra::{UnitQuaternion, Vector3};

/// f32 places a sample within about 1.3e-4 px; gradients here stay below 0.15 per px. Rounding of the
/// interpolation itself is below 1e-6.
const VALUE_TOLERANCE: f32 = 2e-5;

/// Relative to the largest entry of the pixel's row. Away from cell borders the only differences are those of
/// the sample's position times the mixed second difference, and rounding.
const ROW_TOLERANCE: f32 = 2e-4;

/// Normal equations of the same rows, relative to `sqrt(H_ii H_jj)`: only the order of summation differs.
const SUM_TOLERANCE: f64 = 2e-6;

/// The same from the images on. A sample at a cell border may fall on either side of the kink there and change
/// its row by a third; with fewer than 1000 pixels one such row is worth this much.
const LINEARIZE_TOLERANCE: f64 = 1e-3;

/// A sample nearer than this to an image border or a cell border may be judged differently, px.
const BORDER: f64 = 1e-3;

const VIEW_COUNTS: [usize; 5] = [1, 2, 7, 8, 32];

fn for_every_level_and_scene(check: impl Fn(Level, &TransferScene)) {
    let levels = levels_up_to(Level::new());
    println!("levels: {:?}", levels.iter().map(|&level| level_name(level)).collect::<Vec<_>>());
    for (seed, &views) in VIEW_COUNTS.iter().cycle().take(15).enumerate() {
        let scene = TransferScene::random(seed as u64, 60, views);
        levels.iter().for_each(|&level| check(level, &scene));
    }
}

/// Smallest distance of the pixel's samples to the border of the image and to the border of a cell.
fn border_distances(scene: &TransferScene, site: &PatchSite, k: usize) -> (f64, f64) {
    let (u, v) = (f64::from(site.u) + f64::from(PATTERN_DU[k]), f64::from(site.v) + f64::from(PATTERN_DV[k]));
    let (mut to_image, mut to_cell) = (f64::INFINITY, f64::INFINITY);
    for i in 0..scene.views.len() {
        let pose = scene.exposure.at(SampleRule::Midpoint.time(i, scene.views.len()));
        let depth = 1.0 / f64::from(site.inverse_depth);
        let Some(t) = transfer_pixel(&scene.camera, &pose, depth, u, v) else { continue };
        let (w, h) = (scene.camera.width as f64 - 1.0, scene.camera.height as f64 - 1.0);
        for (x, last) in [(t.pixel.x, w), (t.pixel.y, h)] {
            to_image = to_image.min(x.abs()).min((x - last).abs());
            to_cell = to_cell.min((x - x.round()).abs());
        }
    }
    (to_image, to_cell)
}

/// Compares predictions and returns the number of valid pixels.
fn assert_values_agree(
    scene: &TransferScene,
    site: &PatchSite,
    got: &PatchValues,
    want: &PatchValues,
) -> usize {
    let mut valid = 0;
    for k in 0..PATCH_PIXELS {
        if got.valid[k] != want.valid[k] {
            let (to_image, _) = border_distances(scene, site, k);
            assert!(to_image < BORDER, "validity differs {to_image} px from the border");
            continue;
        }
        valid += usize::from(want.valid[k] > 0.0);
        let error = (got.mean[k] - want.mean[k]).abs();
        assert!(
            error <= VALUE_TOLERANCE,
            "pixel {k} of {site:?}: {} instead of {}",
            got.mean[k],
            want.mean[k]
        );
    }
    valid
}

#[test]
fn values_agree_with_the_oracle() {
    for_every_level_and_scene(|level, scene| {
        let mut got = vec![PatchValues::default(); scene.sites.len()];
        transfer_values(level, &scene.problem(), &scene.sites, &mut got);
        let mut want = PatchValues::default();
        let mut valid = 0;
        for (site, got) in scene.sites.iter().zip(&got) {
            reference::patch_values(&scene.problem(), site, &mut want);
            valid += assert_values_agree(scene, site, got, &want);
        }
        assert!(valid > 500, "only {valid} valid pixels: the scene tests nothing");
    });
}

#[test]
fn rows_agree_with_the_oracle() {
    for_every_level_and_scene(|level, scene| {
        let mut got = vec![PatchRows::default(); scene.sites.len()];
        transfer_rows(level, &scene.problem(), &scene.sites, &mut got);
        let mut want = PatchRows::default();
        let mut compared = 0;
        for (site, got) in scene.sites.iter().zip(&got) {
            reference::patch_rows(&scene.problem(), site, &mut want);
            assert_values_agree(scene, site, &got.values, &want.values);
            for k in (0..PATCH_PIXELS).filter(|&k| got.values.valid[k] * want.values.valid[k] > 0.0) {
                if border_distances(scene, site, k).1 < BORDER {
                    continue;
                }
                compared += 1;
                let largest = want.pose.iter().map(|column| column[k].abs()).fold(0.0, f32::max);
                for (got, want) in got.pose.iter().zip(&want.pose) {
                    let error = (got[k] - want[k]).abs();
                    assert!(
                        error <= ROW_TOLERANCE * largest,
                        "{} instead of {} ({largest})",
                        got[k],
                        want[k]
                    );
                }
            }
        }
        assert!(compared > 300, "only {compared} rows compared");
    });
}

fn assert_sums_agree(got: &PhotometricSums, want: &PhotometricSums, tolerance: f64) {
    let scale = |i: usize| want.hessian[(i, i)].sqrt();
    let root_cost = (2.0 * want.cost).sqrt();
    for i in 0..ROW_LENGTH {
        let error = (got.gradient[i] - want.gradient[i]).abs() / (scale(i) * root_cost);
        assert!(error < tolerance, "gradient {i}: relative error {error:e}");
        for j in 0..ROW_LENGTH {
            let error = (got.hessian[(i, j)] - want.hessian[(i, j)]).abs() / (scale(i) * scale(j));
            assert!(error < tolerance, "hessian {i},{j}: relative error {error:e}");
        }
    }
    assert_eq!(got.pixels, want.pixels);
    assert!((got.cost - want.cost).abs() < tolerance * want.cost);
}

#[test]
fn sums_of_the_same_rows_agree_with_the_oracle() {
    for_every_level_and_scene(|level, scene| {
        let (problem, model) = (scene.problem(), TransferScene::residual_model());
        let mut patches = vec![PatchCost::default(); scene.sites.len()];
        let mut rows = vec![PatchRows::default(); scene.sites.len()];
        for (site, rows) in scene.sites.iter().zip(&mut rows) {
            reference::patch_rows(&problem, site, rows);
        }
        let want = reference::linearize(&problem, &scene.sites, &model, &mut patches);
        let got = accumulate_rows(level, &problem, &scene.sites, &rows, &model, &mut patches);
        assert_sums_agree(&got, &want, SUM_TOLERANCE);
    });
}

#[test]
fn linearisation_and_cost_agree_with_the_oracle() {
    for_every_level_and_scene(|level, scene| {
        // A pixel whose validity is a matter of rounding would change the sums.
        let sites: Vec<_> = scene.sites.iter().copied().filter(|site| decided(scene, site)).collect();
        let (problem, model) = (scene.problem(), TransferScene::residual_model());
        let mut want_patches = vec![PatchCost::default(); sites.len()];
        let mut got_patches = want_patches.clone();
        let want = reference::linearize(&problem, &sites, &model, &mut want_patches);
        let got = linearize(level, &problem, &sites, &model, &mut got_patches);
        assert_sums_agree(&got, &want, LINEARIZE_TOLERANCE);
        for (got, want) in got_patches.iter().zip(&want_patches) {
            assert!((got.cost - want.cost).abs() <= 1e-4 * want.cost.max(1e-3), "{got:?} {want:?}");
            assert_eq!(got.pixels, want.pixels);
        }
        let cost = evaluate_cost(level, &problem, &sites, &model, &mut want_patches);
        assert_eq!(want_patches, got_patches, "evaluate_cost and linearize disagree");
        assert!((f64::from(cost.cost) - got.cost).abs() < 1e-6 * got.cost);
        assert_eq!(f64::from(cost.pixels), got.pixels);
    });
}

fn decided(scene: &TransferScene, site: &PatchSite) -> bool {
    (0..PATCH_PIXELS).all(|k| border_distances(scene, site, k).0 > BORDER)
}

/// Poisons of the reference image, of the current image and of a view, far enough apart to be told from each
/// other.
fn poisoned(scene: &mut TransferScene, poison: f32) -> Vec<VirtualView> {
    for (k, pixel) in scene.reference.iter_mut().enumerate().skip(1000).step_by(1777) {
        *pixel = if k % 2 == 0 { poison } else { -poison };
    }
    scene.current.iter_mut().skip(500).step_by(2003).for_each(|pixel| *pixel = poison);
    scene.views.clone()
}

#[test]
fn non_finite_input_never_reaches_the_sums() {
    for_every_level_and_scene(|level, scene| {
        for poison in [f32::NAN, f32::INFINITY] {
            let mut scene = TransferScene { views: scene.views.clone(), ..copy_of(scene) };
            let views = poisoned(&mut scene, poison);
            scene.sites[0].inverse_depth = poison;
            scene.sites[1].inverse_depth = -1.0;
            scene.sites[2].inverse_depth = 0.0;
            check_sums_stay_finite(level, &scene, &views, true);
            let mut broken = views.clone();
            broken[0].rotation[0][0] = poison;
            check_sums_stay_finite(level, &scene, &broken, false);
            let mut broken = views;
            broken[0].position[1] = poison;
            check_sums_stay_finite(level, &scene, &broken, false);
        }
    });
}

fn check_sums_stay_finite(level: Level, scene: &TransferScene, views: &[VirtualView], some_valid: bool) {
    let (problem, model) = (scene.problem_with(views), TransferScene::residual_model());
    let mut patches = vec![PatchCost::default(); scene.sites.len()];
    let sums = linearize(level, &problem, &scene.sites, &model, &mut patches);
    assert!(sums.cost.is_finite() && sums.hessian.iter().chain(&sums.gradient).all(|x| x.is_finite()));
    assert_eq!(sums.pixels > 0.0, some_valid);
    assert!(patches[..3].iter().all(|patch| patch.pixels == 0.0));
    let want = reference::linearize(&problem, &scene.sites, &model, &mut patches);
    assert!((sums.pixels - want.pixels).abs() <= 4.0, "{} pixels instead of {}", sums.pixels, want.pixels);
    assert!(evaluate_cost(level, &problem, &scene.sites, &model, &mut patches).cost.is_finite());
    let mut values = vec![PatchValues::default(); scene.sites.len()];
    transfer_values(level, &problem, &scene.sites, &mut values);
    assert!(values.iter().flat_map(|values| values.mean).all(f32::is_finite));
    let mut rows = vec![PatchRows::default(); scene.sites.len()];
    transfer_rows(level, &problem, &scene.sites, &mut rows);
    assert!(
        rows.iter()
            .flat_map(|rows| rows.pose.iter().chain([&rows.values.mean]))
            .flatten()
            .all(|x| x.is_finite())
    );
}

/// Both would be transferred to finite, mirrored places inside of the image if nothing else were tested.
#[test]
fn pixels_that_look_away_or_stand_behind_the_plane_are_invalid() {
    let scene = TransferScene::random(1, 60, 1);
    let turned =
        RigidTransform::new(so3::exp(&Vector3::new(0.0, core::f64::consts::PI, 0.0)), Vector3::zeros());
    let retreated = RigidTransform::new(UnitQuaternion::identity(), Vector3::new(0.0, 0.0, -4.0));
    let advanced = RigidTransform::new(UnitQuaternion::identity(), Vector3::new(0.0, 0.0, 8.0));
    let turned_and_advanced = advanced.compose(&turned);
    let mut behind = scene.sites.clone();
    behind.iter_mut().for_each(|site| site.inverse_depth = -site.inverse_depth);
    let cases = [
        (turned, &scene.sites),
        (advanced, &scene.sites),
        (turned_and_advanced, &scene.sites),
        (retreated, &behind),
    ];
    for level in levels_up_to(Level::new()) {
        for (reference_from_camera, sites) in &cases {
            let exposure = ExposureTrajectory::still(*reference_from_camera);
            let views = [VirtualView::new(&exposure, 0.5, &scene.camera)];
            let mut got = vec![PatchValues::default(); sites.len()];
            transfer_values(level, &scene.problem_with(&views), sites, &mut got);
            assert!(got.iter().all(|values| *values == PatchValues::default()), "{reference_from_camera:?}");
        }
    }
}

fn copy_of(scene: &TransferScene) -> TransferScene {
    TransferScene {
        camera: scene.camera,
        reference: scene.reference.clone(),
        current: scene.current.clone(),
        exposure: scene.exposure,
        views: scene.views.clone(),
        sites: scene.sites.clone(),
        brightness: scene.brightness,
    }
}
