//! Poses at both ends of a known exposure against a sharp keyframe.

use std::sync::LazyLock;

use mba_tests::handheld::exposure_errors;
use mba_tests::plane_scene::PlaneScene;
use mba_tracker::align::{AlignSettings, LevelOutcome, MotionPrior};
use mba_tracker::geometry::RigidTransform;
use mba_tracker::trajectory::ExposureTrajectory;
use mba_tracker::transfer::{PATTERN_DU, PATTERN_DV, PatchSite};
use nalgebra::Vector6;

use crate::pair::{Images, align, camera, estimate, prior};

static SCENE: LazyLock<PlaneScene> = LazyLock::new(|| PlaneScene::corner(3, 0.12));
static KEYFRAME: LazyLock<Images> = LazyLock::new(|| Images::sharp(&SCENE, &RigidTransform::identity()));
static FRAME: LazyLock<Images> = LazyLock::new(|| Images::blurred(&SCENE, &truth()));

/// About 9 px from the keyframe and 8 px of blur.
fn truth() -> ExposureTrajectory {
    let mid = RigidTransform::identity().perturbed(&Vector6::new(0.05, -0.03, 0.04, 0.012, 0.02, -0.015));
    ExposureTrajectory::from_mid_and_motion(&mid, &true_motion())
}

fn true_motion() -> Vector6<f64> {
    Vector6::new(0.02, -0.01, 0.012, 0.012, -0.024, 0.01)
}

/// A few pixels off in pose and motion.
fn near() -> ExposureTrajectory {
    let mid = truth().mid().perturbed(&Vector6::new(-0.02, 0.015, -0.01, 0.004, -0.006, 0.005));
    ExposureTrajectory::from_mid_and_motion(&mid, &(true_motion() * 0.6))
}

fn wide_prior() -> MotionPrior {
    prior(true_motion() * 0.5, 0.05, 0.05)
}

fn settings(depth_term: bool) -> AlignSettings {
    AlignSettings { depth_term, ..AlignSettings::default() }
}

fn errors(found: &ExposureTrajectory, truth: &ExposureTrajectory) -> (f64, f64) {
    exposure_errors(&camera(), found, truth)
}

fn check(name: &str, outcome: &LevelOutcome, mid_bound: f64, motion_bound: f64) {
    let (mid, motion) = errors(&outcome.estimate.keyframe_from_camera, &truth());
    let brightness = outcome.estimate.brightness;
    println!("{name}: mid {mid:.4} px, motion {motion:.4} px, {brightness:?}, {:?}", outcome.stop);
    assert!(mid < mid_bound, "{name}: mid pose wrong by {mid} px");
    assert!(motion < motion_bound, "{name}: motion wrong by {motion} px");
}

#[test]
fn both_ends_are_found_with_and_without_depth() {
    for (depth_term, mid, motion) in [(true, 0.05, 0.3), (false, 0.15, 0.3)] {
        let (outcome, _) = align(&KEYFRAME, &FRAME, &settings(depth_term), estimate(near()), &wide_prior());
        check(&format!("depth term {depth_term}"), &outcome, mid, motion);
        assert_eq!(outcome.depth_points > 0, depth_term);
        assert!(outcome.views >= 4, "8 px of blur need several views, not {}", outcome.views);
    }
}

#[test]
fn gain_and_offset_are_found() {
    let (gain, offset) = (1.1, 0.01);
    let light = |byte: u8| (f64::from(byte) * gain + 255.0 * offset).round().min(255.0) as u8;
    let frame = Images { grey: FRAME.grey.iter().map(|&byte| light(byte)).collect(), ..FRAME.clone() };
    // The expectation is no gain; let the data decide. Bilinear samples of the reference lack 1 % of its contrast.
    let open = AlignSettings { gain_sigma: 1.0, offset_sigma: 1.0, ..settings(true) };
    let (outcome, _) = align(&KEYFRAME, &frame, &open, estimate(near()), &wide_prior());
    check("gain", &outcome, 0.05, 0.3);
    let brightness = outcome.estimate.brightness;
    assert!((f64::from(brightness.gain) - gain).abs() < 0.02, "{brightness:?}");
    assert!((f64::from(brightness.offset) - offset).abs() < 0.01, "{brightness:?}");
    let (outcome, _) = align(&KEYFRAME, &frame, &settings(true), estimate(near()), &wide_prior());
    check("gain, default expectation", &outcome, 0.1, 0.5);
    assert!((f64::from(outcome.estimate.brightness.gain) - gain).abs() < 0.03);
}

#[test]
fn patches_on_a_foreign_object_are_dropped() {
    let mut frame = FRAME.clone();
    // A quarter of the width, half of the height, nothing like what was there.
    let inside = |k: usize| (200..280).contains(&(k % 320)) && (60..180).contains(&(k / 320));
    for (k, byte) in frame.grey.iter_mut().enumerate().filter(|(k, _)| inside(*k)) {
        *byte = if (k % 320 / 9 + k / 320 / 9) % 2 == 0 { 250 } else { 5 };
    }
    let kept_inside = |frame: &Images| {
        let (outcome, sites) = align(&KEYFRAME, frame, &settings(false), estimate(near()), &wide_prior());
        let inside = |site: &&PatchSite| (204..276).contains(&site.u) && (64..176).contains(&site.v);
        (sites.iter().filter(inside).count(), outcome)
    };
    let ((plain, _), (foreign, outcome)) = (kept_inside(&FRAME), kept_inside(&frame));
    check("foreign object", &outcome, 0.1, 0.4);
    assert!(plain >= 6, "{plain} patches were where the object is");
    assert_eq!(foreign, 0, "patches on the object were kept");
}

/// Standard deviation of the frame's light within the middle one of the patches, in standard deviations of nominal noise: that
/// of a hundredth of the root of light and dark light together.
fn middle_contrast(frame: &Images, sites: &[PatchSite], dark: f64) -> f64 {
    let mut contrasts: Vec<f64> = sites
        .iter()
        .map(|site| {
            let pixels = PATTERN_DU.iter().zip(&PATTERN_DV).map(|(du, dv)| {
                let (u, v) = (i32::from(site.u) + du, i32::from(site.v) + dv);
                f64::from(frame.grey[v as usize * camera().width + u as usize]) / 255.0
            });
            let light: Vec<f64> = pixels.collect();
            let mean = light.iter().sum::<f64>() / light.len() as f64;
            let variance = light.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / light.len() as f64;
            100.0 * (variance / (mean + dark)).sqrt()
        })
        .collect();
    contrasts.sort_by(f64::total_cmp);
    contrasts[contrasts.len() / 2]
}

#[test]
fn what_was_seen_before_fits_better_than_a_mean_and_another_place_does_not() {
    let elsewhere = Images::blurred(&PlaneScene::corner(77, 0.12), &truth());
    for (frame, is_same) in [(&*FRAME, true), (&elsewhere, false)] {
        let settings = settings(false);
        let (outcome, sites) = align(&KEYFRAME, frame, &settings, estimate(near()), &wide_prior());
        let contrast = middle_contrast(frame, &sites, f64::from(settings.dark_intensity));
        println!("residual {}, contrast {} ({contrast})", outcome.photometric_scale, outcome.contrast);
        assert!(
            (f64::from(outcome.contrast) / contrast - 1.0).abs() < 1e-3,
            "{} {contrast}",
            outcome.contrast
        );
        assert_eq!(outcome.photometric_scale < 0.5 * outcome.contrast, is_same);
        assert_eq!(outcome.photometric_scale < outcome.contrast, is_same);
    }
}

#[test]
fn a_start_without_motion_escapes_with_the_prior() {
    let still = ExposureTrajectory::still(near().mid());
    let (outcome, _) = align(&KEYFRAME, &FRAME, &settings(true), estimate(still), &wide_prior());
    check("zero motion", &outcome, 0.05, 0.3);
}

#[test]
fn the_direction_of_time_is_that_of_the_start_and_the_middle_does_not_care() {
    let start = estimate(near().reversed());
    let open = prior(Vector6::zeros(), 1.0, 1.0);
    let (outcome, _) = align(&KEYFRAME, &FRAME, &settings(true), start, &open);
    let (mid, reversed) = errors(&outcome.estimate.keyframe_from_camera, &truth().reversed());
    println!("reversed: mid {mid} px, motion {reversed} px");
    assert!(mid < 0.05 && reversed < 0.3, "mid {mid} px, reversed motion {reversed} px");
}

#[test]
fn without_blur_model_one_view_finds_the_middle() {
    let sharp_model = AlignSettings { blur: false, ..settings(true) };
    let start = estimate(ExposureTrajectory::still(near().mid()));
    let (outcome, _) = align(&KEYFRAME, &FRAME, &sharp_model, start, &prior(Vector6::zeros(), 1e-6, 1e-6));
    assert_eq!(outcome.views, 1);
    let (mid, _) = errors(&outcome.estimate.keyframe_from_camera, &truth());
    assert!(mid < 0.3, "{mid} px");
    assert!(outcome.estimate.keyframe_from_camera.motion().norm() < 1e-4);
}

#[test]
fn nothing_in_view_changes_nothing() {
    let away = RigidTransform::identity().perturbed(&Vector6::new(0.0, 0.0, 0.0, 0.0, 3.0, 0.0));
    let start = estimate(ExposureTrajectory::still(away));
    let (outcome, _) = align(&KEYFRAME, &FRAME, &settings(true), start, &wide_prior());
    assert_eq!(outcome.stop, mba_tracker::align::StopReason::NoData);
    assert_eq!(outcome.estimate, start);
    assert_eq!((outcome.patches, outcome.depth_points), (0, 0));
}
