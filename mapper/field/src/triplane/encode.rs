//! Features at points, sums of bilinear look-ups in planes, and how they change with the points.

use fearless_simd::{f32x8, prelude::*};

use super::cells::{Cell, Cells, LANES, PlanesView, Points, TILE, tile, weights};
use super::planes::PLANE_AXES;
use super::settings::{CHANNELS, FEATURES};

/// Vectors per node.
const VECTORS: usize = CHANNELS / LANES;

/// Features of a node, or a number for each.
type Node<S> = [f32x8<S>; VECTORS];

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
    let mut cells = [Cells::NONE; 2];
    for start in (0..points[0].len()).step_by(TILE) {
        let points = tile(points, start);
        find(simd, levels, points, &mut cells);
        for (point, out) in out[start..start + points[0].len()].iter_mut().take(TILE).enumerate() {
            for (level, planes) in levels.iter().enumerate() {
                let sum = features_at(simd, planes, &cells[level], point);
                let out = &mut out[level * CHANNELS..(level + 1) * CHANNELS];
                for (vector, out) in sum.into_iter().zip(out.as_chunks_mut::<LANES>().0) {
                    vector.store_array(out);
                }
            }
        }
    }
}

#[inline(always)]
fn find<S: Simd>(simd: S, levels: &[PlanesView<'_>; 2], points: Points<'_>, cells: &mut [Cells; 2]) {
    for (cells, planes) in cells.iter_mut().zip(levels) {
        cells.find(simd, planes, points, 0..PLANE_AXES.len());
    }
    for (plane, values) in levels[1].values.iter().enumerate() {
        cells[1].prefetch(values, plane, levels[1].columns(plane), points[0].len());
    }
}

#[inline(always)]
fn features_at<S: Simd>(simd: S, planes: &PlanesView<'_>, cells: &Cells, point: usize) -> Node<S> {
    let mut sum = [f32x8::splat(simd, 0.0); VECTORS];
    for plane in 0..PLANE_AXES.len() {
        let Cell { start, place } = cells.at(point, plane);
        let values = planes.values[plane];
        let rows = [row(simd, values, start), row(simd, values, start + planes.columns(plane) * CHANNELS)];
        for (node, weight) in rows.as_flattened().iter().zip(weights(place)) {
            for (sum, vector) in sum.iter_mut().zip(node) {
                *sum = vector.mul_add(weight, *sum);
            }
        }
    }
    sum
}

/// Stores the gradients by the coordinates of `points`, given those by their features. Outside of the box features do
/// not change, and the gradient is zero.
#[inline(always)]
pub(super) fn grad_points<S: Simd>(
    simd: S,
    levels: &[PlanesView<'_>; 2],
    points: Points<'_>,
    grad_features: &[[f32; FEATURES]],
    out: &mut [[f32; 3]],
) {
    let mut cells = [Cells::NONE; 2];
    let planes = &levels[0];
    // Both resolutions end at the same place.
    let end = planes.nodes.map(|nodes| (nodes - 1) as f32 / planes.cells_per_metre);
    for start in (0..points[0].len()).step_by(TILE) {
        let points = tile(points, start);
        find(simd, levels, points, &mut cells);
        let range = start..start + points[0].len();
        let pairs = out[range.clone()].iter_mut().zip(&grad_features[range]);
        for (point, (out, grad_features)) in pairs.take(TILE).enumerate() {
            let mut sums = [f32x8::splat(simd, 0.0); 3];
            for (level, planes) in levels.iter().enumerate() {
                let gradient = &grad_features[level * CHANNELS..(level + 1) * CHANNELS];
                add_by_place(simd, planes, &cells[level], point, gradient, &mut sums);
            }
            for axis in 0..3 {
                let x = points[axis][point];
                // At and beyond the border coordinates are clamped, which has no slope.
                let inside = x > 0.0 && x < end[axis];
                out[axis] = if inside { sums[axis].reduce_sum() } else { 0.0 };
            }
        }
    }
}

/// Adds the gradient by the point that comes from one resolution, lanes to be summed.
#[inline(always)]
fn add_by_place<S: Simd>(
    simd: S,
    planes: &PlanesView<'_>,
    cells: &Cells,
    point: usize,
    grad_features: &[f32],
    sums: &mut [f32x8<S>; 3],
) {
    for (plane, axes) in PLANE_AXES.into_iter().enumerate() {
        let Cell { start, place: [u, v] } = cells.at(point, plane);
        let values = planes.values[plane];
        let [near, far] =
            [row(simd, values, start), row(simd, values, start + planes.columns(plane) * CHANNELS)];
        for (k, gradient) in grad_features.as_chunks::<LANES>().0.iter().enumerate() {
            let gradient = f32x8::load_array_ref(simd, gradient) * planes.cells_per_metre;
            // The slope of a bilinear patch along one axis, linear along the other.
            let [along_near, along_far] = [near[1][k] - near[0][k], far[1][k] - far[0][k]];
            let along = (along_far - along_near).mul_add(v, along_near);
            let [across_near, across_far] = [far[0][k] - near[0][k], far[1][k] - near[1][k]];
            let across = (across_far - across_near).mul_add(u, across_near);
            sums[axes[0]] = along.mul_add(gradient, sums[axes[0]]);
            sums[axes[1]] = across.mul_add(gradient, sums[axes[1]]);
        }
    }
}
