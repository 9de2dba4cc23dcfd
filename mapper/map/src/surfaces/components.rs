//! Parts of a surface that hang together.

use mba_mesh::Mesh;

/// For each vertex, whether the part of the surface it belongs to has at least `least_area` square metres.
pub(super) fn large(mesh: &Mesh, least_area: f64) -> Vec<bool> {
    let mut parent: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    for [a, b, c] in &mesh.triangles {
        for other in [b, c] {
            let [one, other] = [root(&mut parent, *a), root(&mut parent, *other)];
            parent[one.max(other) as usize] = one.min(other);
        }
    }
    let mut area = vec![0.0; mesh.vertices.len()];
    for triangle in &mesh.triangles {
        area[root(&mut parent, triangle[0]) as usize] += mesh.triangle_area(triangle);
    }
    (0..mesh.vertices.len() as u32)
        .map(|vertex| area[root(&mut parent, vertex) as usize] >= least_area)
        .collect()
}

/// The vertex that stands for the part of `vertex`; shortens the way there.
fn root(parent: &mut [u32], mut vertex: u32) -> u32 {
    while parent[vertex as usize] != vertex {
        parent[vertex as usize] = parent[parent[vertex as usize] as usize];
        vertex = parent[vertex as usize];
    }
    vertex
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_count_for_all_that_hangs_together() {
        let strip = |left: f32| [[left, 0.0, 0.0], [left + 1.0, 0.0, 0.0], [left, 2.0, 0.0]];
        let mut vertices: Vec<[f32; 3]> = [strip(0.0), strip(5.0)].concat();
        vertices.extend([[1.0, 2.0, 0.0], [9.0; 3]]);
        let mesh = Mesh { vertices, colours: Vec::new(), triangles: vec![[3, 4, 5], [6, 2, 1], [0, 1, 2]] };
        let of = |least_area| large(&mesh, least_area);
        assert_eq!(of(1.5), [true, true, true, false, false, false, true, false]);
        assert_eq!(of(2.5), [false; 8]);
        assert_eq!(of(0.5)[3..6], [true; 3]);
    }
}
