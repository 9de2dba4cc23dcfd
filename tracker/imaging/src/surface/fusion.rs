//! Averaging the depth of tracked frames into the keyframe.
//!
//! A frame whose pose is known measures the keyframe's surface again. The mean over frames has less noise than any
//! single depth map, and holes fill up.

use crate::geometry::{PinholeCamera, RigidTransform};
use crate::surface::{InverseDepthMap, spread_limit};

/// Frames that count at the most: later ones still correct what earlier ones got wrong.
const MAX_WEIGHT: f32 = 16.0;

/// Fuses `current`, seen by a camera at `keyframe_from_camera`, into `keyframe`, both of `camera`. `weights` holds
/// the number of measurements behind every pixel of the keyframe.
///
/// A measurement counts where the current frame sees the surface that the keyframe sees; a missing pixel of the
/// keyframe stays missing, since only its own view tells which surface is in front.
pub fn fuse_depth(
    keyframe: &mut InverseDepthMap,
    weights: &mut [f32],
    current: &InverseDepthMap,
    keyframe_from_camera: &RigidTransform,
    camera: &PinholeCamera,
) {
    let camera_from_keyframe = keyframe_from_camera.inverse();
    let rotation = camera_from_keyframe.rotation_matrix().map(|x| x as f32);
    let translation = camera_from_keyframe.translation.map(|x| x as f32);
    let (fx, fy) = (camera.fx as f32, camera.fy as f32);
    let (cx, cy) = (camera.cx as f32, camera.cy as f32);
    let width = keyframe.width;
    for v in 0..keyframe.height {
        let y = (v as f32 - cy) / fy;
        let row_ray = rotation.column(1) * y + rotation.column(2);
        for u in 0..width {
            let index = v * width + u;
            let rho = keyframe.values[index];
            if rho <= 0.0 {
                continue;
            }
            // The point times its inverse depth, in the current camera.
            let ray = row_ray + rotation.column(0) * ((u as f32 - cx) / fx);
            let point = ray + translation * rho;
            if point.z < 0.1 {
                continue;
            }
            let inverse_z = 1.0 / point.z;
            let seen = current.sample(fx * point.x * inverse_z + cx, fy * point.y * inverse_z + cy);
            let Some(measured) = seen else { continue };
            let expected = rho * inverse_z;
            let (value, weight) = (&mut keyframe.values[index], &mut weights[index]);
            fuse_measurement(value, weight, measured, expected, [ray.z, translation.z]);
        }
    }
}

/// Fuses one measurement of the current frame's inverse depth into `value`, that of a keyframe's pixel behind which there are
/// `weight` measurements, if it is near the one that is `expected` there. A point on the pixel's ray at the depth `z` lies at
/// `ray_z * z + shift_z` in the current camera.
#[inline]
pub fn fuse_measurement(
    value: &mut f32,
    weight: &mut f32,
    measured: f32,
    expected: f32,
    [ray_z, shift_z]: [f32; 2],
) {
    let difference = measured - expected;
    if difference.abs() < spread_limit(expected) {
        let corrected = ray_z * measured / (1.0 - shift_z * measured).max(0.1);
        *value += (corrected - *value) / (*weight + 1.0);
        *weight = (*weight + 1.0).min(MAX_WEIGHT);
    }
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use nalgebra::Vector6;

    use super::*;

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 64, height: 48, fx: 60.0, fy: 60.0, cx: 31.5, cy: 23.5 };

    /// Roughly normal numbers of unit variance: the centred sum of twelve uniform ones.
    struct Noise(u64);

    impl Noise {
        fn next(&mut self) -> f32 {
            let uniform = |state: &mut u64| {
                *state =
                    state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (*state >> 40) as f32 / 16_777_216.0
            };
            (0..12).map(|_| uniform(&mut self.0)).sum::<f32>() - 6.0
        }
    }

    fn map(values: &mut [f32]) -> InverseDepthMap<'_> {
        InverseDepthMap { values, width: 64, height: 48, level: 0 }
    }

    /// Mean square difference from `expected` away from the last row and column, which bilinear samples miss.
    fn variance(values: &[f32], expected: f32) -> f32 {
        let inner = |k: &usize| k % 64 < 63 && k / 64 < 47;
        let squares: Vec<f32> = (0..64 * 48).filter(inner).map(|k| (values[k] - expected).powi(2)).collect();
        squares.iter().sum::<f32>() / squares.len() as f32
    }

    #[test]
    fn every_measurement_counts_equally() {
        const SIGMA: f32 = 0.002;
        let mut noise = Noise(1);
        let mut draw = || -> Vec<f32> { (0..64 * 48).map(|_| 0.5 + SIGMA * noise.next()).collect() };
        let mut keyframe = draw();
        let mut weights = vec![1.0; 64 * 48];
        for frames in 1..16 {
            let mut current = draw();
            // Far less than a pixel: no smoothing by the bilinear sample, but nothing special about identity.
            let pose = RigidTransform::identity();
            fuse_depth(&mut map(&mut keyframe), &mut weights, &map(&mut current), &pose, &CAMERA);
            let expected = SIGMA * SIGMA / (frames + 1) as f32;
            let ratio = variance(&keyframe, 0.5) / expected;
            // 3000 samples: the variance is known to 2.6 %; five times that.
            assert!((ratio - 1.0).abs() < 0.13, "after {frames} frames: {ratio} times the expected variance");
        }
    }

    /// Inverse depth of the plane `n x = 1` seen from a camera at `plane_from_camera`.
    fn plane_view(normal: [f64; 3], pose: &RigidTransform) -> Vec<f32> {
        let n = nalgebra::Vector3::from(normal);
        (0..64 * 48)
            .map(|k| {
                let ray = pose.rotation * CAMERA.ray((k % 64) as f64, (k / 64) as f64);
                (n.dot(&ray) / (1.0 - n.dot(&pose.translation))) as f32
            })
            .collect()
    }

    #[test]
    fn an_exact_surface_stays_exact_whatever_the_pose() {
        let normal = [0.05, -0.03, 0.5];
        let pose = RigidTransform::identity().perturbed(&Vector6::new(0.1, -0.05, 0.2, 0.02, -0.03, 0.05));
        let truth = plane_view(normal, &RigidTransform::identity());
        let mut keyframe: Vec<f32> = truth.iter().map(|rho| rho + 0.001).collect();
        let mut weights = vec![1.0; 64 * 48];
        let mut current = plane_view(normal, &pose);
        fuse_depth(&mut map(&mut keyframe), &mut weights, &map(&mut current), &pose, &CAMERA);
        let fused: Vec<usize> = (0..64 * 48).filter(|&k| weights[k] == 2.0).collect();
        assert!(fused.len() > 2000, "only {} pixels overlap", fused.len());
        for k in fused {
            let error = keyframe[k] - truth[k];
            assert!((error - 0.0005).abs() < 2e-5, "half of the first error remains, not {error}");
        }
    }

    #[test]
    fn holes_stay_and_other_surfaces_do_not_mix() {
        let mut keyframe = vec![0.5; 64 * 48];
        keyframe[10 * 64 + 10] = 0.0;
        let mut current = vec![1.0; 64 * 48];
        let mut weights = vec![1.0; 64 * 48];
        let pose = RigidTransform::identity();
        fuse_depth(&mut map(&mut keyframe), &mut weights, &map(&mut current), &pose, &CAMERA);
        assert!(weights.iter().all(|weight| *weight == 1.0));
        assert_eq!(keyframe[10 * 64 + 10], 0.0);
        assert!(keyframe.iter().enumerate().all(|(k, rho)| k == 10 * 64 + 10 || *rho == 0.5));
    }
}
