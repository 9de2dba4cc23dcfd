//! Averaging depth into the keyframe whose rows were measured one after the other.

use fearless_simd::{Level, dispatch, f32x8, prelude::*};

use super::row_views::{RowViews, pixels_of, rays_of};
use crate::geometry::PinholeCamera;
use crate::surface::{InverseDepthMap, fuse_lanes, lanes_of};
use crate::trajectory::{BowedTrajectory, FrameTiming};

/// Rounds of looking at which row sees a point: each leaves the row's motion per row, below a fifth, of the error before, and
/// a row more or less moves a point by that much of a pixel.
const ROUNDS: usize = 2;

/// Pixels that are fused at the same time.
const LANES: usize = 8;

/// Least distance in front of the camera, as a share of the point's depth in the keyframe.
const MIN_Z: f32 = 0.1;

/// As [`crate::surface::fuse_depth`], for a frame that moved along `keyframe_from_camera` while the rows of `current` were
/// measured at the times of `timing`. `camera` is that of the depth maps.
///
/// Costs about twice as much: 60 floating-point operations per pixel of the depth map and round.
pub(super) fn fuse_rolling_depth(
    level: Level,
    keyframe: &mut InverseDepthMap,
    weights: &mut [f32],
    current: &InverseDepthMap,
    keyframe_from_camera: &BowedTrajectory,
    timing: &FrameTiming,
    camera: &PinholeCamera,
) {
    let height = keyframe.height;
    let views = RowViews::new(keyframe_from_camera, |v| timing.depth_row_time(v, height), height);
    dispatch!(level, simd => fuse_rows(simd, keyframe, weights, current, &views, camera));
}

#[inline(always)]
fn fuse_rows<S: Simd>(
    simd: S,
    keyframe: &mut InverseDepthMap,
    weights: &mut [f32],
    current: &InverseDepthMap,
    views: &RowViews,
    camera: &PinholeCamera,
) {
    let one = f32x8::splat(simd, 1.0);
    let rows = keyframe.values.chunks_exact_mut(keyframe.width).zip(weights.chunks_exact_mut(keyframe.width));
    for (v, (values, weights)) in rows.enumerate() {
        for first in (0..keyframe.width).step_by(LANES) {
            let rho = lanes_of(simd, values, first);
            let mut in_front = rho.simd_gt(0.0);
            if in_front.all_false() {
                continue;
            }
            let ray = rays_of(simd, camera, f32x8::from_fn(simd, |lane| (first + lane) as f32), v as f32);
            let mut view = views.at(simd, f32x8::splat(simd, v as f32));
            let mut pixel = [rho; 2];
            let mut expected = rho;
            for _ in 0..ROUNDS {
                // The point times its inverse depth, in the camera that measured the row.
                let point = view.points(ray, rho);
                in_front &= point[2].simd_gt(MIN_Z);
                pixel = pixels_of(simd, camera, &point, in_front);
                expected = rho / in_front.select(point[2], one);
                view = views.at(simd, pixel[1]);
            }
            let seen = current.sample_lanes(simd, in_front, pixel[0], pixel[1]);
            let along = [view.turned(2, ray), view.shift(2)];
            fuse_lanes(simd, [&mut *values, &mut *weights], first, seen, expected, along);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use nalgebra::{Vector3, Vector6};

    use super::*;
    use crate::geometry::RigidTransform;
    use crate::simd::{level_name, levels_up_to};
    use crate::trajectory::ExposureTrajectory;

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 64, height: 48, fx: 60.0, fy: 60.0, cx: 31.5, cy: 23.5 };

    /// A camera that turns and moves by several pixels from the first row to the last.
    fn path() -> BowedTrajectory {
        let motion = Vector6::new(0.06, -0.04, 0.1, 0.03, -0.08, 0.05);
        let mid = RigidTransform::identity().perturbed(&Vector6::new(0.1, -0.05, 0.2, 0.02, -0.03, 0.05));
        BowedTrajectory::without_bow(ExposureTrajectory::from_mid_and_motion(&mid, &motion))
    }

    /// Inverse depth of the plane `n x = 1` in row `k / 64` of a camera at the pose of its time.
    fn plane_view(pose_of_row: impl Fn(usize) -> RigidTransform) -> Vec<f32> {
        let n = Vector3::new(0.05, -0.03, 0.5);
        let value = |k: usize| {
            let pose = pose_of_row(k / 64);
            let ray = pose.rotation * CAMERA.ray((k % 64) as f64, (k / 64) as f64);
            (n.dot(&ray) / (1.0 - n.dot(&pose.translation))) as f32
        };
        (0..64 * 48).map(value).collect()
    }

    #[test]
    fn rows_of_different_times_fuse_into_an_exact_surface() {
        let (path, timing) =
            (path(), FrameTiming { depth_time: 0.1, depth_readout: 0.8, ..FrameTiming::GLOBAL });
        let truth = plane_view(|_| RigidTransform::identity());
        for level in levels_up_to(Level::new()) {
            let mut keyframe: Vec<f32> = truth.iter().map(|rho| rho + 0.001).collect();
            let mut weights = vec![1.0; 64 * 48];
            let mut current = plane_view(|v| path.at(timing.depth_row_time(v as f64, 48)));
            let map = |values| InverseDepthMap { values, width: 64, height: 48, level: 0 };
            fuse_rolling_depth(
                level,
                &mut map(&mut keyframe),
                &mut weights,
                &map(&mut current),
                &path,
                &timing,
                &CAMERA,
            );
            let fused: Vec<usize> = (0..64 * 48).filter(|&k| weights[k] == 2.0).collect();
            let name = level_name(level);
            assert!(fused.len() > 2000, "{name}: only {} pixels overlap", fused.len());
            for k in fused {
                let error = keyframe[k] - truth[k];
                assert!(
                    (error - 0.0005).abs() < 4e-5,
                    "{name}: half of the first error remains, not {error}"
                );
            }
        }
    }
}
