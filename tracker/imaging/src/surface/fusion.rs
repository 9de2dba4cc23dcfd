//! Averaging the depth of tracked frames into the keyframe.
//!
//! A frame whose pose is known measures the keyframe's surface again. The mean over frames has less noise than any
//! single depth map, and holes fill up.

use fearless_simd::{Level, dispatch, f32x8, mask32x8, prelude::*};

use crate::geometry::{PinholeCamera, RigidTransform};
use crate::surface::{InverseDepthMap, spread_limits};

/// Pixels that are fused at the same time.
const LANES: usize = 8;

/// Least distance in front of the current camera, as a share of the point's depth in the keyframe.
const MIN_Z: f32 = 0.1;

/// Frames that count at the most: later ones still correct what earlier ones got wrong.
const MAX_WEIGHT: f32 = 16.0;

/// Fuses `current`, seen by a camera at `keyframe_from_camera`, into `keyframe`, both of `camera`. `weights` holds
/// the number of measurements behind every pixel of the keyframe.
///
/// A measurement counts where the current frame sees the surface that the keyframe sees; a missing pixel of the
/// keyframe stays missing, since only its own view tells which surface is in front.
pub fn fuse_depth(
    level: Level,
    keyframe: &mut InverseDepthMap,
    weights: &mut [f32],
    current: &InverseDepthMap,
    keyframe_from_camera: &RigidTransform,
    camera: &PinholeCamera,
) {
    dispatch!(level, simd => fuse_rows(simd, keyframe, weights, current, keyframe_from_camera, camera));
}

/// Eight pixels at a time: per vector eight loads of pairs and about 50 arithmetic operations.
#[inline(always)]
fn fuse_rows<S: Simd>(
    simd: S,
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
    let one = f32x8::splat(simd, 1.0);
    let rows = keyframe.values.chunks_exact_mut(keyframe.width).zip(weights.chunks_exact_mut(keyframe.width));
    for (v, (values, weights)) in rows.enumerate() {
        let y = (v as f32 - cy) / fy;
        let row_ray = rotation.column(1) * y + rotation.column(2);
        for first in (0..keyframe.width).step_by(LANES) {
            let rho = lanes_of(simd, values, first);
            let measured = rho.simd_gt(0.0);
            if measured.all_false() {
                continue;
            }
            // The point times its inverse depth, in the current camera.
            let x = (f32x8::from_fn(simd, |lane| (first + lane) as f32) - cx) / f32x8::splat(simd, fx);
            let ray: [f32x8<S>; 3] = core::array::from_fn(|i| x * rotation[(i, 0)] + row_ray[i]);
            let point: [f32x8<S>; 3] = core::array::from_fn(|i| rho * translation[i] + ray[i]);
            let in_front = measured & point[2].simd_ge(MIN_Z);
            let inverse_z = one / in_front.select(point[2], one);
            let pixel = [point[0] * fx * inverse_z + cx, point[1] * fy * inverse_z + cy];
            let seen = current.sample_lanes(simd, in_front, pixel[0], pixel[1]);
            let shift_z = f32x8::splat(simd, translation.z);
            fuse_lanes(simd, [&mut *values, &mut *weights], first, seen, rho * inverse_z, [ray[2], shift_z]);
        }
    }
}

/// The values from `first` on, continued by zeros.
#[inline(always)]
pub fn lanes_of<S: Simd>(simd: S, row: &[f32], first: usize) -> f32x8<S> {
    match row.get(first..first + LANES) {
        Some(values) => f32x8::from_slice(simd, values),
        None => f32x8::from_fn(simd, |lane| row.get(first + lane).copied().unwrap_or(0.0)),
    }
}

/// Writes the lanes that fall into the row from `first` on.
#[inline(always)]
pub fn store_lanes<S: Simd>(lanes: f32x8<S>, row: &mut [f32], first: usize) {
    let end = (first + LANES).min(row.len());
    row[first..end].copy_from_slice(&lanes.as_slice()[..end - first]);
}

/// Fuses eight measurements of the current frame's inverse depth, where there are such, into a row of the keyframe from pixel
/// `first` on; `row` holds its values and the number of measurements behind each. A measurement counts if it is near the one
/// that is `expected` there. A point on the pixel's ray at the depth `z` lies at `ray_z * z + shift_z` in the current camera.
#[inline(always)]
pub fn fuse_lanes<S: Simd>(
    simd: S,
    [values, weights]: [&mut [f32]; 2],
    first: usize,
    (seen, measured): (mask32x8<S>, f32x8<S>),
    expected: f32x8<S>,
    [ray_z, shift_z]: [f32x8<S>; 2],
) {
    let one = f32x8::splat(simd, 1.0);
    let counts = seen & (measured - expected).abs().simd_lt(spread_limits(expected));
    let corrected = ray_z * measured / (one - shift_z * measured).max(0.1);
    let (value, weight) = (lanes_of(simd, values, first), lanes_of(simd, weights, first));
    let more = weight + 1.0;
    store_lanes(counts.select(value + (corrected - value) / more, value), values, first);
    store_lanes(counts.select(more.min(MAX_WEIGHT), weight), weights, first);
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
            fuse_depth(
                Level::new(),
                &mut map(&mut keyframe),
                &mut weights,
                &map(&mut current),
                &pose,
                &CAMERA,
            );
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
        fuse_depth(Level::new(), &mut map(&mut keyframe), &mut weights, &map(&mut current), &pose, &CAMERA);
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
        fuse_depth(Level::new(), &mut map(&mut keyframe), &mut weights, &map(&mut current), &pose, &CAMERA);
        assert!(weights.iter().all(|weight| *weight == 1.0));
        assert_eq!(keyframe[10 * 64 + 10], 0.0);
        assert!(keyframe.iter().enumerate().all(|(k, rho)| k == 10 * 64 + 10 || *rho == 0.5));
    }
    #[test]
    fn every_instruction_set_fuses_what_the_plain_one_does() {
        let mut noise = Noise(5);
        let mut draw = |holes: usize| -> Vec<f32> {
            let value = |k: usize| 0.5 + 0.002 * (k % 64) as f32 / 64.0;
            (0..64 * 48).map(|k| if k % holes == 3 { 0.0 } else { value(k) + 0.001 * noise.next() }).collect()
        };
        let (keyframe, mut current) = (draw(17), draw(23));
        // Turned and moved by some pixels, so that parts leave the view.
        let pose = RigidTransform::identity().perturbed(&Vector6::new(0.05, -0.03, 0.1, 0.02, -0.05, 0.03));
        let mut fused = |level| {
            let (mut values, mut weights) = (keyframe.clone(), vec![1.0; 64 * 48]);
            fuse_depth(level, &mut map(&mut values), &mut weights, &map(&mut current), &pose, &CAMERA);
            (values, weights)
        };
        let (plain, plain_weights) = fused(Level::fallback());
        let count = plain_weights.iter().filter(|weight| **weight > 1.0).count();
        assert!(count > 1000, "only {count} pixels are fused");
        for level in crate::simd::levels_up_to(Level::new()) {
            let (values, weights) = fused(level);
            let name = crate::simd::level_name(level);
            // Rounding decides for some pixels at the border of the gate.
            let differ = weights.iter().zip(&plain_weights).filter(|(a, b)| a != b).count();
            assert!(differ <= 2, "{name}: {differ} pixels count otherwise");
            let apart = values.iter().zip(&plain).filter(|(a, b)| (**a - **b).abs() > 1e-6).count();
            assert!(apart <= 2, "{name}: {apart} values differ");
        }
    }
}
