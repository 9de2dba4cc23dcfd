//! A grid of voxels that exists only around surfaces.

use rayon::prelude::*;

use super::settings::FusionSettings;
use crate::surfaces::SurfaceError;
use crate::surfaces::view::{ColouredDepth, SurfaceView};

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
    view: &ColouredDepth,
    settings: &FusionSettings,
    places: &mut Vec<Place>,
) -> Result<(), SurfaceError> {
    let surface = SurfaceView::new(view);
    let rays = Rays::new(view, settings);
    // Both before and after: the list of a view must not grow beyond all bounds either.
    let surface_blocks: f64 =
        surface.pixels.iter().map(|pixel| rays.blocks_across(pixel.depth).powi(2)).sum();
    settings.check_memory(surface_blocks)?;
    let rows = surface.pixels.par_chunks(view.camera.width.max(1)).enumerate();
    let new: Vec<Place> = rows
        .flat_map_iter(|(v, row)| {
            let mut places = Vec::new();
            for (u, pixel) in row.iter().enumerate().filter(|(_, pixel)| pixel.cosine > 0.0) {
                rays.add_pixel(u, v, pixel.depth, &mut places);
            }
            places.sort_unstable();
            places.dedup();
            places
        })
        .collect();
    places.extend(new);
    places.sort();
    places.dedup();
    settings.check_memory(places.len() as f64)
}

impl FusionSettings {
    fn check_memory(&self, blocks: f64) -> Result<(), SurfaceError> {
        let fits = blocks * size_of::<Block>() as f64 <= self.limit_mb as f64 * 1024.0 * 1024.0;
        let too_fine = SurfaceError::TooFine { voxel: self.voxel, limit_mb: self.limit_mb };
        if fits { Ok(()) } else { Err(too_fine) }
    }
}

/// From pixels to the blocks that they see.
struct Rays<'a> {
    view: &'a ColouredDepth,
    /// Edge of a block, metres.
    block: f64,
    truncation: f64,
}

impl<'a> Rays<'a> {
    fn new(view: &'a ColouredDepth, settings: &FusionSettings) -> Self {
        Self { view, block: settings.voxel * EDGE as f64, truncation: settings.truncation() }
    }

    /// Blocks within the width of a pixel that is `depth` metres away.
    fn blocks_across(&self, depth: f32) -> f64 {
        f64::from(depth) / self.view.camera.fx.min(self.view.camera.fy) / self.block
    }

    /// Adds the blocks that a pixel shows within the truncation distance of its depth.
    fn add_pixel(&self, u: usize, v: usize, depth: f32, places: &mut Vec<Place>) {
        // Rays are half a block apart at the most, so that no block between them is missed.
        let across = (2.0 * self.blocks_across(depth)).ceil().max(1.0) as usize;
        let aside = |k: usize| (k as f64 + 0.5) / across as f64 - 0.5;
        for [x, y] in (0..across).flat_map(|x| (0..across).map(move |y| [x, y])) {
            self.add_ray([u as f64 + aside(x), v as f64 + aside(y)], depth.into(), places);
        }
    }

    fn add_ray(&self, [u, v]: [f64; 2], depth: f64, places: &mut Vec<Place>) {
        let ray = self.view.camera.ray(u, v);
        let steps = (4.0 * self.truncation / self.block).ceil();
        for step in 0..=steps as usize {
            let depth = depth + self.truncation * (2.0 * step as f64 / steps - 1.0);
            let at = self.view.world_from_camera.transform_point(&(ray * depth)) / self.block;
            let place = [at.z, at.y, at.x].map(|coordinate| coordinate.floor() as i32);
            if places.last() != Some(&place) {
                places.push(place);
            }
        }
    }
}
