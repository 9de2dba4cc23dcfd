//! Keypoint selection: the strongest gradient of every grid cell whose depth is known.

use bytemuck::{Pod, Zeroable};

use crate::geometry::PinholeCamera;
use crate::image::PixelRectangle;
use crate::math::sqrt_f32;
use crate::surface::SurfacePlanes;
use crate::transfer::{LevelImage, PATTERN_RADIUS};

/// A pixel of the reference image with the plane it lies on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Keypoint {
    /// Column in its pyramid level.
    pub u: f32,
    /// Row in its pyramid level.
    pub v: f32,
    /// Inverse depth in the keyframe, 1/m.
    pub inverse_depth: f32,
    /// Gradient magnitude in noise standard deviations.
    pub strength: f32,
}

/// What counts as a keypoint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SelectionSettings {
    /// Edge of a grid cell in pixels of the level; one keypoint per cell.
    pub cell: usize,
    /// Least gradient magnitude divided by `sqrt(intensity + dark_intensity)`, per pixel.
    pub min_strength: f32,
    /// Intensity at which constant noise equals photon noise, linear light.
    pub dark_intensity: f32,
    /// Part of the image that holds data.
    pub region: PixelRectangle,
}

/// Selects keypoints of one pyramid level, at most one per cell, in row-major cell order; returns how many.
///
/// `planes` are the keyframe's surface planes on pyramid level `planes_level`; pixels without a plane (holes and
/// depth edges) are never selected. `keypoints` bounds the number.
pub fn select_keypoints(
    image: &LevelImage,
    level: usize,
    planes: &SurfacePlanes,
    planes_level: usize,
    settings: &SelectionSettings,
    keypoints: &mut [Keypoint],
) -> usize {
    let region = settings.region.shrunk(PATTERN_RADIUS + 1);
    let cell = settings.cell.max(1);
    let mut count = 0;
    for cell_v in (region.top..region.bottom.min(image.height)).step_by(cell) {
        for cell_u in (region.left..region.right.min(image.width)).step_by(cell) {
            if count == keypoints.len() {
                return count;
            }
            let last_v = (cell_v + cell).min(region.bottom);
            let last_u = (cell_u + cell).min(region.right);
            let Some((u, v, strength)) = strongest(image, cell_u..last_u, cell_v..last_v, settings) else {
                continue;
            };
            let at = |x: usize| PinholeCamera::pixel_at_level(x as f32, level, planes_level);
            if let Some(inverse_depth) = planes.inverse_depth(at(u), at(v)) {
                keypoints[count] = Keypoint { u: u as f32, v: v as f32, inverse_depth, strength };
                count += 1;
            }
        }
    }
    count
}

/// The pixel of a cell with the largest whitened gradient, if it is strong enough.
fn strongest(
    image: &LevelImage,
    columns: core::ops::Range<usize>,
    rows: core::ops::Range<usize>,
    settings: &SelectionSettings,
) -> Option<(usize, usize, f32)> {
    let w = image.width;
    let mut best = None;
    let mut best_squared = settings.min_strength * settings.min_strength;
    for v in rows {
        let row = &image.pixels[v * w..][..w];
        let above = &image.pixels[(v - 1) * w..][..w];
        let below = &image.pixels[(v + 1) * w..][..w];
        for u in columns.clone() {
            let (gu, gv) = (0.5 * (row[u + 1] - row[u - 1]), 0.5 * (below[u] - above[u]));
            let squared = (gu * gu + gv * gv) / (row[u] + settings.dark_intensity);
            if squared > best_squared {
                best_squared = squared;
                best = Some((u, v));
            }
        }
    }
    best.map(|(u, v)| (u, v, sqrt_f32(best_squared)))
}
