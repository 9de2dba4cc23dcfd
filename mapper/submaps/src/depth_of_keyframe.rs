//! What a keyframe of a finished submap sees: its pose in the world of all, and the depth of the map there.

use std::path::Path;

use mba_io::dataset::read_image;
use mba_io::run_layout::DEPTH_FOLDER;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use nalgebra::Vector3;

/// What lies behind the depth by more than this share of it and so many metres is hidden.
const HIDDEN: (f64, f64) = (1.05, 0.03);

/// A keyframe and what it sees.
pub(crate) struct DepthView {
    camera: PinholeCamera,
    camera_from_world: RigidTransform,
    place: Vector3<f64>,
    /// Raw units, row by row; 0 where the map shows nothing.
    depth: Vec<u16>,
    depth_scale: f64,
}

impl DepthView {
    /// Of keyframe `index`, whose depth lies in the RUN folder `folder`; none where there is no such image of the camera's
    /// size.
    pub(crate) fn read(
        folder: &Path,
        index: usize,
        world_from_camera: &RigidTransform,
        (camera, depth_scale): (&PinholeCamera, f64),
    ) -> Option<Self> {
        let image =
            read_image(&folder.join(DEPTH_FOLDER).join(format!("{index:06}.png"))).ok()?.into_luma16();
        let is_fitting = (image.width() as usize, image.height() as usize) == (camera.width, camera.height);
        is_fitting.then(|| Self {
            camera: *camera,
            camera_from_world: world_from_camera.inverse(),
            place: world_from_camera.translation,
            depth: image.into_raw(),
            depth_scale,
        })
    }

    /// Of a keyframe that sees the same depth everywhere, metres.
    #[cfg(test)]
    pub(crate) fn of_wall(camera: &PinholeCamera, world_from_camera: &RigidTransform, metres: f64) -> Self {
        Self {
            camera: *camera,
            camera_from_world: world_from_camera.inverse(),
            place: world_from_camera.translation,
            depth: vec![(metres * 1000.0).round() as u16; camera.width * camera.height],
            depth_scale: 1000.0,
        }
    }

    /// Largest depth, metres.
    pub(crate) fn furthest(&self) -> f64 {
        f64::from(self.depth.iter().copied().max().unwrap_or(0)) / self.depth_scale
    }

    /// Distance in metres to a point that is not hidden.
    pub(crate) fn distance(&self, point: &Vector3<f64>) -> Option<f64> {
        let seen = self.camera_from_world.transform_point(point);
        if seen.z <= 0.0 {
            return None;
        }
        let pixel = self.camera.project(&seen);
        let within =
            |at: f64, size: usize| (at > -0.5 && at < size as f64 - 0.5).then(|| at.round() as usize);
        let (column, row) = (within(pixel.x, self.camera.width)?, within(pixel.y, self.camera.height)?);
        let depth = f64::from(*self.depth.get(row * self.camera.width + column)?) / self.depth_scale;
        (depth > 0.0 && seen.z < HIDDEN.0 * depth + HIDDEN.1).then(|| seen.norm())
    }

    /// Direction to a point, unit length.
    pub(crate) fn direction(&self, point: &Vector3<f64>) -> Vector3<f64> {
        (point - self.place).normalize()
    }
}
