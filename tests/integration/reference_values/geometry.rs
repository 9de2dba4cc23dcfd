//! Rotations, the trajectory within an exposure, point transforms and pyramid intrinsics.

use mba_tests::reference_values::group;
use mba_tracker::geometry::so3;
use mba_tracker::trajectory::ExposureTrajectory;
use nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector4, Vector6};

#[test]
fn exponential_logarithm_and_jacobians() {
    for vector in group("so3_exp") {
        let r = vector.vector("r");
        vector.check_rotation("q", &so3::exp(&r));
        vector.check("R", &so3::exp_matrix(&r));
        vector.check("log_of_q", &so3::log(&so3::exp(&r)));
        vector.check("Jr", &so3::right_jacobian(&r));
        vector.check("Jr_inv", &so3::right_jacobian_inverse(&r));
    }
}

#[test]
fn logarithm_is_the_shortest_rotation() {
    for vector in group("quat_log") {
        vector.check("r", &so3::log(&vector.rotation("q")));
    }
}

#[test]
fn interpolated_pose_and_its_derivatives() {
    for vector in group("interpolation") {
        let exposure = ExposureTrajectory { start: vector.pose("q0", "p0"), end: vector.pose("q1", "p1") };
        let s = vector.number("s");
        let pose = exposure.at(s);
        // The difference of two rotations cannot be more exact than the unit quaternions it is taken from.
        vector.check_absolute("omega", exposure.rotation_vector().as_slice(), 2e-15);
        vector.check_rotation("q_s", &pose.rotation);
        vector.check("R_s", &pose.rotation_matrix());
        vector.check("p_s", &pose.translation);
        vector.check("drs_dr0", &(Matrix3::identity() - exposure.rotation_blend(s)));
        vector.check("drs_dr1", &exposure.rotation_blend(s));
        vector.check("dphis_dphi1", &exposure.rotation_blend_left(s));
        let jacobian = exposure.pose_jacobian(s);
        assert_eq!(jacobian.fixed_view::<3, 3>(0, 0), Matrix3::identity() * vector.expected("w0")[0]);
        assert_eq!(jacobian.fixed_view::<3, 3>(0, 6), Matrix3::identity() * vector.expected("w1")[0]);
    }
}

/// Derivatives by central differences through the tangent that the solver uses.
#[test]
fn world_point_in_the_camera_frame() {
    const STEP: f64 = 1e-4;
    for vector in group("world_to_camera") {
        let (world_from_camera, x_world) = (vector.pose("q", "p"), vector.vector("X"));
        let in_camera =
            |tangent: Vector6<f64>| world_from_camera.perturbed(&tangent).inverse().transform_point(&x_world);
        vector.check("Xc", &in_camera(Vector6::zeros()));
        let columns = core::array::from_fn::<_, 6, _>(|i| {
            let step = Vector6::ith(i, STEP);
            (in_camera(step) - in_camera(-step)) / (2.0 * STEP)
        });
        let jacobian = SMatrix::<f64, 3, 6>::from_columns(&columns);
        let row_by_row: Vec<f64> = jacobian.transpose().iter().copied().collect();
        vector.check_slice("J_right", &row_by_row, 1e-8);
    }
}

#[test]
fn intrinsics_of_pyramid_levels() {
    for vector in group("pyramid_intrinsics") {
        let level = vector.camera(768, 480).at_level(vector.number("level") as usize);
        vector.check("K", &Vector4::new(level.fx, level.fy, level.cx, level.cy));
    }
}

#[test]
fn unnormalised_rotations_have_the_same_logarithm() {
    for vector in group("quat_log") {
        let scaled = UnitQuaternion::new_unchecked(vector.rotation("q").into_inner() * 1.7);
        vector.check("r", &so3::log(&scaled));
    }
}
