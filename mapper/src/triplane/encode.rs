//! Features at points: bilinear look-ups in planes, and their gradients.

use fearless_simd::{f32x8, prelude::*};

use super::planes::{FeaturePlanes, PLANE_AXES};
use super::settings::{CHANNELS, FEATURES};

/// Points whose cells are found at a time.
const TILE: usize = 32;

/// Lanes of a vector of channels.
const LANES: usize = 8;

/// Vectors per node.
const VECTORS: usize = CHANNELS / LANES;

/// Features of a node, or a number for each.
type Node<S> = [f32x8<S>; VECTORS];

/// Coordinates of points relative to the origin of a field, metres: all x, all y, all z, equally many.
pub(super) type Points<'a> = [&'a [f32]; 3];

/// Planes of one resolution as kernels read them.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlanesView<'a> {
    nodes: [usize; 3],
    cells_per_metre: f32,
    values: [&'a [f32]; 3],
}

impl<'a> PlanesView<'a> {
    pub(super) fn new(planes: &'a FeaturePlanes) -> Self {
        Self {
            nodes: planes.nodes,
            cells_per_metre: (1.0 / planes.cell()) as f32,
            values: planes.values.each_ref().map(|values| values.0.as_slice()),
        }
    }
}

/// Cells along the axes and places in them.
struct Cells {
    index: [[u32; TILE]; 3],
    fraction: [[f32; TILE]; 3],
}

impl Cells {
    const NONE: Self = Self { index: [[0; TILE]; 3], fraction: [[0.0; TILE]; 3] };

    /// Finds the cells of a tile of points; those outside of the box count as on its border.
    #[inline(always)]
    fn find(&mut self, points: Points<'_>, nodes: &[usize; 3], cells_per_metre: f32) {
        for axis in 0..3 {
            let last = (nodes[axis] - 1) as f32;
            let last_cell = last - 1.0;
            let places = self.index[axis].iter_mut().zip(&mut self.fraction[axis]);
            for ((index, fraction), x) in places.zip(points[axis]) {
                let place = (x * cells_per_metre).max(0.0).min(last);
                let cell = place.min(last_cell) as u32;
                (*index, *fraction) = (cell, place - cell as f32);
            }
        }
    }

    /// The first float of the cell's node with the least coordinates in a plane, and the place in the cell.
    #[inline(always)]
    fn at(&self, point: usize, [u, v]: [usize; 2], columns: usize) -> (usize, [f32; 2]) {
        let node = self.index[v][point] as usize * columns + self.index[u][point] as usize;
        (node * CHANNELS, [self.fraction[u][point], self.fraction[v][point]])
    }
}

/// Tiles of points: where they start, and their coordinates.
#[inline(always)]
fn tile(points: Points<'_>, start: usize) -> Points<'_> {
    let end = (start + TILE).min(points[0].len());
    [&points[0][start..end], &points[1][start..end], &points[2][start..end]]
}

/// Weights of the four nodes of a cell: those of the first row, then those of the second.
#[inline(always)]
fn weights([u, v]: [f32; 2]) -> [f32; 4] {
    let (far, near) = (u * v, (1.0 - u) * (1.0 - v));
    [near, u * (1.0 - v), v * (1.0 - u), far]
}

/// Both nodes of a row of a cell.
#[inline(always)]
fn row<S: Simd>(simd: S, values: &[f32], start: usize) -> [Node<S>; 2] {
    let both = &values[start..start + 2 * CHANNELS];
    let mut nodes = [[f32x8::splat(simd, 0.0); VECTORS]; 2];
    for (node, values) in nodes.iter_mut().zip(both.as_chunks::<CHANNELS>().0) {
        for (vector, values) in node.iter_mut().zip(values.as_chunks::<LANES>().0) {
            *vector = f32x8::load_array_ref(simd, values);
        }
    }
    nodes
}

/// Stores the features at `points`: sums over the planes, the coarse and the fine ones after each other.
#[inline(always)]
pub(super) fn encode<S: Simd>(
    simd: S,
    levels: &[PlanesView<'_>; 2],
    points: Points<'_>,
    out: &mut [[f32; FEATURES]],
) {
    let mut cells = Cells::NONE;
    for start in (0..points[0].len()).step_by(TILE) {
        let points = tile(points, start);
        for (level, planes) in levels.iter().enumerate() {
            cells.find(points, &planes.nodes, planes.cells_per_metre);
            for (point, out) in out[start..start + points[0].len()].iter_mut().enumerate() {
                let sum = features_at(simd, planes, &cells, point);
                let out = &mut out[level * CHANNELS..(level + 1) * CHANNELS];
                for (vector, out) in sum.into_iter().zip(out.as_chunks_mut::<LANES>().0) {
                    vector.store_array(out);
                }
            }
        }
    }
}

#[inline(always)]
fn features_at<S: Simd>(simd: S, planes: &PlanesView<'_>, cells: &Cells, point: usize) -> Node<S> {
    let mut sum = [f32x8::splat(simd, 0.0); VECTORS];
    for (plane, axes) in PLANE_AXES.into_iter().enumerate() {
        let columns = planes.nodes[axes[0]];
        let (start, place) = cells.at(point, axes, columns);
        let weights = weights(place);
        let values = planes.values[plane];
        let rows = [row(simd, values, start), row(simd, values, start + columns * CHANNELS)];
        for (node, weight) in rows.as_flattened().iter().zip(weights) {
            for (sum, vector) in sum.iter_mut().zip(node) {
                *sum = vector.mul_add(weight, *sum);
            }
        }
    }
    sum
}

/// Adds the gradients by the coordinates of `points` to `out`, given those by their features. Outside of the box
/// features do not change, and the gradient is zero.
#[inline(always)]
pub(super) fn by_points<S: Simd>(
    simd: S,
    levels: &[PlanesView<'_>; 2],
    points: Points<'_>,
    by_features: &[[f32; FEATURES]],
    out: &mut [[f32; 3]],
) {
    let mut cells = Cells::NONE;
    for start in (0..points[0].len()).step_by(TILE) {
        let points = tile(points, start);
        for (level, planes) in levels.iter().enumerate() {
            cells.find(points, &planes.nodes, planes.cells_per_metre);
            let end = planes.nodes.map(|nodes| (nodes - 1) as f32 / planes.cells_per_metre);
            let range = start..start + points[0].len();
            for (point, out) in out[range.clone()].iter_mut().enumerate() {
                let gradient = &by_features[range.start + point][level * CHANNELS..(level + 1) * CHANNELS];
                let by_place = by_place(simd, planes, &cells, point, gradient);
                for axis in 0..3 {
                    let x = points[axis][point];
                    let inside = x > 0.0 && x < end[axis];
                    let sum = by_place[axis].reduce_sum() * planes.cells_per_metre;
                    out[axis] += if inside { sum } else { 0.0 };
                }
            }
        }
    }
}

/// Gradient by the place in the cells, lanes to be summed.
#[inline(always)]
fn by_place<S: Simd>(
    simd: S,
    planes: &PlanesView<'_>,
    cells: &Cells,
    point: usize,
    by_features: &[f32],
) -> [f32x8<S>; 3] {
    let mut sums = [f32x8::splat(simd, 0.0); 3];
    for (plane, axes) in PLANE_AXES.into_iter().enumerate() {
        let columns = planes.nodes[axes[0]];
        let (start, [u, v]) = cells.at(point, axes, columns);
        let values = planes.values[plane];
        let [near, far] = [row(simd, values, start), row(simd, values, start + columns * CHANNELS)];
        for (k, gradient) in by_features.as_chunks::<LANES>().0.iter().enumerate() {
            let gradient = f32x8::load_array_ref(simd, gradient);
            let [along_near, along_far] = [near[1][k] - near[0][k], far[1][k] - far[0][k]];
            let along = (along_far - along_near).mul_add(v, along_near);
            let [across_near, across_far] = [far[0][k] - near[0][k], far[1][k] - near[1][k]];
            let across = (across_far - across_near).mul_add(u, across_near);
            sums[axes[0]] = along.mul_add(gradient, sums[axes[0]]);
            sums[axes[1]] = across.mul_add(gradient, sums[axes[1]]);
        }
    }
    sums
}

/// Where the gradient by one plane goes.
#[derive(Debug)]
pub(super) struct PlaneSums<'a> {
    /// A number per value of the plane.
    pub(super) sums: &'a mut [f32],
    /// A bit per node: whether a gradient was added.
    pub(super) touched: &'a mut [u64],
}

/// Adds the gradient by the values of plane `plane` of a resolution, `level` 0 for coarse and 1 for fine.
#[inline(always)]
pub(super) fn by_plane<S: Simd>(
    simd: S,
    planes: &PlanesView<'_>,
    [plane, level]: [usize; 2],
    points: Points<'_>,
    by_features: &[[f32; FEATURES]],
    out: &mut PlaneSums<'_>,
) {
    let mut cells = Cells::NONE;
    let (axes, columns) = (PLANE_AXES[plane], planes.nodes[PLANE_AXES[plane][0]]);
    for start in (0..points[0].len()).step_by(TILE) {
        let points = tile(points, start);
        cells.find(points, &planes.nodes, planes.cells_per_metre);
        for (point, gradient) in by_features[start..start + points[0].len()].iter().enumerate() {
            let gradient = &gradient[level * CHANNELS..(level + 1) * CHANNELS];
            let (first, place) = cells.at(point, axes, columns);
            let weights = weights(place);
            for (second_row, weights) in weights.as_chunks::<2>().0.iter().enumerate() {
                let start = first + second_row * columns * CHANNELS;
                add_to_row(simd, &mut out.sums[start..start + 2 * CHANNELS], gradient, weights);
                for node in [start / CHANNELS, start / CHANNELS + 1] {
                    out.touched[node / 64] |= 1 << (node % 64);
                }
            }
        }
    }
}

#[inline(always)]
fn add_to_row<S: Simd>(simd: S, nodes: &mut [f32], gradient: &[f32], weights: &[f32; 2]) {
    for (node, weight) in nodes.as_chunks_mut::<CHANNELS>().0.iter_mut().zip(weights) {
        let vectors = node.as_chunks_mut::<LANES>().0.iter_mut();
        for (sums, gradient) in vectors.zip(gradient.as_chunks::<LANES>().0) {
            let gradient = f32x8::load_array_ref(simd, gradient);
            gradient.mul_add(*weight, f32x8::load_array_ref(simd, sums)).store_array(sums);
        }
    }
}
