//! Fusion of depth maps into a truncated signed distance (Curless and Levoy 1996) and its surface.
//!
//! The grid consists of blocks near surfaces, found in a first pass over all views. A second pass averages distances; a
//! point's distance is that from the plane of the surface at its pixel, so that slanted surfaces are not thickened.
//! Nothing depends on the number of threads.

mod blocks;
mod fuse;
mod settings;
#[cfg(test)]
mod tests;

pub use settings::FusionSettings;

use blocks::{Blocks, EDGE, Place, add_places};
use mba_mesh::Mesh;
use rayon::prelude::*;

use super::marching::{Assembly, Lattice, Piece, SampleBox};
use super::{SurfaceError, ViewSource};

/// The surface that all views agree on, without colours: every view is asked for twice.
///
/// # Errors
/// [`SurfaceError::TooFine`] when the grid would take more than the allowed memory; settings out of range.
pub fn fuse_views(source: &mut dyn ViewSource, settings: &FusionSettings) -> Result<Mesh, SurfaceError> {
    settings.check()?;
    let mut places = Vec::new();
    for index in 0..source.count() {
        add_places(&source.view(index), settings, &mut places)?;
    }
    let mut blocks = Blocks::new(places);
    for index in 0..source.count() {
        fuse::fuse(&source.view(index), settings, &mut blocks);
    }
    let pieces: Vec<Piece> =
        blocks.places.par_iter().map(|place| samples(&blocks, place).surface()).collect();
    let mut assembly = Assembly::new(Lattice { origin: [0.0; 3], voxel: settings.voxel });
    pieces.iter().for_each(|piece| assembly.add(piece));
    Ok(assembly.finish())
}

/// The voxels of a block, and those next to it on its upper sides.
fn samples(blocks: &Blocks, place: &Place) -> SampleBox {
    const POINTS: usize = EDGE + 1;
    let mut values = vec![f32::NAN; POINTS * POINTS * POINTS];
    for neighbour in 0..8 {
        // Bits say whether the neighbour is one further along each axis: of it the first voxels are needed, of the block all.
        let upper = [neighbour >> 2 & 1, neighbour >> 1 & 1, neighbour & 1];
        let at: Place = std::array::from_fn(|axis| place[axis].saturating_add(upper[axis]));
        let Some(block) = blocks.get(&at) else { continue };
        let first = upper.map(|upper| EDGE * upper as usize);
        let range = |axis: usize| if upper[axis] == 1 { 0..1 } else { 0..EDGE };
        for z in range(0) {
            for y in range(1) {
                for x in range(2) {
                    let from = (z * EDGE + y) * EDGE + x;
                    let [down, along, across] = std::array::from_fn(|axis| [z, y, x][axis] + first[axis]);
                    if block.weight[from] > 0.0 {
                        values[(down * POINTS + along) * POINTS + across] = block.distance[from];
                    }
                }
            }
        }
    }
    let [z, y, x] = place.map(|coordinate| coordinate.saturating_mul(EDGE as i32));
    SampleBox { origin: [x, y, z], points: [POINTS; 3], values }
}
