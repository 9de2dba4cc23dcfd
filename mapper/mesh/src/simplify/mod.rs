//! Meshes of fewer triangles, by quadric error metrics (Garland and Heckbert, "Surface simplification using quadric error
//! metrics", SIGGRAPH 1997).
//!
//! Edges are collapsed one after the other, each time the one whose collapse leaves the planes of the triangles around it
//! least. One thread does it, and ties go to the smaller vertices, so that the result is always the same.

mod quadric;
mod surface;

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::triangles::Mesh;
use surface::Surface;

/// An edge that may be collapsed. The greatest is the one to take first.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    cost: f64,
    edge: [u32; 2],
    /// How often its ends had changed when the cost was found.
    changes: [u32; 2],
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_cost = other.cost.total_cmp(&self.cost);
        by_cost.then(other.edge.cmp(&self.edge)).then(self.changes.cmp(&other.changes))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}

impl Mesh {
    /// The surface with at most `triangles` triangles, or more where no more can go without turning one over or joining
    /// sheets. Borders stay, colours are mixed along edges; a mesh that has no more than so many is returned as it is.
    #[must_use]
    pub fn simplified(&self, triangles: usize) -> Self {
        if self.triangles.len() <= triangles {
            return self.clone();
        }
        let mut surface = Surface::new(self);
        let mut changes = vec![0_u32; self.vertices.len()];
        let candidate = |surface: &Surface, changes: &[u32], [a, b]: [u32; 2]| Candidate {
            cost: surface.collapse(a, b).cost,
            edge: [a, b],
            changes: [a, b].map(|end| changes[end as usize]),
        };
        let all = surface.edges().into_iter().map(|edge| candidate(&surface, &changes, edge));
        let mut candidates: BinaryHeap<Candidate> = all.collect();
        while surface.left() > triangles {
            let Some(next) = candidates.pop() else { break };
            let [a, b] = next.edge;
            // Its cost was that of an edge that has changed; the new one is in the heap, too.
            if next.changes != [a, b].map(|end| changes[end as usize]) {
                continue;
            }
            let place = surface.collapse(a, b).place;
            if !surface.apply(a, b, &place) {
                continue;
            }
            // What was known of both ends does not hold any more.
            changes[a as usize] += 1;
            changes[b as usize] += 1;
            for neighbour in surface.neighbours(a) {
                let edge = [a.min(neighbour), a.max(neighbour)];
                candidates.push(candidate(&surface, &changes, edge));
            }
        }
        surface.mesh()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid of `side` by `side` squares over the unit square, with height `z` and red growing along x.
    fn sheet(side: u32, z: impl Fn(f32, f32) -> f32) -> Mesh {
        let step = |k: u32| k as f32 / side as f32;
        let places = (0..=side).flat_map(|y| (0..=side).map(move |x| (step(x), step(y))));
        let corner = |x: u32, y: u32| y * (side + 1) + x;
        let squares = (0..side).flat_map(|y| (0..side).map(move |x| (x, y)));
        Mesh {
            vertices: places.clone().map(|(x, y)| [x, y, z(x, y)]).collect(),
            colours: places.map(|(x, _)| [(255.0 * x) as u8, 10, 20]).collect(),
            triangles: squares
                .flat_map(|(x, y)| {
                    let [a, b, c, d] =
                        [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
                    [[a, b, c], [a, c, d]]
                })
                .collect(),
        }
    }

    #[test]
    fn a_plane_needs_few_triangles_and_keeps_its_border() {
        let mesh = sheet(30, |_, _| 0.5).simplified(40);
        assert!(mesh.triangles.len() <= 40 && mesh.vertices.len() < 40, "{} triangles", mesh.triangles.len());
        assert!((mesh.area() - 1.0).abs() < 1e-3, "{}", mesh.area());
        for ([x, _, z], [red, green, blue]) in mesh.vertices.iter().zip(&mesh.colours) {
            assert!((z - 0.5).abs() < 1e-5 && (*green, *blue) == (10, 20));
            assert!((f32::from(*red) - 255.0 * x).abs() < 12.0, "red {red} at {x}");
        }
    }

    #[test]
    fn a_fold_stays_sharp() {
        let roof = |x: f32, _| (x - 0.5).abs();
        let mesh = sheet(32, roof).simplified(120);
        assert!(mesh.triangles.len() <= 120);
        // Two slopes of half the width at 45 degrees.
        assert!((mesh.area() - 2.0_f64.sqrt()).abs() < 2e-3, "{}", mesh.area());
        let off = mesh.vertices.iter().map(|[x, y, z]| (z - roof(*x, *y)).abs()).fold(0.0, f32::max);
        assert!(off < 0.01, "{off}");
        let faces_up = mesh.triangles.iter().all(|triangle| {
            let [a, b, c] = mesh.corners(triangle);
            (b - a).cross(&(c - a)).z > 0.0
        });
        assert!(faces_up, "a triangle is turned over");
    }

    #[test]
    fn it_is_always_the_same_and_never_more_than_there_is() {
        let mesh = sheet(20, |x, y| 0.1 * (9.0 * x).sin() * (7.0 * y).cos());
        let small = mesh.simplified(150);
        assert_eq!(small, mesh.simplified(150));
        assert!(small.triangles.len() <= 150 && small.triangles.len() > 100);
        assert_eq!(mesh.simplified(800), mesh);
        // Broken triangles are no harm.
        let broken = Mesh { triangles: vec![[0, 0, 1], [0, 1, 9], [0, 1, 2]], ..sheet(1, |_, _| 0.0) };
        assert_eq!(broken.simplified(2).triangles.len(), 1);
        assert!(Mesh::default().simplified(0).triangles.is_empty());
    }
}
