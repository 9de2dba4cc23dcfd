//! Gaussians as thick as the recording could tell them apart.

use mba_raster::gaussians::{Gaussians, LOG_SCALE, MEAN};
use mba_raster::raster::constants::NEAR_PLANE;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use nalgebra::Vector3;

/// Variance that Gaussians for viewers have more, pixels squared of the recording. Viewers add 0.075 (PlayCanvas) or 0.3 (most
/// others), in pixels squared of the screen.
const GROWTH: f32 = 0.2;

/// Factor on variances for what viewers cut: with nothing beyond 2.8 deviations 7 % of the variance are missing, and 16 % where
/// the rest is lowered to end at zero (PlayCanvas).
const BORDER: f32 = 1.1;

/// Edge of a pixel of the recording at every Gaussian, metres: at the nearest of the poses that see its centre. Zero for one that
/// none sees.
pub(super) fn pixel_edges(map: &Gaussians, camera: &PinholeCamera, poses: &[RigidTransform]) -> Vec<f32> {
    let cameras_from_world: Vec<RigidTransform> = poses.iter().map(RigidTransform::inverse).collect();
    let [x, y, z] = [MEAN, MEAN + 1, MEAN + 2].map(|plane| &map.planes()[plane]);
    let edge = |((x, y), z): ((&f32, &f32), &f32)| {
        let place = Vector3::new(*x, *y, *z).cast::<f64>();
        let seen = cameras_from_world.iter().map(|pose| pose.transform_point(&place));
        let depths = seen.filter(|point| is_in_view(point, camera)).map(|point| point.z);
        let nearest = depths.fold(f64::INFINITY, f64::min);
        if nearest.is_finite() { (nearest / (camera.fx * camera.fy).sqrt()) as f32 } else { 0.0 }
    };
    x.iter().zip(y).zip(z).map(edge).collect()
}

fn is_in_view(point: &Vector3<f64>, camera: &PinholeCamera) -> bool {
    let (u, v) = (camera.fx * point.x / point.z + camera.cx, camera.fy * point.y / point.z + camera.cy);
    let within = |pixel: f64, size: usize| (-0.5..=size as f64 - 0.5).contains(&pixel);
    point.z > NEAR_PLANE && within(u, camera.width) && within(v, camera.height)
}

/// Logarithms of the deviations along the own axes that Gaussians have for viewers, metres. Those without a pixel keep theirs.
pub(super) fn for_screens(map: &Gaussians, pixel_edges: &[f32]) -> [Vec<f32>; 3] {
    let grown = |(scale, edge): (&f32, &f32)| {
        let more = GROWTH * edge * edge;
        if more > 0.0 { 0.5 * (BORDER * ((2.0 * scale).exp() + more)).ln() } else { *scale }
    };
    core::array::from_fn(|axis| map.planes()[LOG_SCALE + axis].iter().zip(pixel_edges).map(grown).collect())
}

#[cfg(test)]
mod tests {
    use mba_raster::gaussians::Gaussian;

    use super::*;

    #[test]
    fn the_nearest_view_tells_how_thick_a_gaussian_is() {
        let camera = PinholeCamera { width: 64, height: 48, fx: 50.0, fy: 50.0, cx: 31.5, cy: 23.5 };
        let at = |x: f32, z: f32| Gaussian {
            mean: [x, 0.0, z],
            log_scale: [-9.0, -5.0, 0.0],
            ..Gaussian::default()
        };
        let map: Gaussians = [at(0.0, 2.0), at(0.0, -2.0), at(5.0, 2.0)].into_iter().collect();
        let nearer =
            RigidTransform { translation: Vector3::new(0.0, 0.0, 1.0), ..RigidTransform::identity() };
        let edges = pixel_edges(&map, &camera, &[RigidTransform::identity(), nearer]);
        // One metre at a focal length of 50 pixels; behind the camera; beside the image.
        assert_eq!(edges, [0.02, 0.0, 0.0]);
        let [x, _, z] = for_screens(&map, &edges);
        // 0.1 mm beside 0.2 times 2 cm squared; a metre beside that.
        let expected = (BORDER * ((-18.0_f32).exp() + 0.2 * 0.0004)).sqrt();
        assert!((x[0].exp() - expected).abs() < 1e-6, "{}", x[0].exp());
        assert!((z[0].exp() - BORDER.sqrt()).abs() < 1e-3);
        assert_eq!((x[1], x[2]), (-9.0, -9.0));
    }
}
