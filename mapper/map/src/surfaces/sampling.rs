//! Points evenly on a surface.

use mba_mesh::Mesh;

/// Steps of the two-dimensional sequence that fills a square most evenly (Roberts 2018): 1/g and 1/g^2 with
/// g^3 = g + 1.
const STEPS: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];

/// `count` points, evenly by area: the same for the same mesh, and the same part of them on equal areas. A mesh without
/// triangles, a cloud, gives all of its vertices.
#[must_use]
pub fn sample_surface(mesh: &Mesh, count: usize) -> Vec<[f32; 3]> {
    if mesh.triangles.is_empty() {
        return mesh.vertices.clone();
    }
    let step = mesh.area() / count as f64;
    let mut points = Vec::with_capacity(count);
    let mut area_before = 0.0;
    for triangle in &mesh.triangles {
        area_before += mesh.triangle_area(triangle);
        let [a, b, c] = mesh.corners(triangle);
        while points.len() < count && (points.len() as f64 + 0.5) * step <= area_before {
            let [along, across] = STEPS.map(|step| (points.len() as f64 * step).fract());
            // The square is folded onto the triangle.
            let folded = along + across > 1.0;
            let [along, across] = if folded { [1.0 - along, 1.0 - across] } else { [along, across] };
            let point = a + (b - a) * along + (c - a) * across;
            points.push([point.x, point.y, point.z].map(|coordinate| coordinate as f32));
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_areas_get_equally_many_points() {
        // A square of two triangles, and one triangle elsewhere that is three times as large as the square.
        let vertices = vec![
            [0.0; 3],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 5.0],
            [2.0, 0.0, 5.0],
            [0.0, 3.0, 5.0],
        ];
        let mesh = Mesh { vertices, colours: Vec::new(), triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6]] };
        let points = sample_surface(&mesh, 4000);
        assert_eq!(points.len(), 4000);
        let within = |inside: &dyn Fn(&[f32; 3]) -> bool| points.iter().filter(|point| inside(point)).count();
        assert_eq!(within(&|point| point[2] == 5.0), 3000);
        // A quarter of the square, and the corner of the large triangle that is similar to it by one half.
        let quarter = within(&|[x, y, z]| *z == 0.0 && *x < 0.5 && *y < 0.5);
        assert!(quarter.abs_diff(250) < 12, "{quarter}");
        let corner = within(&|[x, y, z]| *z == 5.0 && x / 2.0 + y / 3.0 < 0.5);
        assert!(corner.abs_diff(750) < 12, "{corner}");
        assert!(points.iter().all(|[x, y, z]| *z == 0.0 || x / 2.0 + y / 3.0 < 1.0 + 1e-6));
    }

    #[test]
    fn a_cloud_is_its_own_sample() {
        let cloud = Mesh { vertices: vec![[1.0; 3], [2.0; 3]], ..Mesh::default() };
        assert_eq!(sample_surface(&cloud, 99), cloud.vertices);
    }
}
