//! The cells of planes in which points lie.

use fearless_simd::{f32x8, i32x8, prelude::*};

use super::planes::{FeaturePlanes, PLANE_AXES};
use super::prefetch::prefetch;
use super::settings::CHANNELS;

/// Points whose cells are found at a time.
pub(super) const TILE: usize = 32;

/// Lanes of a vector, of points here and of channels where features are read.
pub(super) const LANES: usize = 8;

/// Coordinates of points relative to the origin of a field, metres: all x, all y, all z, equally many.
pub(super) type Points<'a> = [&'a [f32]; 3];

/// Planes of one resolution as kernels read them.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlanesView<'a> {
    pub(super) nodes: [usize; 3],
    pub(super) cells_per_metre: f32,
    pub(super) values: [&'a [f32]; 3],
}

impl<'a> PlanesView<'a> {
    pub(super) fn new(planes: &'a FeaturePlanes) -> Self {
        Self {
            nodes: planes.nodes,
            cells_per_metre: (1.0 / planes.cell()) as f32,
            values: planes.values.each_ref().map(|values| values.0.as_slice()),
        }
    }

    /// Nodes along the first axis of a plane of [`PLANE_AXES`].
    pub(super) fn columns(&self, plane: usize) -> usize {
        self.nodes[PLANE_AXES[plane][0]]
    }
}

/// Where a tile of points lies in the planes of one resolution.
pub(super) struct Cells {
    /// Per plane, the cell's node with the least coordinates.
    node: [[i32; TILE]; 3],
    /// Per axis, the place in the cell.
    fraction: [[f32; TILE]; 3],
}

/// The cell of a point in one plane.
#[derive(Clone, Copy)]
pub(super) struct Cell {
    /// First float of the node with the least coordinates.
    pub(super) start: usize,
    /// Place in the cell, 0 to 1 along both axes.
    pub(super) place: [f32; 2],
}

impl Cells {
    pub(super) const NONE: Self = Self { node: [[0; TILE]; 3], fraction: [[0.0; TILE]; 3] };

    /// Finds the cells of at most [`TILE`] points in the given planes. Points outside of the box count as on its
    /// border, and so do coordinates that are not numbers.
    #[inline(always)]
    pub(super) fn find<S: Simd>(
        &mut self,
        simd: S,
        planes: &PlanesView<'_>,
        points: Points<'_>,
        wanted: impl IntoIterator<Item = usize> + Clone,
    ) {
        for first in (0..points[0].len().min(TILE)).step_by(LANES) {
            for plane in wanted.clone() {
                let [u, v] = PLANE_AXES[plane];
                let (column, across) = in_cells(simd, planes, u, &points[u][first..]);
                let (row, along) = in_cells(simd, planes, v, &points[v][first..]);
                across.store_slice(&mut self.fraction[u][first..first + LANES]);
                along.store_slice(&mut self.fraction[v][first..first + LANES]);
                let node = row * planes.columns(plane) as i32 + column;
                node.store_slice(&mut self.node[plane][first..first + LANES]);
            }
        }
    }

    /// Asks for the values of a plane in the cells of the first `count` points.
    #[inline(always)]
    pub(super) fn prefetch(&self, values: &[f32], plane: usize, columns: usize, count: usize) {
        for node in self.node[plane].iter().take(count) {
            let start = *node as usize * CHANNELS;
            prefetch(values, start);
            prefetch(values, start + columns * CHANNELS);
        }
    }

    /// The cell of a point of the tile in a plane.
    #[inline(always)]
    pub(super) fn at(&self, point: usize, plane: usize) -> Cell {
        let [u, v] = PLANE_AXES[plane];
        Cell {
            start: self.node[plane][point] as usize * CHANNELS,
            place: [self.fraction[u][point], self.fraction[v][point]],
        }
    }
}

/// Cells along an axis, and places in them, of the first eight of some coordinates.
#[inline(always)]
fn in_cells<S: Simd>(simd: S, planes: &PlanesView<'_>, axis: usize, x: &[f32]) -> (i32x8<S>, f32x8<S>) {
    let last = (planes.nodes[axis] - 1) as f32;
    let place = (lanes(simd, x) * planes.cells_per_metre).max_precise(0.0).min_precise(last);
    let cell = i32x8::truncate_from(place.min(last - 1.0));
    (cell, place - f32x8::float_from(cell))
}

/// The first eight of some numbers; zeros for those that are missing.
#[inline(always)]
fn lanes<S: Simd>(simd: S, values: &[f32]) -> f32x8<S> {
    if let Some(full) = values.first_chunk::<LANES>() {
        return f32x8::load_array_ref(simd, full);
    }
    let mut lanes = [0.0; LANES];
    lanes.iter_mut().zip(values).for_each(|(lane, value)| *lane = *value);
    f32x8::load_array(simd, lanes)
}

/// Tiles of points: where they start, and their coordinates.
#[inline(always)]
pub(super) fn tile(points: Points<'_>, start: usize) -> Points<'_> {
    let end = (start + TILE).min(points[0].len());
    [&points[0][start..end], &points[1][start..end], &points[2][start..end]]
}

/// Weights of the four nodes of a cell: those of the first row, then those of the second.
#[inline(always)]
pub(super) fn weights([u, v]: [f32; 2]) -> [f32; 4] {
    let (far, near) = (u * v, (1.0 - u) * (1.0 - v));
    [near, u * (1.0 - v), v * (1.0 - u), far]
}
