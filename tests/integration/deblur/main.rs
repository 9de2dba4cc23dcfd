//! Deblurring of rendered keyframes with their true and with wrong motion.

use mba_tests::handheld::camera_of_width;
use mba_tests::plane_scene::PlaneScene;
use mba_tests::transfer_scene::Uniform;
use mba_tracker::SimdLevel;
use mba_tracker::deblur::{DeblurReport, DeblurScratch, blur_along};
use mba_tracker::geometry::RigidTransform;
use mba_tracker::simd::{level_name, levels_up_to};
use mba_tracker::surface::{InverseDepthMap, SurfacePlanes};
use mba_tracker::trajectory::{BowedTrajectory, ExposureTrajectory, FrameTiming};
use mba_tracker::workspace::Arena;
use nalgebra::Vector6;

const WIDTH: usize = 320;

/// Peak signal to noise ratio in dB away from the border, where the blur brings in what was not seen.
fn psnr(image: &[f32], truth: &[f32]) -> f64 {
    let height = image.len() / WIDTH;
    let inner =
        |k: &usize| (16..WIDTH - 16).contains(&(k % WIDTH)) && (16..height - 16).contains(&(k / WIDTH));
    let (mut sum, mut count) = (0.0, 0.0);
    for k in (0..image.len()).filter(inner) {
        sum += f64::from(image[k] - truth[k]).powi(2);
        count += 1.0;
    }
    -10.0 * f64::log10(sum / count)
}

fn root_mean_square(a: &[f32], b: &[f32]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    (sum / a.len() as f64).sqrt()
}

fn exposure(motion: Vector6<f64>) -> ExposureTrajectory {
    ExposureTrajectory::from_mid_and_motion(&RigidTransform::identity(), &motion)
}

/// About 10 px, mostly sideways, with some roll and approach.
fn true_motion() -> Vector6<f64> {
    Vector6::new(0.03, -0.01, 0.02, 0.008, 0.026, 0.02)
}

struct Deblurred {
    image: Vec<f32>,
    report: DeblurReport,
    longest: f32,
}

/// Deblurs `captured` along the flow that `motion` causes on the surfaces of `scene`.
fn deblur(
    level: SimdLevel,
    scene: &PlaneScene,
    captured: &[f32],
    motion: Vector6<f64>,
    iterations: usize,
) -> Deblurred {
    let camera = camera_of_width(WIDTH);
    let sharp = scene.sharp(&camera, &RigidTransform::identity());
    let mut memory = vec![0; DeblurScratch::bytes(camera.width, camera.height) + (4 << 20)];
    let mut arena = Arena::new(&mut memory);
    let map = InverseDepthMap::carve(&mut arena, &camera, 0).expect("memory");
    for (rho, depth) in map.values.iter_mut().zip(&sharp.depth) {
        *rho = 1.0 / depth;
    }
    let mut planes = SurfacePlanes::carve(&mut arena, &camera, 0).expect("memory");
    planes.fit(SimdLevel::new(), &map);
    let mut scratch = DeblurScratch::carve(&mut arena, camera.width, camera.height).expect("memory");
    let longest = scratch.flow.fill(
        &BowedTrajectory::without_bow(exposure(motion)),
        &FrameTiming::GLOBAL,
        &camera,
        &planes,
        0,
        0.4,
    );
    scratch.capture(captured);
    let mut image = captured.to_vec();
    let report = scratch.deblur(level, longest, iterations, &mut image);
    Deblurred { image, report, longest }
}

#[test]
fn the_true_motion_brings_the_sharp_image_back() {
    let scene = PlaneScene::corner(3, 0.12);
    let camera = camera_of_width(WIDTH);
    let truth = scene.sharp(&camera, &RigidTransform::identity()).light;
    let mut gains = Vec::new();
    for scale in [0.3, 0.6, 1.0] {
        let captured = scene.blurred(&camera, &exposure(true_motion() * scale), 32);
        let before = psnr(&captured, &truth);
        for iterations in [4, 12] {
            let result = deblur(SimdLevel::new(), &scene, &captured, true_motion() * scale, iterations);
            let after = psnr(&result.image, &truth);
            println!(
                "{:.1} px, {iterations} iterations: {before:.2} -> {after:.2} dB, {:?}",
                result.longest, result.report
            );
            assert!(result.report.kept && result.report.residual_after < 0.6 * result.report.residual_before);
            gains.push(after - before);
        }
    }
    // More iterations bring more on noise-free images; a long blur destroys more.
    let least = [3.5, 3.8, 2.8, 3.8, 2.3, 4.2];
    for (gain, least) in gains.iter().zip(least) {
        assert!(*gain > least, "{gains:?}");
    }
}

#[test]
fn the_reported_residuals_are_those_of_the_images() {
    let scene = PlaneScene::corner(3, 0.12);
    let camera = camera_of_width(WIDTH);
    let captured = scene.blurred(&camera, &exposure(true_motion()), 32);
    let mut memory = vec![0; DeblurScratch::bytes(camera.width, camera.height) + 64];
    let mut scratch =
        DeblurScratch::carve(&mut Arena::new(&mut memory), camera.width, camera.height).expect("memory");
    scratch.flow.displacement.fill([6.0, -3.0]);
    scratch.capture(&captured);
    let mut image = captured.clone();
    let longest = 45.0f32.sqrt();
    let report = scratch.deblur(SimdLevel::new(), longest, 5, &mut image);
    let reblurred = |sharp: &[f32]| {
        let mut out = vec![0.0; sharp.len()];
        // Many more views than the deblurring used.
        blur_along(SimdLevel::new(), sharp, &scratch.flow, 32, &mut out);
        root_mean_square(&out, &captured)
    };
    let (before, after) = (reblurred(&captured), reblurred(&image));
    println!("{report:?}: {before} {after}");
    assert!((f64::from(report.residual_before) / before - 1.0).abs() < 0.05, "{before}");
    assert!((f64::from(report.residual_after) / after - 1.0).abs() < 0.3, "{after}");
}

#[test]
fn the_result_explains_the_captured_image_better_or_is_that_image() {
    let scene = PlaneScene::corner(3, 0.12);
    let camera = camera_of_width(WIDTH);
    let captured = scene.blurred(&camera, &exposure(true_motion()), 16);
    let mut draw = Uniform::new(4);
    let noise: Vec<f32> = captured.iter().map(|_| draw.within(0.0, 1.0) as f32).collect();
    for (name, image) in [("blurred", &captured), ("noise", &noise)] {
        for seed in 0..4 {
            let mut draw = Uniform::new(seed);
            let motion = Vector6::from_fn(|i, _| draw.within(-0.06, 0.06) * if i < 3 { 1.0 } else { 0.5 });
            let iterations = seed as usize;
            let result = deblur(SimdLevel::new(), &scene, image, motion, iterations);
            println!("{name}, {:.1} px: {:?}", result.longest, result.report);
            assert!(result.image.iter().all(|light| light.is_finite() && *light >= 0.0));
            assert_eq!(result.report.kept, result.report.residual_after < result.report.residual_before);
            if !result.report.kept {
                assert_eq!(&result.image, image, "{name}: rejected, but not the captured image");
            }
        }
    }
    let untouched = deblur(SimdLevel::new(), &scene, &captured, true_motion(), 0);
    assert!(!untouched.report.kept && untouched.image == captured);
}

#[test]
fn black_and_saturated_images_stay_as_they_are() {
    let scene = PlaneScene::corner(3, 0.12);
    let pixels = WIDTH * WIDTH * 3 / 4;
    for light in [0.0, 1.0] {
        let captured = vec![light; pixels];
        let result = deblur(SimdLevel::new(), &scene, &captured, true_motion(), 6);
        for value in &result.image {
            assert!((value - light).abs() < 1e-5, "{light} became {value}");
        }
    }
    // Half black, half saturated: the edge may move, but nothing leaves the range of finite light.
    let captured: Vec<f32> = (0..pixels).map(|k| if k % WIDTH < WIDTH / 2 { 0.0 } else { 1.0 }).collect();
    let result = deblur(SimdLevel::new(), &scene, &captured, true_motion(), 6);
    assert!(result.image.iter().all(|light| light.is_finite() && (0.0..=3.0).contains(light)));
}

#[test]
fn instruction_sets_agree() {
    let scene = PlaneScene::corner(3, 0.12);
    let captured = scene.blurred(&camera_of_width(WIDTH), &exposure(true_motion()), 16);
    let levels = levels_up_to(SimdLevel::new());
    let scalar = deblur(levels[0], &scene, &captured, true_motion(), 4);
    for &level in &levels[1..] {
        let other = deblur(level, &scene, &captured, true_motion(), 4);
        let largest = scalar.image.iter().zip(&other.image).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(largest < 2e-5, "{}: {largest}", level_name(level));
        assert_eq!(other.report.kept, scalar.report.kept);
    }
}
