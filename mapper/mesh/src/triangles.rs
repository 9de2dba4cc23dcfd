//! A surface of coloured triangles.

use mba_tracker::geometry::RigidTransform;
use nalgebra::Vector3;

/// Triangles with shared, coloured vertices; without triangles, a cloud of points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Positions in metres.
    pub vertices: Vec<[f32; 3]>,
    /// Red, green and blue as displays show them, one per vertex; or none at all.
    pub colours: Vec<[u8; 3]>,
    /// Three vertices each, counter-clockwise as seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The corners of a triangle in metres. A corner that is no vertex is at the origin.
    #[must_use]
    pub fn corners(&self, triangle: &[u32; 3]) -> [Vector3<f64>; 3] {
        triangle.map(|vertex| {
            let position = self.vertices.get(vertex as usize).copied().unwrap_or_default();
            Vector3::from(position.map(f64::from))
        })
    }

    /// Area of a triangle in square metres.
    #[must_use]
    pub fn triangle_area(&self, triangle: &[u32; 3]) -> f64 {
        let [a, b, c] = self.corners(triangle);
        0.5 * (b - a).cross(&(c - a)).norm()
    }

    /// Area of all triangles in square metres.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.triangles.iter().map(|triangle| self.triangle_area(triangle)).sum()
    }

    /// Moves all vertices from their frame b to a frame a.
    pub fn transform(&mut self, a_from_b: &RigidTransform) {
        for vertex in &mut self.vertices {
            let moved = a_from_b.transform_point(&Vector3::from(vertex.map(f64::from)));
            *vertex = [moved.x, moved.y, moved.z].map(|coordinate| coordinate as f32);
        }
    }

    /// Keeps the triangles for which `keep` holds, and of the vertices those that they use.
    #[must_use]
    pub fn with_triangles(&self, keep: impl Fn(&[u32; 3]) -> bool) -> Self {
        const UNUSED: u32 = u32::MAX;
        let mut kept = Self::default();
        let mut new_vertex = vec![UNUSED; self.vertices.len()];
        for triangle in self.triangles.iter().filter(|triangle| keep(triangle)) {
            let triangle = triangle.map(|vertex| {
                let vertex = vertex as usize;
                if new_vertex[vertex] == UNUSED {
                    new_vertex[vertex] = kept.vertices.len() as u32;
                    kept.vertices.push(self.vertices[vertex]);
                    kept.colours.extend(self.colours.get(vertex));
                }
                new_vertex[vertex]
            });
            kept.triangles.push(triangle);
        }
        kept
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    fn two_triangles() -> Mesh {
        Mesh {
            vertices: vec![[9.0; 3], [0.0; 3], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 1.0]],
            colours: (0..5).map(|k| [k; 3]).collect(),
            triangles: vec![[1, 2, 3], [1, 4, 3]],
        }
    }

    #[test]
    fn areas_do_not_change_when_it_moves() {
        let mut mesh = two_triangles();
        assert_eq!(mesh.area(), 6.0 + 2.0);
        let turn = UnitQuaternion::from_euler_angles(0.3, -1.0, 2.0);
        mesh.transform(&RigidTransform::new(turn, Vector3::new(1.0, 2.0, 3.0)));
        assert_eq!(mesh.vertices[1], [1.0, 2.0, 3.0]);
        assert!((mesh.area() - 8.0).abs() < 1e-5);
    }

    #[test]
    fn unused_vertices_leave_with_the_triangles() {
        let kept = two_triangles().with_triangles(|triangle| triangle[1] == 4);
        assert_eq!(kept.triangles, [[0, 1, 2]]);
        assert_eq!(kept.colours, [[1; 3], [4; 3], [3; 3]]);
        assert_eq!(kept.vertices, [[0.0; 3], [0.0, 0.0, 1.0], [0.0, 4.0, 0.0]]);
    }
}
