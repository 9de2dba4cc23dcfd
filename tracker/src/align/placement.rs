//! Where the keyframe's keypoints are seen in the current frame.

use nalgebra::Vector3;

use super::objective::FrameData;
use crate::geometry::PinholeCamera;
use crate::keyframe::Keypoint;
use crate::math::{round_half_up_to_i32, sqrt_f32};
use crate::surface::spread_limit;
use crate::trajectory::ExposureTrajectory;
use crate::transfer::{PATTERN_RADIUS, PatchSite};

/// Projects keypoints at mid exposure and keeps those that are inside the image and not hidden behind a nearer
/// surface of the current depth map. Returns the number of sites.
pub fn place_sites(
    keyframe_from_camera: &ExposureTrajectory,
    keypoints: &[Keypoint],
    camera: &PinholeCamera,
    level: usize,
    frame: &FrameData,
    sites: &mut [PatchSite],
) -> usize {
    let camera_from_keyframe = keyframe_from_camera.mid().inverse();
    let rotation = camera_from_keyframe.rotation_matrix().map(|x| x as f32);
    let translation = camera_from_keyframe.translation.map(|x| x as f32);
    let (fx, fy, cx, cy) = (camera.fx as f32, camera.fy as f32, camera.cx as f32, camera.cy as f32);
    let region = frame.region.at_level(level).shrunk(PATTERN_RADIUS);
    let mut count = 0;
    for keypoint in keypoints {
        let ray = Vector3::new((keypoint.u - cx) / fx, (keypoint.v - cy) / fy, 1.0);
        // Scaled by inverse depth, so far points stay finite.
        let x = rotation * ray + translation * keypoint.inverse_depth;
        if x.z <= 1e-3 || count == sites.len() {
            continue;
        }
        let (u, v) = (fx * x.x / x.z + cx, fy * x.y / x.z + cy);
        let (column, row) = (round_half_up_to_i32(u), round_half_up_to_i32(v));
        if !region.contains(column, row) {
            continue;
        }
        let at = |pixel: f32| PinholeCamera::pixel_at_level(pixel, level, frame.depth_level);
        let expected = keypoint.inverse_depth / x.z;
        let hidden = frame
            .depth
            .sample(at(u), at(v))
            .is_some_and(|observed| (observed - expected).abs() > 2.0 * spread_limit(expected));
        if !hidden {
            sites[count] =
                PatchSite { u: column as i16, v: row as i16, inverse_depth: keypoint.inverse_depth };
            count += 1;
        }
    }
    count
}

/// Mean distance in pixels between the projections of the sites at shutter opening and closing.
#[must_use]
pub fn blur_length(
    keyframe_from_camera: &ExposureTrajectory,
    keypoints: &[Keypoint],
    camera: &PinholeCamera,
) -> f32 {
    let start = keyframe_from_camera.start.inverse();
    let end = keyframe_from_camera.end.inverse();
    let (mut sum, mut count) = (0.0, 0usize);
    let step = (keypoints.len() / 64).max(1);
    for keypoint in keypoints.iter().step_by(step) {
        let point =
            camera.ray(f64::from(keypoint.u), f64::from(keypoint.v)) / f64::from(keypoint.inverse_depth);
        let (a, b) = (start.transform_point(&point), end.transform_point(&point));
        if a.z > 0.05 && b.z > 0.05 {
            let d = (camera.project(&a) - camera.project(&b)).map(|x| x as f32);
            sum += sqrt_f32(d.x * d.x + d.y * d.y);
            count += 1;
        }
    }
    if count == 0 { 0.0 } else { sum / count as f32 }
}
