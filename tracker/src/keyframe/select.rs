//! Keypoint selection: the strongest gradient of every grid cell whose depth is known.

use bytemuck::{Pod, Zeroable};
use fearless_simd::{Level, dispatch, f32x4, prelude::*};

use crate::geometry::PinholeCamera;
use crate::image::LevelImage;
use crate::image::PixelRectangle;
use crate::surface::{SurfacePlanes, lanes_of};
use crate::transfer::PATTERN_RADIUS;

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
    simd: Level,
    image: &LevelImage,
    level: usize,
    planes: &SurfacePlanes,
    planes_level: usize,
    settings: &SelectionSettings,
    keypoints: &mut [Keypoint],
) -> usize {
    dispatch!(simd, simd => select_on(simd, image, level, planes, planes_level, settings, keypoints))
}

#[inline(always)]
fn select_on<S: Simd>(
    simd: S,
    image: &LevelImage,
    level: usize,
    planes: &SurfacePlanes,
    planes_level: usize,
    settings: &SelectionSettings,
    keypoints: &mut [Keypoint],
) -> usize {
    // A patch and its gradient have to fit in.
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
            let Some((u, v, strength)) = strongest(simd, image, cell_u..last_u, cell_v..last_v, settings)
            else {
                continue;
            };
            let at = |x: usize| PinholeCamera::pixel_at_level(x as f32, level, planes_level);
            // Without a plane the patch would be at any depth.
            if let Some(inverse_depth) = planes.inverse_depth(at(u), at(v)) {
                keypoints[count] = Keypoint { u: u as f32, v: v as f32, inverse_depth, strength };
                count += 1;
            }
        }
    }
    count
}

/// Inverse depth in 1/m of the keypoint in the middle of the list, which is near the middle of the image; 0.5 if
/// there is none.
#[must_use]
pub fn typical_inverse_depth(keypoints: &[Keypoint]) -> f64 {
    keypoints.get(keypoints.len() / 2).map_or(0.5, |keypoint| f64::from(keypoint.inverse_depth))
}

/// Pixels whose gradients are computed at once.
const RUN: usize = 8;

/// The pixel of a cell with the largest whitened gradient, if it is strong enough.
#[inline(always)]
fn strongest<S: Simd>(
    simd: S,
    image: &LevelImage,
    columns: core::ops::Range<usize>,
    rows: core::ops::Range<usize>,
    settings: &SelectionSettings,
) -> Option<(usize, usize, f32)> {
    let w = image.width;
    let mut best = None;
    let mut best_squared = settings.min_strength * settings.min_strength;
    for v in rows {
        // The rest of the image from the cell's row on, and from the neighbours of its first pixel.
        let from = |row: usize, shift: usize| &image.pixels[row * w + columns.start + shift - 1..];
        let (centre, left, right) = (from(v, 1), from(v, 0), from(v, 2));
        let (above, below) = (from(v - 1, 1), from(v + 1, 1));
        for first in (0..columns.len()).step_by(RUN) {
            let of = |row: &[f32]| lanes_of(simd, row, first);
            let (gu, gv) = ((of(right) - of(left)) * 0.5, (of(below) - of(above)) * 0.5);
            // Photon noise grows with the light: gradients are compared in units of it.
            let strengths = (gu * gu + gv * gv) / (of(centre) + settings.dark_intensity);
            let in_cell = &strengths.as_slice()[..RUN.min(columns.len() - first)];
            // Few runs have a stronger pixel than those before: which one it is, is looked up only then.
            if strengths.simd_gt(best_squared).any_true() {
                let largest = in_cell.iter().fold(best_squared, |a, &b| if b > a { b } else { a });
                if largest > best_squared
                    && let Some(k) = in_cell.iter().position(|&strength| strength == largest)
                {
                    (best_squared, best) = (largest, Some((columns.start + first + k, v)));
                }
            }
        }
    }
    // In a vector, as everything here.
    best.map(|(u, v)| (u, v, f32x4::splat(simd, best_squared).sqrt()[0]))
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::*;

    const SIZE: (usize, usize) = (96, 64);
    const SETTINGS: SelectionSettings = SelectionSettings {
        cell: 12,
        min_strength: 0.02,
        dark_intensity: 0.02,
        region: PixelRectangle { left: 8, top: 4, right: 90, bottom: 60 },
    };

    fn textured() -> Vec<f32> {
        let light = |u: f32, v: f32| 0.4 + 0.2 * (0.7 * u + 0.2 * v).sin() + 0.1 * (0.5 * v - 0.3 * u).cos();
        (0..SIZE.0 * SIZE.1).map(|k| light((k % SIZE.0) as f32, (k / SIZE.0) as f32)).collect()
    }

    /// Keypoints of an image whose planes are on level 1, missing where `hole` says so.
    fn selected(image: &[f32], hole: impl Fn(usize, usize) -> bool, capacity: usize) -> Vec<Keypoint> {
        let (width, height) = (SIZE.0 / 2, SIZE.1 / 2);
        let mut value: Vec<f32> = (0..width * height)
            .map(|k| if hole(k % width, k / width) { 0.0 } else { 0.3 + 0.001 * (k % width) as f32 })
            .collect();
        let (mut slope_u, mut slope_v) = (vec![0.001; width * height], vec![0.0; width * height]);
        let planes =
            SurfacePlanes { value: &mut value, slope_u: &mut slope_u, slope_v: &mut slope_v, width, height };
        let image = LevelImage { pixels: image, width: SIZE.0, height: SIZE.1 };
        let mut keypoints = vec![Keypoint::default(); capacity];
        let count = select_keypoints(Level::new(), &image, 0, &planes, 1, &SETTINGS, &mut keypoints);
        keypoints.truncate(count);
        keypoints
    }

    /// The grid cell of a keypoint; the grid starts a patch radius and a pixel inside of the region.
    fn cell_of(keypoint: &Keypoint) -> (usize, usize) {
        let margin = PATTERN_RADIUS + 1;
        let cell = |x: f32, first: usize| (x as usize - first - margin) / SETTINGS.cell;
        (cell(keypoint.u, SETTINGS.region.left), cell(keypoint.v, SETTINGS.region.top))
    }

    #[test]
    fn one_per_cell_inside_of_the_region_with_the_depth_of_the_plane() {
        let keypoints = selected(&textured(), |_, _| false, 100);
        let mut cells: Vec<_> = keypoints.iter().map(cell_of).collect();
        let count = cells.len();
        assert!(count >= 20, "only {count} of 24 cells have a keypoint");
        cells.sort_unstable();
        cells.dedup();
        assert_eq!(cells.len(), count, "a cell has two keypoints");
        for k in &keypoints {
            let margin = PATTERN_RADIUS as f32;
            assert!(k.u - margin >= 8.0 && k.v - margin >= 4.0 && k.u + margin < 90.0 && k.v + margin < 60.0);
            let expected = 0.3 + 0.001 * ((k.u + 0.5) / 2.0 - 0.5);
            assert!((k.inverse_depth - expected).abs() < 1e-6);
            assert!(k.strength > SETTINGS.min_strength);
        }
        assert_eq!(keypoints, selected(&textured(), |_, _| false, 100), "not deterministic");
    }

    #[test]
    fn the_strongest_gradient_of_the_cell_wins() {
        let mut image = vec![0.5; SIZE.0 * SIZE.1];
        for v in 0..SIZE.1 {
            image[v * SIZE.0 + 40..(v + 1) * SIZE.0].fill(0.6);
            image[v * SIZE.0 + 43..(v + 1) * SIZE.0].fill(0.9);
        }
        let keypoints = selected(&image, |_, _| false, 100);
        assert!(!keypoints.is_empty());
        // The larger of two steps is between columns 42 and 43; the darker side has the larger whitened gradient.
        assert!(keypoints.iter().all(|k| k.u == 42.0), "{keypoints:?}");
        let expected = 0.15 / (0.6f32 + SETTINGS.dark_intensity).sqrt();
        assert!((keypoints[0].strength - expected).abs() < 1e-5);
    }

    #[test]
    fn nothing_on_holes_and_nothing_without_texture() {
        let hole = |u: usize, _: usize| (10..30).contains(&u);
        for k in selected(&textured(), hole, 100) {
            assert!(!(19.5..59.5).contains(&k.u), "keypoint on a hole at column {}", k.u);
        }
        assert!(selected(&vec![0.5; SIZE.0 * SIZE.1], |_, _| false, 100).is_empty());
        assert!(selected(&textured(), |_, _| true, 100).is_empty());
    }

    #[test]
    fn the_capacity_bounds_the_number() {
        let all = selected(&textured(), |_, _| false, 100);
        assert_eq!(selected(&textured(), |_, _| false, 7), all[..7]);
        assert!(selected(&textured(), |_, _| false, 0).is_empty());
    }
}
