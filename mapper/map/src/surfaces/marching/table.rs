//! How a surface passes through a cell of eight samples, for all combinations of their signs.
//!
//! The table is derived rather than written down. On each face of the cell, every run of neighbouring corners that are
//! inside is cut off by one segment from where the outline of the face enters the run to where it leaves it. What a
//! face gets depends on its four corners alone, so two cells that share a face agree on its segments. Each edge with a
//! change of sign is entered on one of its two faces and left on the other: the segments close to loops, and every
//! loop becomes a patch of triangles.
//!
//! A patch has no diagonal within a face of the cell. An edge between triangles is thus either a segment, shared by
//! the two cells at the face, or a diagonal, shared by two triangles of one patch: a surface is manifold wherever its
//! samples are known (the faces of cells at the border of the known region end in an open edge).

use std::sync::LazyLock;

/// Offsets of the corners of a cell; bit 0 of a corner's number is x, bit 1 is y, bit 2 is z.
pub(super) const CORNERS: [[usize; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]];

/// An edge of a cell: the axis it runs along, and its corner of lower number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Edge {
    pub(super) axis: usize,
    pub(super) corner: usize,
}

/// Triangles of the surface for each set of corners that are inside (negative), as bits by the number of the corner;
/// normals point outside.
pub(super) static TRIANGLES: LazyLock<[Vec<[Edge; 3]>; 256]> =
    LazyLock::new(|| std::array::from_fn(triangles_of));

fn triangles_of(inside: usize) -> Vec<[Edge; 3]> {
    let mut segments: Vec<[Edge; 2]> = faces().iter().flat_map(|face| segments_of(inside, face)).collect();
    let mut triangles = Vec::new();
    while let Some([start, mut end]) = segments.pop() {
        let mut patch = vec![start];
        while end != start {
            patch.push(end);
            let next = segments.iter().position(|segment| segment[0] == end);
            end = next.map_or(start, |next| segments.swap_remove(next)[1]);
        }
        triangles.extend(triangulate(&patch).unwrap_or_default());
    }
    triangles
}

/// The corners of the six faces, counter-clockwise as seen from outside the cell.
fn faces() -> [[usize; 4]; 6] {
    std::array::from_fn(|face| {
        let (axis, upper) = (face / 2, face % 2);
        let [a, b, c] = [axis, (axis + 1) % 3, (axis + 2) % 3].map(|axis| 1 << axis);
        let around = if upper == 1 { [0, b, b + c, c] } else { [0, c, b + c, b] };
        around.map(|corner| corner + upper * a)
    })
}

/// The segments on a face, each from where its outline enters a run of inside corners to where it leaves it.
fn segments_of(inside: usize, face: &[usize; 4]) -> Vec<[Edge; 2]> {
    let is_inside = |k: usize| inside >> face[k % 4] & 1 == 1;
    let edge = |k: usize| edge_between(face[k % 4], face[(k + 1) % 4]);
    let entries = (0..4).filter(|&k| !is_inside(k) && is_inside(k + 1));
    entries
        .filter_map(|entry| {
            let leave = (entry + 1..entry + 4).find(|&k| is_inside(k) && !is_inside(k + 1))?;
            Some([edge(entry), edge(leave)])
        })
        .collect()
}

fn edge_between(a: usize, b: usize) -> Edge {
    Edge { axis: (a ^ b).trailing_zeros() as usize, corner: a & b }
}

/// Triangles of a patch without diagonals within a face. Every patch that occurs has some, which a test asserts.
fn triangulate(patch: &[Edge]) -> Option<Vec<[Edge; 3]>> {
    let [first, _, .., last] = patch else { return Some(Vec::new()) };
    let side = |from: usize, to: usize| to - from == 1 || !share_face(patch[from], patch[to]);
    (1..patch.len() - 1).filter(|&apex| side(0, apex) && side(apex, patch.len() - 1)).find_map(|apex| {
        let mut triangles = triangulate(&patch[..=apex])?;
        triangles.push([*first, patch[apex], *last]);
        triangles.extend(triangulate(&patch[apex..])?);
        Some(triangles)
    })
}

/// Whether two edges are on one face of the cell.
fn share_face(a: Edge, b: Edge) -> bool {
    (0..3).any(|axis| axis != a.axis && axis != b.axis && (a.corner ^ b.corner) >> axis & 1 == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sides of the triangles that have no opposite side, sorted.
    fn open_sides(triangles: &[[Edge; 3]]) -> Vec<[Edge; 2]> {
        let sides: Vec<[Edge; 2]> =
            triangles.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]).collect();
        let open = |[a, b]: &[Edge; 2]| !sides.contains(&[*b, *a]);
        let mut open: Vec<[Edge; 2]> = sides.iter().copied().filter(open).collect();
        open.sort_by_key(|side| side.map(|edge| (edge.axis, edge.corner)));
        open
    }

    #[test]
    fn the_outlines_of_all_patches_are_the_segments_on_the_faces() {
        for inside in 0..256 {
            let mut segments: Vec<[Edge; 2]> =
                faces().iter().flat_map(|face| segments_of(inside, face)).collect();
            segments.sort_by_key(|side| side.map(|edge| (edge.axis, edge.corner)));
            let triangles = &TRIANGLES[inside];
            assert_eq!(open_sides(triangles), segments, "{inside:08b}");
            for [a, b] in triangles.iter().flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]]) {
                let segment = segments.contains(&[*a, *b]) || segments.contains(&[*b, *a]);
                assert!(segment || !share_face(*a, *b), "{inside:08b} has a diagonal on a face");
            }
        }
    }

    #[test]
    fn patches_pass_through_all_edges_with_a_change_of_sign() {
        for inside in 0..256_usize {
            let edges = (0..8).flat_map(|corner| (0..3).map(move |axis| Edge { axis, corner }));
            for edge in edges.filter(|edge| edge.corner >> edge.axis & 1 == 0) {
                let changes = (inside >> edge.corner ^ inside >> (edge.corner | 1 << edge.axis)) & 1 == 1;
                let used = TRIANGLES[inside].iter().flatten().any(|used| *used == edge);
                assert_eq!(used, changes, "{inside:08b} {edge:?}");
            }
        }
    }

    #[test]
    fn normals_point_outside() {
        // Only corner 0 is inside: the triangle through the edges at it faces (1, 1, 1).
        let [[a, b, c]] = *TRIANGLES[1] else { panic!("one triangle is enough") };
        let order = [a, b, c].map(|edge| edge.axis);
        assert!([[0, 1, 2], [1, 2, 0], [2, 0, 1]].contains(&order), "{order:?}");
    }
}
