//! Rays to linear light: sharp and motion-blurred images, depth.

use glam::Vec3;
use rayon::prelude::*;

use super::scene::{Hit, Ray, Scene};
use super::view::View;

/// Side of the square of pixels for which visible things are looked up together.
const TILE: usize = 16;

/// A view and how far from the pixel centres its rays pass.
#[derive(Clone, Copy)]
pub(super) struct SubFrame {
    pub(super) view: View,
    /// Columns and rows.
    pub(super) offset: [f32; 2],
}

/// Size of an image in pixels.
#[derive(Clone, Copy)]
pub(super) struct Size {
    pub(super) width: usize,
    pub(super) height: usize,
}

/// `count` sampling positions within a pixel, evenly spread (Halton sequence) and zero on average, so that an
/// image is not shifted.
pub(super) fn jitter(count: usize) -> Vec<[f32; 2]> {
    let points: Vec<[f64; 2]> = (1..=count).map(|k| [radical_inverse(k, 2), radical_inverse(k, 3)]).collect();
    let mean = [0, 1].map(|axis| points.iter().map(|point| point[axis]).sum::<f64>() / count as f64);
    points.iter().map(|point| [(point[0] - mean[0]) as f32, (point[1] - mean[1]) as f32]).collect()
}

/// The digits of `index` in `base`, mirrored at the point.
fn radical_inverse(mut index: usize, base: usize) -> f64 {
    let (mut value, mut digit) = (0.0, 1.0);
    while index > 0 {
        digit /= base as f64;
        value += digit * (index % base) as f64;
        index /= base;
    }
    value
}

/// Four positions on a turned grid for sharp images.
pub(super) const TURNED_GRID: [[f32; 2]; 4] =
    [[-0.125, -0.375], [0.375, -0.125], [0.125, 0.375], [-0.375, 0.125]];

/// Mean linear RGB radiance over the sub-frames, row by row.
pub(super) fn radiance(scene: &Scene, size: Size, sub_frames: &[SubFrame]) -> Vec<Vec3> {
    let mut image = vec![Vec3::ZERO; size.width * size.height];
    image.par_chunks_mut(size.width * TILE).enumerate().for_each(|(band, pixels)| {
        let mut visible = Vec::new();
        for left in (0..size.width).step_by(TILE) {
            for sub_frame in sub_frames {
                let block = Block { left, top: band * TILE, width: TILE, height: TILE };
                add_block(scene, sub_frame, &block, size.width, pixels, &mut visible);
            }
        }
        let share = 1.0 / sub_frames.len() as f32;
        pixels.iter_mut().for_each(|pixel| *pixel *= share);
    });
    image
}

/// Pixels of a row for which visible things are looked up together.
const STRETCH: usize = 64;

/// Mean linear RGB radiance when each row is exposed at its own time: `view_at(row, k)` is the view of its k-th
/// sub-frame, and there are as many of those as sampling positions within a pixel.
pub(super) fn rolling_radiance(
    scene: &Scene,
    size: Size,
    offsets: &[[f32; 2]],
    view_at: impl Fn(usize, usize) -> View + Sync,
) -> Vec<Vec3> {
    let mut image = vec![Vec3::ZERO; size.width * size.height];
    image.par_chunks_mut(size.width).enumerate().for_each(|(row, pixels)| {
        // Only what a block of pixels can see is tested for each of its rays.
        let mut visible = Vec::new();
        for (k, offset) in offsets.iter().enumerate() {
            let sub_frame = SubFrame { view: view_at(row, k), offset: *offset };
            for left in (0..size.width).step_by(STRETCH) {
                let block = Block { left, top: row, width: STRETCH, height: 1 };
                add_block(scene, &sub_frame, &block, size.width, pixels, &mut visible);
            }
        }
        let share = 1.0 / offsets.len() as f32;
        pixels.iter_mut().for_each(|pixel| *pixel *= share);
    });
    image
}

/// Pixels next to each other; the image may end before they do.
struct Block {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
}

/// Adds one sub-frame to the block; `band` is its rows over the whole `width` of the image.
fn add_block(
    scene: &Scene,
    sub_frame: &SubFrame,
    block: &Block,
    width: usize,
    band: &mut [Vec3],
    visible: &mut Vec<u16>,
) {
    let SubFrame { view, offset } = sub_frame;
    let right = width.min(block.left + block.width);
    cull_block(scene, view, block, visible);
    for (row, pixels) in band.chunks_mut(width).enumerate() {
        let v = (block.top + row) as f32 + offset[1];
        for (column, pixel) in (block.left..right).zip(&mut pixels[block.left..right]) {
            let ray = view.ray(column as f32 + offset[0], v);
            let hit = scene.hit(&ray, visible);
            *pixel += scene.radiance(&ray, &hit, view.pixel_angle);
        }
    }
}

/// Looks up what rays within a pixel of the block may meet.
fn cull_block(scene: &Scene, view: &View, block: &Block, visible: &mut Vec<u16>) {
    let range = |first: usize, count: usize| [first as f32 - 1.0, (first + count) as f32];
    let (columns, rows) = (range(block.left, block.width), range(block.top, block.height));
    scene.cull(&view.cone(columns, rows), visible);
}

/// What a depth camera sees at a pixel.
#[derive(Clone, Copy, Default)]
pub(super) struct DepthSample {
    /// Along the optical axis, metres.
    pub(super) depth: f32,
    /// Cosine of the angle between line of sight and surface normal.
    pub(super) incidence: f32,
}

/// Depth and incidence through the pixel centres when each row is measured at its own time, from `view_at(row)`.
pub(super) fn rolling_depth(
    scene: &Scene,
    size: Size,
    view_at: impl Fn(usize) -> View + Sync,
) -> Vec<DepthSample> {
    let mut samples = vec![DepthSample::default(); size.width * size.height];
    samples.par_chunks_mut(size.width).enumerate().for_each(|(row, samples)| {
        let view = view_at(row);
        let mut visible = Vec::new();
        for left in (0..size.width).step_by(STRETCH) {
            let right = size.width.min(left + STRETCH);
            cull_block(scene, &view, &Block { left, top: row, width: STRETCH, height: 1 }, &mut visible);
            for (column, sample) in (left..right).zip(&mut samples[left..right]) {
                let ray = view.ray(column as f32, row as f32);
                *sample = depth_sample(scene, &ray, &scene.hit(&ray, &visible));
            }
        }
    });
    samples
}

/// Depth and incidence through the pixel centres, row by row.
pub(super) fn depth(scene: &Scene, size: Size, view: &View) -> Vec<DepthSample> {
    let mut samples = vec![DepthSample::default(); size.width * size.height];
    samples.par_chunks_mut(size.width * TILE).enumerate().for_each(|(band, samples)| {
        let mut visible = Vec::new();
        for left in (0..size.width).step_by(TILE) {
            let block = Block { left, top: band * TILE, width: TILE, height: TILE };
            // What no ray of the block can meet is left out for all of its pixels.
            cull_block(scene, view, &block, &mut visible);
            let right = size.width.min(left + TILE);
            for (row, samples) in samples.chunks_mut(size.width).enumerate() {
                for (column, sample) in (left..right).zip(&mut samples[left..right]) {
                    let ray = view.ray(column as f32, (band * TILE + row) as f32);
                    *sample = depth_sample(scene, &ray, &scene.hit(&ray, &visible));
                }
            }
        }
    });
    samples
}

fn depth_sample(scene: &Scene, ray: &Ray, hit: &Hit) -> DepthSample {
    let cosine = ray.direction.dot(scene.normal(ray, hit)) / ray.direction.length();
    DepthSample { depth: hit.distance, incidence: cosine.abs() }
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::{PinholeCamera, RigidTransform};
    use nalgebra::{UnitQuaternion, Vector3};

    use super::super::{CameraMotion, SceneName};
    use super::*;

    #[test]
    fn rows_that_are_exposed_together_make_the_image_of_a_global_shutter() {
        // Neither side is a whole number of tiles or stretches.
        let size = Size { width: 150, height: 41 };
        let camera = PinholeCamera { width: 150, height: 41, fx: 90.0, fy: 90.0, cx: 74.5, cy: 20.0 };
        let scene = Scene::new(SceneName::Room, CameraMotion::Sweep);
        let start = RigidTransform::new(UnitQuaternion::identity(), scene.sweep.centre);
        let view = |k: usize| {
            let shift = Vector3::new(0.02, -0.01, 0.03) * k as f64;
            View::new(&camera, &RigidTransform { translation: start.translation + shift, ..start })
        };
        let offsets = jitter(5);
        let sub_frames: Vec<_> = offsets
            .iter()
            .enumerate()
            .map(|(k, offset)| SubFrame { view: view(k), offset: *offset })
            .collect();
        let global = radiance(&scene, size, &sub_frames);
        assert_eq!(rolling_radiance(&scene, size, &offsets, |_, k| view(k)), global);
        // A view of its own for each row: row 30 is that of the image with this view.
        let rows = rolling_radiance(&scene, size, &offsets, |row, k| view(k + row % 7));
        let shifted: Vec<_> =
            sub_frames.iter().enumerate().map(|(k, sub)| SubFrame { view: view(k + 2), ..*sub }).collect();
        let row = 30 * 150..31 * 150;
        assert_eq!(rows[row.clone()], radiance(&scene, size, &shifted)[row.clone()]);
        assert_ne!(rows[row.clone()], global[row]);
    }
}
