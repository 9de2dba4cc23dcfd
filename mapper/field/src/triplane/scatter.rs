//! Gradients by the values of planes.
//!
//! One pass over the samples serves both resolutions. Samples of a ray lie next to each other, mostly in one coarse cell:
//! the sums of its four nodes stay in registers until a sample of another cell comes. In the fine planes the next
//! cell comes so often, and so irregularly, that guessing it wrong costs more than going to memory every time.

use fearless_simd::{f32x8, prelude::*};

use super::cells::{Cell, Cells, LANES, PlanesView, Points, TILE, tile, weights};
use super::settings::{CHANNELS, FEATURES};

/// Vectors per node.
const VECTORS: usize = CHANNELS / LANES;

/// No cell yet.
const NOWHERE: usize = usize::MAX;

/// Where the gradient by one plane goes.
#[derive(Debug)]
pub(super) struct PlaneSums<'a> {
    /// A number per value of the plane.
    pub(super) sums: &'a mut [f32],
    /// A bit per cell, that of its node with the least coordinates: whether a gradient was added.
    pub(super) cells: &'a mut [u64],
}

impl PlaneSums<'_> {
    /// Marks the cell whose node with the least coordinates starts at a float.
    #[inline(always)]
    fn touch(&mut self, start: usize) {
        let node = start / CHANNELS;
        self.cells[node / 64] |= 1 << (node % 64);
    }

    /// Adds what one sample gives to the four nodes of its cell.
    #[inline(always)]
    fn add<S: Simd>(&mut self, simd: S, cell: Cell, columns: usize, gradient: &[f32]) {
        for (row, weights) in weights(cell.place).as_chunks::<2>().0.iter().enumerate() {
            let start = cell.start + row * columns * CHANNELS;
            let (nodes, _) = self.sums[start..start + 2 * CHANNELS].as_chunks_mut::<CHANNELS>();
            for (node, weight) in nodes.iter_mut().zip(weights) {
                let vectors = node.as_chunks_mut::<LANES>().0.iter_mut();
                for (sums, gradient) in vectors.zip(gradient.as_chunks::<LANES>().0) {
                    let gradient = f32x8::load_array_ref(simd, gradient);
                    gradient.mul_add(*weight, f32x8::load_array_ref(simd, sums)).store_array(sums);
                }
            }
        }
        self.touch(cell.start);
    }
}

/// Sums of the four nodes of a cell.
struct Corners<S: Simd> {
    /// First float of the node with the least coordinates, or [`NOWHERE`].
    start: usize,
    sums: [[f32x8<S>; VECTORS]; 4],
}

impl<S: Simd> Corners<S> {
    #[inline(always)]
    fn at(simd: S, start: usize) -> Self {
        Self { start, sums: [[f32x8::splat(simd, 0.0); VECTORS]; 4] }
    }

    #[inline(always)]
    fn add(&mut self, simd: S, gradient: &[f32], weights: [f32; 4]) {
        for (k, gradient) in gradient.as_chunks::<LANES>().0.iter().enumerate() {
            let gradient = f32x8::load_array_ref(simd, gradient);
            for (sums, weight) in self.sums.iter_mut().zip(weights) {
                sums[k] = gradient.mul_add(weight, sums[k]);
            }
        }
    }

    /// Adds the sums to those in memory.
    #[inline(always)]
    fn store(&self, simd: S, columns: usize, out: &mut PlaneSums<'_>) {
        if self.start == NOWHERE {
            return;
        }
        for (row, sums) in self.sums.as_chunks::<2>().0.iter().enumerate() {
            let start = self.start + row * columns * CHANNELS;
            let nodes = out.sums[start..start + 2 * CHANNELS].as_chunks_mut::<LANES>().0;
            for (node, sum) in nodes.iter_mut().zip(sums.as_flattened()) {
                (*sum + f32x8::load_array_ref(simd, node)).store_array(node);
            }
        }
        out.touch(self.start);
    }
}

/// Adds the gradient by the values of plane `plane` of both resolutions, the coarse and the fine one.
#[inline(always)]
pub(super) fn sums_of_plane<S: Simd>(
    simd: S,
    levels: &[PlanesView<'_>; 2],
    plane: usize,
    points: Points<'_>,
    grad_features: &[[f32; FEATURES]],
    out: &mut [PlaneSums<'_>; 2],
) {
    let columns = levels.each_ref().map(|planes| planes.columns(plane));
    let mut cells = [Cells::NONE; 2];
    let [coarse, fine] = out;
    let mut corners = Corners::at(simd, NOWHERE);
    for start in (0..points[0].len()).step_by(TILE) {
        let points = tile(points, start);
        for (cells, planes) in cells.iter_mut().zip(levels) {
            cells.find(simd, planes, points, [plane]);
        }
        // The coarse plane fits into a cache, the fine one does not.
        cells[1].prefetch(fine.sums, plane, columns[1], points[0].len());
        let gradients = &grad_features[start..start + points[0].len()];
        for (point, gradient) in gradients.iter().take(TILE).enumerate() {
            let (of_coarse, of_fine) = gradient.split_at(CHANNELS);
            let Cell { start, place } = cells[0].at(point, plane);
            // Samples of a ray mostly stay in one coarse cell: its corners are kept in registers until they leave it.
            if start != corners.start {
                corners.store(simd, columns[0], coarse);
                corners = Corners::at(simd, start);
            }
            corners.add(simd, of_coarse, weights(place));
            fine.add(simd, cells[1].at(point, plane), columns[1], of_fine);
        }
    }
    corners.store(simd, columns[0], coarse);
}

/// From the cells of a plane with `columns` nodes in a row to their nodes: a bit per node.
pub(super) fn nodes_of_cells(bits: &mut [u64], columns: usize) {
    for shift in [columns, 1] {
        // Words of 64 bits, from the last one down, so that each is read before it changes.
        let (words, rest) = (shift / 64, shift % 64);
        for word in (words..bits.len()).rev() {
            let from = bits[word - words];
            let carry = if rest > 0 && word > words { bits[word - words - 1] >> (64 - rest) } else { 0 };
            bits[word] |= from << rest | carry;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_has_four_nodes() {
        for columns in [2, 9, 63, 64, 65, 130] {
            for cell in [0, 5, 62, 63, 64, 127] {
                let mut bits = vec![0; (cell + columns + 2_usize).div_ceil(64)];
                bits[cell / 64] |= 1 << (cell % 64);
                nodes_of_cells(&mut bits, columns);
                let set = (0..64 * bits.len()).filter(|node| bits[node / 64] >> (node % 64) & 1 == 1);
                let mut nodes = vec![cell, cell + 1, cell + columns, cell + columns + 1];
                nodes.dedup();
                assert_eq!(set.collect::<Vec<_>>(), nodes, "{columns} columns");
            }
        }
    }
}
