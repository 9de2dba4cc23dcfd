//! One surface from the pieces of many boxes.

use std::collections::HashMap;

use mba_mesh::Mesh;

use super::piece::{Crossing, Piece};

/// Where the points of a regular grid are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::surfaces) struct Lattice {
    /// Position of the point `[0, 0, 0]`, metres.
    pub(in crate::surfaces) origin: [f64; 3],
    /// Distance of neighbouring points, metres.
    pub(in crate::surfaces) voxel: f64,
}

/// Joins pieces in the order they come in: crossings on edges that several boxes have become one vertex.
#[derive(Debug)]
pub(in crate::surfaces) struct Assembly {
    lattice: Lattice,
    mesh: Mesh,
    shared: HashMap<([i32; 3], u8), u32>,
}

impl Assembly {
    /// A surface without triangles.
    pub(in crate::surfaces) fn new(lattice: Lattice) -> Self {
        Self { lattice, mesh: Mesh::default(), shared: HashMap::new() }
    }

    /// Adds the surface of a box.
    pub(in crate::surfaces) fn add(&mut self, piece: &Piece) {
        let vertices: Vec<u32> = piece.crossings.iter().map(|crossing| self.vertex(crossing)).collect();
        let triangles = piece.triangles.iter().map(|corners| corners.map(|corner| vertices[corner as usize]));
        self.mesh.triangles.extend(triangles);
    }

    /// The whole surface, without colours.
    pub(in crate::surfaces) fn finish(self) -> Mesh {
        self.mesh
    }

    fn vertex(&mut self, crossing: &Crossing) -> u32 {
        let new = self.mesh.vertices.len() as u32;
        if crossing.shared {
            let vertex = *self.shared.entry((crossing.point, crossing.axis)).or_insert(new);
            if vertex != new {
                return vertex;
            }
        }
        self.mesh.vertices.push(self.lattice.position(crossing));
        new
    }
}

impl Lattice {
    fn position(&self, crossing: &Crossing) -> [f32; 3] {
        let along = |axis: usize| if axis == usize::from(crossing.axis) { crossing.share } else { 0.0 };
        let coordinate = |axis: usize| f64::from(crossing.point[axis]) + f64::from(along(axis));
        std::array::from_fn(|axis| (self.origin[axis] + self.voxel * coordinate(axis)) as f32)
    }
}
