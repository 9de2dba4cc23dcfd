//! Where the keyframe's keypoints are seen in the current frame.

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector3};

use super::problem::FrameData;
use crate::geometry::{PinholeCamera, RigidTransform};
use crate::keyframe::Keypoint;
use crate::math::{round_half_up_to_i32, sqrt_f32};
use crate::surface::spread_limit;
use crate::trajectory::{BowedTrajectory, ExposureTrajectory, FrameTiming};
use crate::transfer::{MAX_BANDS, PATTERN_RADIUS, PatchSite, RowBand};

/// `camera_from_keyframe` in single precision.
#[derive(Clone, Copy)]
struct Projection {
    rotation: Matrix3<f32>,
    translation: Vector3<f32>,
}

impl Projection {
    fn new(keyframe_from_camera: &RigidTransform) -> Self {
        let inverse = keyframe_from_camera.inverse();
        Self {
            rotation: inverse.rotation_matrix().map(|x| x as f32),
            translation: inverse.translation.map(|x| x as f32),
        }
    }

    /// The point on `ray` times its inverse depth, so that far points stay finite.
    fn apply(&self, ray: &Vector3<f32>, inverse_depth: f32) -> Vector3<f32> {
        self.rotation * ray + self.translation * inverse_depth
    }
}

/// Projects keypoints at the time when the row is exposed in which they are seen, and keeps those that are inside the
/// image and not hidden behind a nearer surface of the current depth map. Returns the number of sites; where rows have
/// times of their own, they are sorted by row.
pub fn place_sites(
    path: &BowedTrajectory,
    timing: &FrameTiming,
    keypoints: &[Keypoint],
    camera: &PinholeCamera,
    level: usize,
    frame: &FrameData,
    sites: &mut [PatchSite],
) -> usize {
    let middle = Projection::new(&path.at(0.5));
    // A patch must contain its keypoint, not be centred on it exactly: the pose of a band serves.
    let mut of_band: ArrayVec<Projection, MAX_BANDS> = ArrayVec::new();
    if timing.is_rolling() {
        let bands = timing.bands.clamp(1, MAX_BANDS);
        of_band.extend((0..bands).map(|band| {
            let row = RowBand::new(band, bands, camera.height).centre();
            Projection::new(&path.at(timing.row_time(row, camera.height)))
        }));
    }
    let (fx, fy, cx, cy) = (camera.fx as f32, camera.fy as f32, camera.cx as f32, camera.cy as f32);
    let region = frame.region.at_level(level).shrunk(PATTERN_RADIUS);
    let mut count = 0;
    for keypoint in keypoints {
        let ray = Vector3::new((keypoint.u - cx) / fx, (keypoint.v - cy) / fy, 1.0);
        let mut x = middle.apply(&ray, keypoint.inverse_depth);
        if !of_band.is_empty() && x.z > 1e-3 {
            let row = (fy * x.y / x.z + cy).clamp(0.0, camera.height as f32 - 1.0);
            let band = (row * of_band.len() as f32 / camera.height as f32) as usize;
            x = of_band[band.min(of_band.len() - 1)].apply(&ray, keypoint.inverse_depth);
        }
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
    if timing.is_rolling() {
        sites[..count].sort_unstable_by_key(|site| (site.v, site.u));
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
