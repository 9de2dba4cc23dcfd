//! The surface within a box of samples.

use super::table::{CORNERS, Edge, TRIANGLES};

/// A vertex is at least this share of an edge away from its ends, so that triangles keep an area.
const MARGIN: f32 = 1e-3;

/// Signed distances at the points of a box within a regular grid.
#[derive(Clone, Debug)]
pub(in crate::surfaces) struct SampleBox {
    /// The first point of the box on the grid.
    pub(in crate::surfaces) origin: [i32; 3],
    /// Points along x, y and z.
    pub(in crate::surfaces) points: [usize; 3],
    /// Negative inside, NaN where unknown; x runs fastest, z slowest.
    pub(in crate::surfaces) values: Vec<f32>,
}

/// Where the surface crosses an edge of the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crossing {
    /// The lower end of the edge.
    pub(super) point: [i32; 3],
    /// Where the edge leads to.
    pub(super) axis: u8,
    /// Share of the edge before the surface, above 0 and below 1.
    pub(super) share: f32,
    /// Whether another box has this edge too.
    pub(super) shared: bool,
}

/// Triangles between crossings.
#[derive(Clone, Debug, Default)]
pub(in crate::surfaces) struct Piece {
    pub(super) crossings: Vec<Crossing>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl SampleBox {
    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.points[1] + y) * self.points[0] + x
    }

    /// The surface in those cells of the box of which all eight corners are known.
    pub(in crate::surfaces) fn surface(&self) -> Piece {
        const NONE: u32 = u32::MAX;
        let mut piece = Piece::default();
        let mut known = vec![[NONE; 3]; self.values.len()];
        let cells = self.points.map(|points| points.saturating_sub(1));
        for z in 0..cells[2] {
            for y in 0..cells[1] {
                for x in 0..cells[0] {
                    let Some(inside) = self.inside([x, y, z]) else { continue };
                    for triangle in &TRIANGLES[inside] {
                        let vertices = triangle.map(|Edge { axis, corner }| {
                            let [dx, dy, dz] = CORNERS[corner];
                            let at = [x + dx, y + dy, z + dz];
                            // A crossing belongs to the lower end of its edge: cells that share the edge share the vertex.
                            let slot = &mut known[self.index(at)][axis];
                            if *slot == NONE {
                                *slot = piece.crossings.len() as u32;
                                piece.crossings.push(self.crossing(at, axis));
                            }
                            *slot
                        });
                        piece.triangles.push(vertices);
                    }
                }
            }
        }
        piece
    }

    /// Which corners of a cell are inside, as bits; `None` if one is unknown.
    fn inside(&self, [x, y, z]: [usize; 3]) -> Option<usize> {
        let mut inside = 0;
        for (corner, [dx, dy, dz]) in CORNERS.iter().enumerate() {
            let value = self.values[self.index([x + dx, y + dy, z + dz])];
            if value.is_nan() {
                return None;
            }
            inside |= usize::from(value < 0.0) << corner;
        }
        Some(inside)
    }

    fn crossing(&self, at: [usize; 3], axis: usize) -> Crossing {
        let mut end = at;
        end[axis] += 1;
        let [from, to] = [at, end].map(|point| self.values[self.index(point)]);
        let on_border = |k: usize| k != axis && (at[k] == 0 || at[k] + 1 == self.points[k]);
        Crossing {
            point: std::array::from_fn(|k| self.origin[k] + at[k] as i32),
            axis: axis as u8,
            share: (from / (from - to)).clamp(MARGIN, 1.0 - MARGIN),
            shared: (0..3).any(on_border),
        }
    }
}
