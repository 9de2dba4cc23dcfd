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
            let difference = measured - expected;
            if difference.abs() < spread_limit(expected) {
                // Along the keyframe's ray z_current = ray.z / rho + translation.z.
                let corrected = ray.z * measured / (1.0 - translation.z * measured).max(0.1);
                let weight = weights[index];
                keyframe.values[index] = rho + (corrected - rho) / (weight + 1.0);
                weights[index] = (weight + 1.0).min(MAX_WEIGHT);
            }
        }
    }
}
