//! What depth a camera sees of a mesh: triangles drawn into a z-buffer.

use std::ops::Range;

use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use nalgebra::{Vector2, Vector3};

use super::triangles::Mesh;

/// What is nearer than this along the optical axis, metres, is cut off: points behind the camera have no image.
const NEAREST: f64 = 0.05;

/// Depth along the optical axis in metres at the centre of every pixel, row by row; 0 where there is no surface.
///
/// Triangles are seen from both sides, and the nearest one counts. They are clipped 5 cm in front of the camera, so that
/// large ones that reach behind it are drawn as far as they are visible. Neighbours leave no gaps between them.
/// Triangles with a corner that is no vertex are left out.
#[must_use]
pub fn depth_image(mesh: &Mesh, camera: &PinholeCamera, world_from_camera: &RigidTransform) -> Vec<f64> {
    let camera_from_world = world_from_camera.inverse();
    let in_camera =
        |vertex: &[f32; 3]| camera_from_world.transform_point(&Vector3::from(vertex.map(f64::from)));
    let vertices: Vec<Vector3<f64>> = mesh.vertices.iter().map(in_camera).collect();
    let mut nearest = InverseDepth { camera, pixels: vec![0.0; camera.width * camera.height] };
    for corners in &mesh.triangles {
        let corners = corners.map(|corner| vertices.get(corner as usize).copied());
        if let [Some(a), Some(b), Some(c)] = corners {
            clip([a, b, c]).into_iter().flatten().for_each(|triangle| nearest.draw(&triangle));
        }
    }
    nearest.pixels.iter().map(|&inverse| if inverse > 0.0 { 1.0 / inverse } else { 0.0 }).collect()
}

/// The part of a triangle in the camera's frame that is not nearer than [`NEAREST`]: none, one or two triangles.
fn clip([a, b, c]: [Vector3<f64>; 3]) -> [Option<[Vector3<f64>; 3]>; 2] {
    // Always from the visible end: neighbours cut the side that they share at the very same point.
    let cut =
        |from: Vector3<f64>, to: Vector3<f64>| from + (to - from) * ((NEAREST - from.z) / (to.z - from.z));
    let tip = |a, b, c| [Some([a, cut(a, b), cut(a, c)]), None];
    let stump = |a, b, c| [Some([a, b, cut(b, c)]), Some([a, cut(b, c), cut(a, c)])];
    match [a, b, c].map(|corner| corner.z >= NEAREST) {
        [true, true, true] => [Some([a, b, c]), None],
        [true, false, false] => tip(a, b, c),
        [false, true, false] => tip(b, c, a),
        [false, false, true] => tip(c, a, b),
        [true, true, false] => stump(a, b, c),
        [false, true, true] => stump(b, c, a),
        [true, false, true] => stump(c, a, b),
        [false, false, false] => [None; 2],
    }
}

/// The z-buffer, 1/m; 0 is infinitely far away. Inverse depth of a plane is linear in the image, depth is not.
struct InverseDepth<'a> {
    camera: &'a PinholeCamera,
    pixels: Vec<f64>,
}

impl InverseDepth<'_> {
    /// Draws a triangle of the camera's frame that is in front of the camera.
    fn draw(&mut self, triangle: &[Vector3<f64>; 3]) {
        let PinholeCamera { width, height, .. } = *self.camera;
        let inverse_depth = Vector3::from(triangle.map(|corner| 1.0 / corner.z));
        let corners = triangle.map(|corner| self.camera.project(&corner));
        let columns = pixels_between(corners.map(|corner| corner.x), width);
        for row in pixels_between(corners.map(|corner| corner.y), height) {
            for column in columns.clone() {
                let pixel = Vector2::new(column as f64, row as f64);
                if let Some(weights) = barycentric(&corners, &pixel) {
                    let nearest = &mut self.pixels[row * width + column];
                    // The largest inverse depth is the nearest.
                    *nearest = nearest.max(weights.dot(&inverse_depth));
                }
            }
        }
    }
}

/// The pixels along an axis of `length` pixels that have their centres between the least and the largest coordinate.
fn pixels_between(coordinates: [f64; 3], length: usize) -> Range<usize> {
    let [a, b, c] = coordinates;
    // Conversions of floats saturate.
    let end = (a.max(b).max(c).floor() + 1.0) as usize;
    a.min(b).min(c).ceil() as usize..end.min(length)
}

/// Weights of the corners at a pixel within the triangle or on its border, whichever way round it is.
fn barycentric(corners: &[Vector2<f64>; 3], pixel: &Vector2<f64>) -> Option<Vector3<f64>> {
    let [a, b, c] = corners.map(|corner| corner - pixel);
    // The area beside a side is rounded alike for both triangles there, but for the sign: no pixel is outside of both.
    let areas = Vector3::new(b.perp(&c), c.perp(&a), a.perp(&b));
    let within = areas.iter().all(|area| *area >= 0.0) || areas.iter().all(|area| *area <= 0.0);
    let total = areas.sum();
    (within && total != 0.0).then(|| areas / total)
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 80, height: 60, fx: 70.0, fy: 60.0, cx: 39.5, cy: 29.5 };

    /// Triangles over a square of `2 size` by `2 size` metres, cells of `cell` metres, in the surface that `place` gives.
    fn sheet(size: f32, cell: f32, place: impl Fn(f32, f32) -> [f32; 3]) -> Mesh {
        let cells = (2.0 * size / cell) as u32;
        let at = |k: u32| cell * k as f32 - size;
        let corners = (0..=cells).flat_map(|row| (0..=cells).map(move |column| (column, row)));
        let vertices = corners.map(|(column, row)| place(at(column), at(row))).collect();
        let first = (0..cells).flat_map(|row| (0..cells).map(move |column| row * (cells + 1) + column));
        let halves = |k: u32| [[k, k + 1, k + cells + 2], [k, k + cells + 2, k + cells + 1]];
        Mesh { vertices, colours: Vec::new(), triangles: first.flat_map(halves).collect() }
    }

    /// Asserts the depth of every pixel, for the ray through it with unit z.
    fn assert_depth(found: &[f64], tolerance: f64, expected: impl Fn(&Vector3<f64>) -> f64) {
        assert_eq!(found.len(), CAMERA.width * CAMERA.height);
        for (pixel, found) in found.iter().enumerate() {
            let (u, v) = (pixel % CAMERA.width, pixel / CAMERA.width);
            let expected = expected(&CAMERA.ray(u as f64, v as f64));
            assert!((found - expected).abs() <= tolerance, "{found} instead of {expected} at {u}, {v}");
        }
    }

    #[test]
    fn a_slanted_plane_has_its_depth_at_every_pixel() {
        // z = 2 + x/2 + y/4 at x = z r_x, y = z r_y. Coarse: the corner with z = -1 is behind the camera.
        let expected = |ray: &Vector3<f64>| 2.0 / (1.0 - 0.5 * ray.x - 0.25 * ray.y);
        for cell in [8.0, 0.125] {
            let mut mesh = sheet(4.0, cell, |x, y| [x, y, 2.0 + 0.5 * x + 0.25 * y]);
            let own = depth_image(&mesh, &CAMERA, &RigidTransform::identity());
            assert_depth(&own, 1e-12, expected);
            let turn = UnitQuaternion::from_euler_angles(0.4, 1.0, -2.0);
            let world_from_camera = RigidTransform::new(turn, Vector3::new(3.0, -1.0, 0.5));
            mesh.transform(&world_from_camera);
            // Vertices of some metres in single precision.
            assert_depth(&depth_image(&mesh, &CAMERA, &world_from_camera), 2e-6, expected);
        }
    }

    #[test]
    fn the_nearer_triangle_wins() {
        let facing = |z: f32| sheet(4.0, 8.0, move |x, y| [x, y, z]);
        let (near, far) = (facing(1.5), facing(2.5));
        let vertices = [near.vertices, far.vertices].concat();
        let behind: Vec<[u32; 3]> =
            far.triangles.iter().map(|corners| corners.map(|corner| corner + 4)).collect();
        for triangles in [[near.triangles.clone(), behind.clone()], [behind, near.triangles]] {
            let mut mesh =
                Mesh { vertices: vertices.clone(), triangles: triangles.concat(), ..Mesh::default() };
            assert_depth(&depth_image(&mesh, &CAMERA, &RigidTransform::identity()), 1e-12, |_| 1.5);
            mesh.triangles.iter_mut().for_each(|corners| corners.reverse());
            assert_depth(&depth_image(&mesh, &CAMERA, &RigidTransform::identity()), 1e-12, |_| 1.5);
        }
    }

    #[test]
    fn what_is_too_near_or_behind_is_cut_off() {
        // A floor 1/64 m below the camera, from 2 m behind it to 2 m in front of it: two triangles, one with one corner
        // in front and one with two.
        let floor = sheet(2.0, 4.0, |x, z| [8.0 * x, 0.015_625, z]);
        let expected = |ray: &Vector3<f64>| {
            let depth = 0.015_625 / ray.y;
            if (0.05..=2.0).contains(&depth) { depth } else { 0.0 }
        };
        let image = depth_image(&floor, &CAMERA, &RigidTransform::identity());
        assert_depth(&image, 1e-12, expected);
        // Rows above the horizon, the one that reaches beyond 2 m, and those below the cut at 0.3125.
        let rows = (0..60).filter(|row| image[row * 80] > 0.0).collect::<Vec<_>>();
        assert_eq!((rows.first(), rows.last()), (Some(&30), Some(&48)));
    }

    #[test]
    fn damaged_triangles_are_left_out() {
        let mut mesh = sheet(4.0, 8.0, |x, y| [x, y, 2.0]);
        mesh.triangles.push([0, 1, 9]);
        mesh.triangles.push([0, 3, 3]);
        mesh.vertices.push([f32::NAN; 3]);
        mesh.triangles.push([0, 1, 4]);
        assert_depth(&depth_image(&mesh, &CAMERA, &RigidTransform::identity()), 1e-12, |_| 2.0);
    }
}
