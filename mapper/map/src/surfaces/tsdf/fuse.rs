//! Fusion of one view into all blocks that it shows.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::blocks::{Block, Blocks, EDGE, Place};
use super::settings::FusionSettings;
use crate::surfaces::view::{ColouredDepth, SurfaceView};

/// Voxels nearer to the camera than this, metres, are left alone.
const NEAREST: f32 = 0.05;

/// Along a ray the plane of a pixel counts this many truncation distances before its depth, and one behind it: a plane
/// that is seen flat goes on for long, the surface may not, and behind the edge of a surface there may be nothing.
const REACH: f32 = 2.0;

/// A view, and what tells quickly that a block is out of sight.
struct Fusion<'a> {
    view: &'a SurfaceView,
    rotation: Matrix3<f32>,
    translation: Vector3<f32>,
    focal: [f32; 2],
    centre: [f32; 2],
    /// Normals of the sides of the field of view in the camera's frame, unit length, pointing inwards.
    sides: [Vector3<f32>; 4],
    deepest: f32,
    voxel: f32,
    truncation: f32,
}

/// Averages the distances of a view into the blocks: negative behind its surfaces up to the truncation distance,
/// positive in front of them, which also clears what other views have put there by mistake.
pub(super) fn fuse(view: &ColouredDepth, settings: &FusionSettings, blocks: &mut Blocks) {
    let surface = SurfaceView::new(view);
    let fusion = Fusion::new(&surface, settings);
    let Blocks { places, blocks } = blocks;
    blocks.par_iter_mut().zip(places).for_each(|(block, place)| fusion.update(place, block));
}

impl<'a> Fusion<'a> {
    fn new(view: &'a SurfaceView, settings: &FusionSettings) -> Self {
        let camera = &view.camera;
        let to_f32 = |numbers: [f64; 2]| numbers.map(|number| number as f32);
        let side = |x: f64, y: f64, z: f64| Vector3::new(x, y, z).normalize().cast();
        let right = (camera.width as f64 - 0.5 - camera.cx) / camera.fx;
        let bottom = (camera.height as f64 - 0.5 - camera.cy) / camera.fy;
        Self {
            view,
            rotation: view.camera_from_world.rotation_matrix().cast(),
            translation: view.camera_from_world.translation.cast(),
            focal: to_f32([camera.fx, camera.fy]),
            centre: to_f32([camera.cx, camera.cy]),
            sides: [
                side(1.0, 0.0, (camera.cx + 0.5) / camera.fx),
                side(-1.0, 0.0, right),
                side(0.0, 1.0, (camera.cy + 0.5) / camera.fy),
                side(0.0, -1.0, bottom),
            ],
            deepest: view.pixels.iter().map(|pixel| pixel.depth).fold(0.0, f32::max),
            voxel: settings.voxel as f32,
            truncation: settings.truncation() as f32,
        }
    }

    fn update(&self, [z, y, x]: &Place, block: &mut Block) {
        let first = Vector3::new(*x, *y, *z).cast::<f32>() * (self.voxel * EDGE as f32);
        let first = self.rotation * first + self.translation;
        // Steps of one voxel along the axes of the world, seen by the camera.
        let [dx, dy, dz] = [0, 1, 2].map(|axis| self.rotation.column(axis) * self.voxel);
        if self.is_out_of_sight(&(first + (dx + dy + dz) * (0.5 * (EDGE - 1) as f32))) {
            return;
        }
        for z in 0..EDGE {
            for y in 0..EDGE {
                let row = first + dz * z as f32 + dy * y as f32;
                for x in 0..EDGE {
                    let index = (z * EDGE + y) * EDGE + x;
                    if let Some([distance, weight]) = self.distance(&(row + dx * x as f32)) {
                        let sum = block.weight[index] + weight;
                        block.distance[index] += (distance - block.distance[index]) * (weight / sum);
                        block.weight[index] = sum;
                    }
                }
            }
        }
    }

    /// Whether no voxel of the block around a point in the camera's frame can be changed.
    fn is_out_of_sight(&self, middle: &Vector3<f32>) -> bool {
        let radius = 0.5 * 3_f32.sqrt() * EDGE as f32 * self.voxel;
        middle.z + radius < NEAREST
            || middle.z - radius > self.deepest + self.truncation
            || self.sides.iter().any(|side| side.dot(middle) < -radius)
    }

    /// Truncated distance of a point of the camera's frame from the surface, and its weight.
    fn distance(&self, point: &Vector3<f32>) -> Option<[f32; 2]> {
        if point.z < NEAREST {
            return None;
        }
        let [u, v] = [0, 1].map(|k| self.focal[k] * point[k] / point.z + self.centre[k]);
        let surface = self.view.at(u, v)?;
        let ahead = surface.depth - point.z;
        if ahead < -self.truncation {
            return None;
        }
        let clear = ahead > REACH * self.truncation;
        let distance = if clear { self.truncation } else { surface.distance(point) };
        (distance >= -self.truncation).then(|| [distance.min(self.truncation), surface.weight(point.z)])
    }
}
