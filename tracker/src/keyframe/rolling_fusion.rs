//! Averaging depth into the keyframe whose rows were measured one after the other.

use super::row_views::{RowViews, pixel_of, ray_of};
use crate::geometry::PinholeCamera;
use crate::surface::{InverseDepthMap, fuse_measurement};
use crate::trajectory::{BowedTrajectory, FrameTiming};

/// Rounds of looking at which row sees a point: each leaves the row's motion per row, below a fifth, of the error before, and
/// a row more or less moves a point by that much of a pixel.
const ROUNDS: usize = 2;

/// As [`crate::surface::fuse_depth`], for a frame that moved along `keyframe_from_camera` while the rows of `current` were
/// measured at the times of `timing`. `camera` is that of the depth maps.
///
/// Costs about twice as much: 60 floating-point operations per pixel of the depth map and round.
pub(super) fn fuse_rolling_depth(
    keyframe: &mut InverseDepthMap,
    weights: &mut [f32],
    current: &InverseDepthMap,
    keyframe_from_camera: &BowedTrajectory,
    timing: &FrameTiming,
    camera: &PinholeCamera,
) {
    let (width, height) = (keyframe.width, keyframe.height);
    let views = RowViews::new(keyframe_from_camera, |v| timing.depth_row_time(v, height), height);
    for v in 0..height {
        for u in 0..width {
            let index = v * width + u;
            let rho = keyframe.values[index];
            if rho <= 0.0 {
                continue;
            }
            let ray = ray_of(camera, u as f32, v as f32);
            let mut view = views.at(v as f32);
            let mut seen = None;
            for _ in 0..ROUNDS {
                // The point times its inverse depth, in the camera that measured the row.
                let point = view.rotation * ray + view.translation * rho;
                seen = (point.z > 0.1).then(|| (pixel_of(camera, &point), rho / point.z));
                let Some((pixel, _)) = seen else { break };
                view = views.at(pixel[1]);
            }
            let Some((pixel, expected)) = seen else { continue };
            let Some(measured) = current.sample(pixel[0], pixel[1]) else { continue };
            let turned = view.rotation.row(2).transpose().dot(&ray);
            let (value, weight) = (&mut keyframe.values[index], &mut weights[index]);
            fuse_measurement(value, weight, measured, expected, [turned, view.translation.z]);
        }
    }
}
