//! Pixel transfer, reblurred intensities and the robust weight.

use mba_tests::reference_values::{ReferenceVector, group, image_waves};
use mba_tracker::image::LevelImage;
use mba_tracker::simd::{Level, level_name, levels_up_to};
use mba_tracker::trajectory::{ExposureTrajectory, SampleRule, left_from_right};
use mba_tracker::transfer::{
    BrightnessModel, PATTERN_DU, PATTERN_DV, PatchRows, PatchSite, RowDelay, TransferProblem, VirtualView,
    huber, transfer_pixel, transfer_rows,
};
use nalgebra::{Matrix1x6, RowSVector, SMatrix};

const WIDTH: usize = 640;
const HEIGHT: usize = 480;

#[test]
fn pixel_and_jacobians_in_double_precision() {
    for vector in group("transfer") {
        let camera = vector.camera(WIDTH, HEIGHT);
        let (pose, (u, v)) = (vector.pose("q", "p"), vector.pixel());
        let transferred = transfer_pixel(&camera, &pose, vector.number("d"), u, v);
        assert_eq!(transferred.is_some(), vector.expects_valid(), "{}", vector.name);
        if let Some(t) = transferred {
            vector.check("uv", &t.pixel);
            vector.check("ray_ref", &t.ray);
            vector.check_slice("plane_distance", &[t.plane_distance], 1e-12);
            vector.check("J_left", &t.jacobian_left);
            vector.check("J_right", &t.jacobian_right(&pose));
        }
    }
}

/// Transfers the vector's pixel with a kernel on an image whose intensity is a coordinate, so that the kernel's
/// value is that coordinate and its row the coordinate's derivative. `None` if the pixel is not valid.
fn transfer_on_ramp(level: Level, vector: &ReferenceVector, ramp: &[f32]) -> Option<(f64, [f64; 6])> {
    let camera = vector.camera(WIDTH, HEIGHT);
    let views = [VirtualView::new(&ExposureTrajectory::still(vector.pose("q", "p")), 0.5, &camera)];
    let image = LevelImage { pixels: ramp, width: WIDTH, height: HEIGHT };
    let problem = TransferProblem {
        reference: image,
        current: image,
        focal: [camera.fx as f32, camera.fy as f32],
        centre: [camera.cx as f32, camera.cy as f32],
        views: &views,
        brightness: BrightnessModel::default(),
        rows: RowDelay::default(),
    };
    let (u, v) = vector.pixel();
    let site = PatchSite { u: u as i16, v: v as i16, inverse_depth: (1.0 / vector.number("d")) as f32 };
    let mut rows = [PatchRows::default()];
    transfer_rows(level, &problem, &[site], &mut rows);
    let k = PATTERN_DU.iter().zip(&PATTERN_DV).position(|offset| offset == (&0, &0)).expect("the centre");
    let entry = |column: usize| f64::from(rows[0].pose[column][k]);
    let row = core::array::from_fn(|i| entry(i) + entry(6 + i));
    (rows[0].values.valid[k] > 0.0).then_some((f64::from(rows[0].values.mean[k]), row))
}

/// Single precision: 3e-4 pixels and 1e-6 of the largest entry of a row.
#[test]
fn pixel_and_jacobian_in_every_kernel() {
    let ramps: [Vec<f32>; 2] = [
        (0..WIDTH * HEIGHT).map(|k| (k % WIDTH) as f32).collect(),
        (0..WIDTH * HEIGHT).map(|k| (k / WIDTH) as f32).collect(),
    ];
    for level in levels_up_to(Level::new()) {
        let mut compared = 0;
        for vector in group("transfer") {
            let want = vector.expected("uv");
            let inside = vector.expects_valid()
                && (0.0..=WIDTH as f64 - 1.0).contains(&want[0])
                && (0.0..=HEIGHT as f64 - 1.0).contains(&want[1]);
            for (axis, ramp) in ramps.iter().enumerate() {
                let got = transfer_on_ramp(level, &vector, ramp);
                assert_eq!(got.is_some(), inside, "{} {}", level_name(level), vector.name);
                let Some((pixel, row)) = got else { continue };
                assert!((pixel - want[axis]).abs() < 3e-4, "{}: {pixel} {}", vector.name, want[axis]);
                let want = &vector.expected("J_left")[6 * axis..][..6];
                let largest = want.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
                for (got, want) in row.iter().zip(want) {
                    assert!((got - want).abs() < 1e-6 * largest, "{}: {got} {want}", vector.name);
                }
                compared += 1;
            }
        }
        assert_eq!(compared, 12);
    }
}

/// Intensity and gradient of the analytic test image.
fn wave_image(u: f64, v: f64) -> (f64, [f64; 2]) {
    image_waves().iter().fold((0.5, [0.0; 2]), |(value, [gu, gv]), [amplitude, ku, kv, phase]| {
        let angle = ku * u + kv * v + phase;
        let slope = amplitude * angle.cos();
        (value + amplitude * angle.sin(), [gu + slope * ku, gv + slope * kv])
    })
}

/// The mean over the virtual views, composed from the tracker's own transfer and trajectory derivatives.
#[test]
fn reblurred_intensity_and_its_derivative() {
    for vector in group("reblur") {
        let camera = vector.camera(WIDTH, HEIGHT);
        let exposure = ExposureTrajectory { start: vector.pose("q0", "p0"), end: vector.pose("q1", "p1") };
        let rule =
            if vector.text("rule") == "endpoint" { SampleRule::Endpoint } else { SampleRule::Midpoint };
        let n = vector.number("n") as usize;
        let (u, v) = vector.pixel();
        let (mut value, mut right) = (0.0, RowSVector::<f64, 12>::zeros());
        for k in 0..n {
            let s = rule.time(k, n);
            let pose = exposure.at(s);
            let t = transfer_pixel(&camera, &pose, vector.number("d"), u, v).expect("all samples are valid");
            let (intensity, gradient) = wave_image(t.pixel.x, t.pixel.y);
            let row: Matrix1x6<f64> = RowSVector::<f64, 2>::from(gradient) * t.jacobian_right(&pose);
            value += intensity / n as f64;
            right += row * exposure.pose_jacobian(s) / n as f64;
        }
        vector.check_slice("value", &[value], 1e-12);
        vector.check("J_right", &right);
        let mut right_from_left = SMatrix::<f64, 12, 12>::zeros();
        for (block, pose) in [(0, &exposure.start), (6, &exposure.end)] {
            let right_from_left_of_one = left_from_right(&pose.rotation_matrix()).transpose();
            right_from_left.fixed_view_mut::<6, 6>(block, block).copy_from(&right_from_left_of_one);
        }
        vector.check("J_left", &(right * right_from_left));
    }
}

#[test]
fn huber_cost_and_weight() {
    for vector in group("huber") {
        let (rho, weight) = huber(vector.number("r") as f32, vector.number("delta") as f32);
        vector.check_slice("rho", &[f64::from(rho)], 1e-6);
        vector.check_slice("weight", &[f64::from(weight)], 1e-6);
    }
}
