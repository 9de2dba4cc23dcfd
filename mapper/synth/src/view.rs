//! Pixels to rays: a posed pinhole camera in single precision.

use glam::Vec3;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use nalgebra::Vector3;

use super::scene::{Cone, Ray};

/// The rays of one view. Their direction has z = 1 in the camera, so distance along a ray is depth.
#[derive(Clone, Copy)]
pub(super) struct View {
    origin: Vec3,
    /// Direction of pixel (0, 0) and its change per column and row.
    first: Vec3,
    per_column: Vec3,
    per_row: Vec3,
    /// Angle between neighbouring pixels in the middle of the image, radians.
    pub(super) pixel_angle: f32,
}

impl View {
    pub(super) fn new(camera: &PinholeCamera, world_from_camera: &RigidTransform) -> Self {
        let rotation = world_from_camera.rotation_matrix();
        let single = |v: Vector3<f64>| Vec3::new(v.x as f32, v.y as f32, v.z as f32);
        Self {
            origin: single(world_from_camera.translation),
            first: single(rotation * camera.ray(0.0, 0.0)),
            per_column: single(rotation.column(0) / camera.fx),
            per_row: single(rotation.column(1) / camera.fy),
            pixel_angle: (1.0 / camera.fx) as f32,
        }
    }

    /// The ray through pixel coordinates `(u, v)`, pixel centres at whole numbers.
    pub(super) fn ray(&self, u: f32, v: f32) -> Ray {
        Ray { origin: self.origin, direction: self.first + self.per_column * u + self.per_row * v }
    }

    /// A cone around the rays of the pixels in the rectangle, its edges included.
    pub(super) fn cone(&self, columns: [f32; 2], rows: [f32; 2]) -> Cone {
        let middle = self.ray(0.5 * (columns[0] + columns[1]), 0.5 * (rows[0] + rows[1]));
        let axis = middle.direction / middle.direction.length();
        let cosine_to = |u: f32, v: f32| {
            let direction = self.ray(u, v).direction;
            direction.dot(axis) / direction.length()
        };
        let corners = columns.into_iter().flat_map(|u| rows.map(|v| cosine_to(u, v)));
        // A little wider than the corners, so that rounding never drops a thing.
        let cosine = corners.fold(1.0, f32::min) - 1e-5;
        Cone { apex: self.origin, axis, sine: (1.0 - cosine * cosine).max(0.0).sqrt(), cosine }
    }
}
