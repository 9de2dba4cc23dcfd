//! The depth term alone.

use mba_tests::handheld::camera_of_width;
use mba_tests::plane_scene::PlaneScene;
use mba_tracker::SimdLevel;
use mba_tracker::align::depth_term::{DepthProblem, DepthSums};
use mba_tracker::geometry::{PinholeCamera, RigidTransform, so3};
use mba_tracker::simd::{level_name, levels_up_to};
use mba_tracker::surface::{InverseDepthMap, SurfacePlanes};
use mba_tracker::transfer::RowBand;
use mba_tracker::workspace::Arena;
use nalgebra::Vector6;

const SIGMA: f32 = 0.002;
const DELTA: f32 = 1.345;

/// Applies a tangent vector of translation and left rotation.
fn moved(pose: &RigidTransform, tangent: &Vector6<f64>) -> RigidTransform {
    let turn = so3::exp(&tangent.fixed_rows::<3>(3).into_owned());
    RigidTransform::new(turn * pose.rotation, pose.translation + tangent.fixed_rows::<3>(0))
}

fn offset() -> RigidTransform {
    RigidTransform::identity().perturbed(&Vector6::new(0.015, -0.01, 0.02, 0.01, -0.012, 0.008))
}

/// Exact inverse depth at `pose`.
fn inverse_depth(camera: &PinholeCamera, pose: &RigidTransform) -> Vec<f32> {
    let view = PlaneScene::corner(1, 0.1).sharp(camera, pose);
    view.depth.iter().map(|z| if *z > 0.0 { 1.0 / z } else { 0.0 }).collect()
}

/// Calls `check` with the depth problem between the view at the origin and that at [`offset`].
fn with_problem(stride: usize, check: impl FnOnce(DepthProblem<'_>)) {
    let camera = camera_of_width(160);
    let (width, height) = (camera.width, camera.height);
    let mut keyframe = inverse_depth(&camera, &RigidTransform::identity());
    let mut current = inverse_depth(&camera, &offset());
    let keyframe = InverseDepthMap { values: &mut keyframe, width, height, level: 0 };
    let current = InverseDepthMap { values: &mut current, width, height, level: 0 };
    let mut memory = vec![0; 1 << 20];
    let mut planes = SurfacePlanes::carve(&mut Arena::new(&mut memory), &camera, 0).expect("memory");
    planes.fit(SimdLevel::new(), &keyframe);
    let problem = DepthProblem {
        current: &current,
        keyframe: &keyframe,
        planes: &planes,
        camera,
        stride,
        gate: 0.03,
        band: RowBand::whole(height),
    };
    check(problem);
}

fn linearise(problem: &DepthProblem, pose: &RigidTransform) -> DepthSums {
    problem.linearise(SimdLevel::new(), pose, SIGMA, DELTA)
}

#[test]
fn gradient_is_the_derivative_of_the_cost() {
    with_problem(1, |problem| {
        // Half of the way: residuals of about a standard deviation, so that both parts of Huber's cost matter.
        let pose =
            RigidTransform::identity().perturbed(&(RigidTransform::identity().tangent_to(&offset()) * 0.5));
        let sums = linearise(&problem, &pose);
        assert!(sums.points > 15_000.0, "{} points", sums.points);
        assert!(sums.cost > 0.05 * sums.points, "cost {} hides the derivative", sums.cost);
        for i in 0..6 {
            // 0.1 mm, 0.05 mrad: hundredths of a pixel, so hardly a point comes or goes.
            let step = Vector6::ith(i, if i < 3 { 1e-4 } else { 5e-5 });
            let (ahead, behind) =
                (linearise(&problem, &moved(&pose, &step)), linearise(&problem, &moved(&pose, &-step)));
            // Costs per point: points that leave at the border must not count as descent.
            let per_point = ahead.cost / ahead.points - behind.cost / behind.points;
            let numeric = per_point * sums.points / (2.0 * step[i]);
            let scale = (2.0 * sums.cost * sums.hessian[(i, i)]).sqrt();
            println!("{i}: {} against {numeric}", sums.gradient[i]);
            // The slopes of the fitted planes are smoothed at the creases of the room.
            assert!(
                (sums.gradient[i] - numeric).abs() < 0.02 * scale,
                "{i}: {} is not {numeric}",
                sums.gradient[i]
            );
        }
    });
}

#[test]
fn gauss_newton_matrix_is_symmetric_and_constrains_all_six_directions() {
    with_problem(1, |problem| {
        let sums = linearise(&problem, &offset());
        assert_eq!(sums.hessian, sums.hessian.transpose());
        let eigenvalues = sums.hessian.symmetric_eigenvalues();
        assert!(eigenvalues.min() > 1e-4 * eigenvalues.max(), "{eigenvalues:?}");
    });
}

#[test]
fn a_known_offset_is_recovered_on_a_room_corner() {
    with_problem(2, |problem| {
        let mut pose = RigidTransform::identity();
        for _ in 0..12 {
            let sums = linearise(&problem, &pose);
            let step =
                sums.hessian.cholesky().expect("a corner holds all six directions").solve(&-sums.gradient);
            pose = moved(&pose, &step);
        }
        let error = offset().tangent_to(&pose);
        println!("{error:?}");
        assert!(error.fixed_rows::<3>(0).norm() < 2e-4, "{error:?}");
        assert!(error.fixed_rows::<3>(3).norm() < 1e-4, "{error:?}");
    });
}

#[test]
fn the_noise_scale_is_that_of_the_residuals() {
    with_problem(1, |problem| {
        let mut scratch = vec![0.0; 30_000];
        let (exact, count) = problem.noise_scale(SimdLevel::new(), &offset(), &mut scratch);
        assert!(count > 15_000 && exact < 1e-4, "{count} points, {exact}");
        let back = moved(&offset(), &Vector6::new(0.0, 0.0, 0.02, 0.0, 0.0, 0.0));
        let (scale, _) = problem.noise_scale(SimdLevel::new(), &back, &mut scratch);
        // 2 cm along the axis at about 2.2 m is 0.02 / 2.2^2 on the walls that face the camera.
        assert!((0.002..0.008).contains(&scale), "{scale}");
        assert_eq!(problem.noise_scale(SimdLevel::new(), &offset(), &mut scratch[..50]).1, 50);
    });
}

#[test]
fn instruction_sets_agree() {
    with_problem(1, |problem| {
        let pose = RigidTransform::identity();
        let scalar = problem.linearise(levels_up_to(SimdLevel::new())[0], &pose, SIGMA, DELTA);
        for level in levels_up_to(SimdLevel::new()) {
            let sums = problem.linearise(level, &pose, SIGMA, DELTA);
            assert_eq!(sums.points, scalar.points);
            let relative = (sums.cost - scalar.cost).abs() / scalar.cost;
            assert!(relative < 1e-6, "{}: cost differs by {relative}", level_name(level));
            for i in 0..6 {
                let bound = 2e-6 * (2.0 * scalar.cost * scalar.hessian[(i, i)]).sqrt();
                assert!((sums.gradient[i] - scalar.gradient[i]).abs() < bound, "{}", level_name(level));
                for j in 0..6 {
                    let bound = 2e-6 * (scalar.hessian[(i, i)] * scalar.hessian[(j, j)]).sqrt();
                    assert!((sums.hessian[(i, j)] - scalar.hessian[(i, j)]).abs() < bound);
                }
            }
        }
    });
}

#[test]
fn maps_without_depth_yield_zero_sums() {
    with_problem(1, |problem| {
        let (width, height) = (problem.camera.width, problem.camera.height);
        let mut nothing = vec![0.0; width * height];
        let nothing = InverseDepthMap { values: &mut nothing, width, height, level: 0 };
        let mut scratch = [0.0; 64];
        for empty in
            [DepthProblem { current: &nothing, ..problem }, DepthProblem { keyframe: &nothing, ..problem }]
        {
            let sums = linearise(&empty, &offset());
            assert_eq!((sums.points, sums.cost, sums.gradient), (0.0, 0.0, Vector6::zeros()));
            assert_eq!(empty.noise_scale(SimdLevel::new(), &offset(), &mut scratch), (0.0, 0));
        }
        let behind = RigidTransform::identity().perturbed(&Vector6::new(0.0, 0.0, -9.0, 0.0, 0.0, 0.0));
        assert_eq!(linearise(&problem, &behind).points, 0.0);
    });
}
