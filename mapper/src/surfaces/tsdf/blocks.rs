//! A grid of voxels that exists only around surfaces.

use mba_tracker::geometry::PinholeCamera;
use nalgebra::Vector3;
use rayon::prelude::*;

use super::FusionSettings;
use crate::surfaces::SurfaceError;
use crate::surfaces::view::{DepthView, SurfaceView};

/// Voxels along the edge of a block.
pub(super) const EDGE: usize = 8;

/// Voxels of a block.
pub(super) const VOXELS: usize = EDGE * EDGE * EDGE;

/// Where a block is: the coordinates of its first voxel over [`EDGE`], z first so that sorting goes by layers.
pub(super) type Place = [i32; 3];

/// Voxels side by side, x fastest.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// Weighted mean of the truncated signed distances, metres, positive in front of the surface.
    pub(super) distance: [f32; VOXELS],
    /// Sum of the weights; 0 where nothing is known.
    pub(super) weight: [f32; VOXELS],
}

/// Blocks in the order of their places.
#[derive(Debug, Default)]
pub(super) struct Blocks {
    pub(super) places: Vec<Place>,
    pub(super) blocks: Vec<Block>,
}

impl Blocks {
    /// Empty blocks at `places`, which are sorted.
    pub(super) fn new(places: Vec<Place>) -> Self {
        let empty = Block { distance: [0.0; VOXELS], weight: [0.0; VOXELS] };
        Self { blocks: vec![empty; places.len()], places }
    }

    pub(super) fn get(&self, place: &Place) -> Option<&Block> {
        self.places.binary_search(place).ok().map(|index| &self.blocks[index])
    }
}

/// Adds the places of the blocks around the surface that a view shows to the sorted list `places`.
pub(super) fn add_places(
    view: &DepthView,
    settings: &FusionSettings,
    places: &mut Vec<Place>,
) -> Result<(), SurfaceError> {
    let surface = SurfaceView::new(view);
    let rows = surface.pixels.par_chunks(view.camera.width.max(1)).enumerate();
    let new: Vec<Place> = rows
        .flat_map_iter(|(v, row)| {
            let mut places = Vec::new();
            for (u, pixel) in row.iter().enumerate().filter(|(_, pixel)| pixel.cosine > 0.0) {
                along_ray(view, settings, [u, v], pixel.depth, &mut places);
            }
            places.sort_unstable();
            places.dedup();
            places
        })
        .collect();
    places.extend(new);
    places.sort();
    places.dedup();
    if places.len() * size_of::<Block>() > settings.limit_mb << 20 {
        return Err(SurfaceError::TooFine { voxel: settings.voxel, limit_mb: settings.limit_mb });
    }
    Ok(())
}

/// The blocks on the ray of a pixel within the truncation distance of its depth.
fn along_ray(
    view: &DepthView,
    settings: &FusionSettings,
    [u, v]: [usize; 2],
    depth: f32,
    places: &mut Vec<Place>,
) {
    let PinholeCamera { fx, fy, cx, cy, .. } = view.camera;
    let ray = Vector3::new((u as f64 - cx) / fx, (v as f64 - cy) / fy, 1.0);
    let block = settings.voxel * EDGE as f64;
    let steps = (4.0 * settings.truncation() / block).ceil();
    for step in 0..=steps as usize {
        let depth = f64::from(depth) + settings.truncation() * (2.0 * step as f64 / steps - 1.0);
        let at = view.world_from_camera.transform_point(&(ray * depth)) / block;
        let place = [at.z, at.y, at.x].map(|coordinate| coordinate.floor() as i32);
        if places.last() != Some(&place) {
            places.push(place);
        }
    }
}
