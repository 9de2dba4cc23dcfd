//! The depth that is composited against closed forms: where a ray meets the peak of a Gaussian, and a plane.

use mba_mapper::gaussians::{Gaussian, Gaussians};
use mba_mapper::raster::reference::ReferenceGaussian;
use mba_mapper::raster::{RasterImage, RasterScratch, RasterView, Rasterizer};
use mba_tests::raster_scene::{random_view, to_parameters};
use mba_tests::transfer_scene::Uniform;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::simd::Level;
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

fn render(gaussians: &Gaussians, view: &RasterView) -> RasterImage {
    let mut image = RasterImage::default();
    Rasterizer::new(Level::new()).forward(gaussians, view, &mut RasterScratch::default(), &mut image);
    image
}

/// Camera z at which the density of a Gaussian is largest along a ray of unit z: `r^T S^-1 m / r^T S^-1 r`.
fn peak(gaussian: &ReferenceGaussian, view: &RasterView, ray: &Vector3<f64>) -> f64 {
    let camera_from_world = view.world_from_camera.inverse();
    let [w, x, y, z] = gaussian.rotation;
    let own = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix();
    let axes = camera_from_world.rotation_matrix() * own.matrix();
    let inverse_variance = gaussian.scale.map(|scale| 1.0 / (scale * scale));
    let inverse = axes * Matrix3::from_diagonal(&inverse_variance) * axes.transpose();
    let mean = camera_from_world.transform_point(&gaussian.mean);
    (inverse * mean).dot(ray) / (inverse * ray).dot(ray)
}

#[test]
fn the_depth_of_a_gaussian_is_where_the_ray_meets_its_peak() {
    let mut uniform = Uniform::new(11);
    let camera = PinholeCamera { width: 200, height: 150, fx: 3000.0, fy: 3300.0, cx: 620.0, cy: -180.0 };
    let view = RasterView { camera, ..random_view(&mut uniform, 200, 150) };
    let (mut compared, mut tilted) = (0, 0);
    for _ in 0..40 {
        let z = uniform.within(1.0, 3.0);
        let middle = [uniform.within(60.0, 140.0).floor(), uniform.within(50.0, 100.0).floor()];
        let ray = camera.ray(middle[0], middle[1]);
        // 3 to 16 px.
        let mut scale = || z * uniform.within(0.001, 0.005);
        let scale = Vector3::new(scale(), scale(), scale());
        let gaussian = ReferenceGaussian {
            mean: view.world_from_camera.transform_point(&(ray * z)),
            scale,
            rotation: core::array::from_fn(|_| uniform.within(-1.0, 1.0)),
            opacity: 0.9,
            colour: Vector3::zeros(),
        };
        let image = render(&[to_parameters(&gaussian)].into_iter().collect(), &view);
        for (dx, dy) in (-40..=40).flat_map(|dx| (0..=40).map(move |dy| (dx, dy))) {
            let at = |sign: i32| [middle[0] + f64::from(sign * dx), middle[1] + f64::from(sign * dy)];
            let pixels = [1, -1].map(|sign| at(sign)[1] as usize * 200 + at(sign)[0] as usize);
            if pixels.iter().any(|&pixel| image.alpha[pixel] < 0.1) {
                continue;
            }
            // What two pixels on opposite sides of the centre differ by, which has no part of second order.
            let got = pixels.map(|pixel| f64::from(image.depth[pixel] / image.alpha[pixel]));
            let want = [1, -1].map(|sign| peak(&gaussian, &view, &camera.ray(at(sign)[0], at(sign)[1])));
            let (got, want) = (got[0] - got[1], want[0] - want[1]);
            // The low-pass of the tilt takes a third of a percent at 3 px.
            assert!((got - want).abs() < 1e-5 + 0.01 * want.abs(), "{got} m instead of {want} m");
            compared += 1;
            tilted += usize::from(want.abs() > 0.002);
        }
    }
    assert!(compared > 5000 && tilted > compared / 4, "{tilted} of {compared} pairs differ");
}

/// A wall through (0, 0, 3) that is turned by `turn` about the vertical axis, covered with flat Gaussians in a regular
/// pattern, seen by a camera with 500 px focal length.
fn wall(turn: f64, spacing: f64) -> (Gaussians, RasterView) {
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), turn);
    let to_pixel = 3.0 / 500.0;
    let gaussian = |i: i32, j: i32| {
        let on_wall = Vector3::new(f64::from(i), f64::from(j), 0.0) * (spacing * to_pixel);
        let scale = (spacing * to_pixel) as f32;
        Gaussian {
            mean: (rotation * on_wall + Vector3::new(0.0, 0.0, 3.0)).map(|x| x as f32).into(),
            log_scale: [scale.ln(), scale.ln(), (0.02 * scale).ln()],
            rotation: [rotation.w, rotation.i, rotation.j, rotation.k].map(|q| q as f32),
            opacity_logit: 0.5,
            colour: [0.5; 3],
        }
    };
    let gaussians = (-60..=60).flat_map(|i| (-60..=60).map(move |j| (i, j))).map(|(i, j)| gaussian(i, j));
    let view = RasterView {
        camera: PinholeCamera { width: 96, height: 64, fx: 500.0, fy: 500.0, cx: 47.5, cy: 31.5 },
        world_from_camera: RigidTransform::identity(),
        background: [0.0; 3],
    };
    (gaussians.collect(), view)
}

/// Turns of the wall in degrees, and how far in front of it the depth of the centres lies, millimetres (a plain renderer of
/// this scene in f64).
const WALLS: [(f64, f64); 4] = [(0.0, 0.0), (30.0, 6.26), (45.0, 9.23), (60.0, 12.69)];

#[test]
fn a_wall_of_flat_gaussians_is_where_it_is_however_slanted() {
    for (degrees, of_centres) in WALLS {
        let turn = degrees.to_radians();
        let (gaussians, view) = wall(turn, 2.0);
        let image = render(&gaussians, &view);
        let normal = Rotation3::from_axis_angle(&Vector3::y_axis(), turn) * Vector3::z();
        let errors = image.depth.iter().zip(&image.alpha).enumerate().map(|(pixel, (depth, alpha))| {
            assert!(*alpha > 0.99, "{degrees} degrees, pixel {pixel}: alpha {alpha}");
            let ray = view.camera.ray((pixel % 96) as f64, (pixel / 96) as f64);
            1e3 * (f64::from(depth / alpha) - 3.0 * normal.z / normal.dot(&ray))
        });
        let errors: Vec<f64> = errors.collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let largest = errors.iter().fold(0.0, |largest: f64, error| largest.max(error.abs()));
        println!("{degrees} degrees: mean {mean:.3}, largest {largest:.3} mm");
        assert!(mean.abs() < 0.01 + of_centres / 20.0, "{degrees} degrees: {mean} mm");
        assert!(largest < 0.01 + of_centres / 10.0, "{degrees} degrees: {largest} mm");
    }
}
