//! What two keyframes see of the same.

use mba_io::dataset::RgbdFrame;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use nalgebra::Vector3;

/// Cells of the coarse depth along each axis.
const CELLS: [usize; 2] = [16, 12];

/// A surface further away than what is seen there, by this factor, is hidden.
const HIDDEN: f64 = 1.15;

/// A view by its coarse depth.
#[derive(Clone, Debug)]
pub(crate) struct CoarseView {
    world_from_camera: RigidTransform,
    camera_from_world: RigidTransform,
    /// Metres, row by row; 0 where nothing was measured.
    depth: Vec<f64>,
    /// The same as points in the camera frame, those that were measured.
    points: Vec<Vector3<f64>>,
    furthest: f64,
}

impl CoarseView {
    /// Of a frame from its pose; `depth_scale` are raw units per metre.
    pub(crate) fn new(
        frame: &RgbdFrame,
        world_from_camera: RigidTransform,
        camera: &PinholeCamera,
        depth_scale: f64,
    ) -> Self {
        let mut view = Self {
            world_from_camera,
            camera_from_world: world_from_camera.inverse(),
            depth: Vec::with_capacity(CELLS[0] * CELLS[1]),
            points: Vec::new(),
            furthest: 0.0,
        };
        for row in 0..CELLS[1] {
            for column in 0..CELLS[0] {
                let [left, right] = [column, column + 1].map(|k| k * frame.width / CELLS[0]);
                let [top, bottom] = [row, row + 1].map(|k| k * frame.height / CELLS[1]);
                let depth = median_depth(frame, [left, right], [top, bottom]) / depth_scale;
                view.depth.push(depth);
                if depth > 0.0 {
                    // The middle of the cell, with pixel centres at whole numbers.
                    let [u, v] = [left + right, top + bottom].map(|sum| 0.5 * (sum as f64 - 1.0));
                    view.points.push(camera.ray(u, v) * depth);
                    view.furthest = view.furthest.max(depth);
                }
            }
        }
        view
    }

    /// Share (0 to 1) of what this view sees that the other one sees, too.
    pub(crate) fn shared_with(&self, other: &Self, camera: &PinholeCamera) -> f64 {
        let apart = (self.world_from_camera.translation - other.world_from_camera.translation).norm();
        // Neither sees as far: no need to look.
        if self.points.is_empty() || apart > 2.0 * (self.furthest + other.furthest) {
            return 0.0;
        }
        let other_from_self = other.camera_from_world.compose(&self.world_from_camera);
        let is_seen = |point: &&Vector3<f64>| other.sees(&other_from_self.transform_point(point), camera);
        self.points.iter().filter(is_seen).count() as f64 / self.points.len() as f64
    }

    fn sees(&self, point: &Vector3<f64>, camera: &PinholeCamera) -> bool {
        if point.z <= 0.0 {
            return false;
        }
        let pixel = camera.project(point);
        let cell = |at: f64, size: usize, cells: usize| {
            let cell = (at + 0.5) / size as f64 * cells as f64;
            (cell >= 0.0 && cell < cells as f64).then_some(cell as usize)
        };
        let (column, row) = (cell(pixel.x, camera.width, CELLS[0]), cell(pixel.y, camera.height, CELLS[1]));
        let (Some(column), Some(row)) = (column, row) else { return false };
        point.z < HIDDEN * self.depth[row * CELLS[0] + column]
    }
}

/// What all views see together, in pictures: each adds the share of it that none before it sees.
pub(crate) fn extent(views: &[&CoarseView], camera: &PinholeCamera) -> f64 {
    let new_share = |(k, view): (usize, &&CoarseView)| {
        let is_new = |point: &&Vector3<f64>| {
            let point = view.world_from_camera.transform_point(point);
            let sees =
                |other: &&CoarseView| other.sees(&other.camera_from_world.transform_point(&point), camera);
            !views[..k].iter().any(sees)
        };
        view.points.iter().filter(is_new).count() as f64 / view.points.len().max(1) as f64
    };
    views.iter().enumerate().map(new_share).sum()
}

/// Median of what was measured in some columns and rows, raw units; 0 for nothing.
fn median_depth(frame: &RgbdFrame, [left, right]: [usize; 2], [top, bottom]: [usize; 2]) -> f64 {
    let rows = (top..bottom).map(|row| row * frame.width);
    let values = rows.flat_map(|start| frame.depth.get(start + left..start + right).unwrap_or(&[]));
    let mut values: Vec<u16> = values.copied().filter(|depth| *depth > 0).collect();
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    f64::from(*values.select_nth_unstable(middle).1)
}

#[cfg(test)]
pub(crate) mod tests {
    use mba_tracker::geometry::so3;

    use super::*;

    pub(crate) const CAMERA: PinholeCamera =
        PinholeCamera { width: 160, height: 120, fx: 80.0, fy: 80.0, cx: 79.5, cy: 59.5 };

    /// A view of a wall at two metres, turned to the right by an angle in radians.
    pub(crate) fn view(turn: f64, shift: f64, metres: f64) -> CoarseView {
        let frame = RgbdFrame {
            index: 0,
            timestamp: 0.0,
            depth_timestamp: 0.0,
            exposure_seconds: 0.01,
            width: 160,
            height: 120,
            rgb: Vec::new(),
            depth: vec![(metres * 1000.0) as u16; 160 * 120],
        };
        let rotation = so3::exp(&Vector3::new(0.0, turn, 0.0));
        let pose = RigidTransform::new(rotation, Vector3::new(shift, 0.0, 0.0));
        CoarseView::new(&frame, pose, &CAMERA, 1000.0)
    }

    #[test]
    fn a_step_aside_shares_what_it_overlaps() {
        // The picture of a wall at 2 m is 4 m wide.
        let here = view(0.0, 0.0, 2.0);
        let shared = |other: &CoarseView| here.shared_with(other, &CAMERA);
        assert_eq!(shared(&here), 1.0);
        assert!((shared(&view(0.0, 1.0, 2.0)) - 0.75).abs() < 0.04);
        assert_eq!(shared(&view(0.0, 4.5, 2.0)), 0.0);
        assert_eq!(shared(&view(3.1, 0.0, 2.0)), 0.0);
        let path = [0.0, 0.5, 1.0, 1.5, 2.0].map(|shift| view(0.0, shift, 2.0));
        let seen = extent(&path.iter().collect::<Vec<_>>(), &CAMERA);
        assert!((seen - 1.5).abs() < 0.15, "{seen} pictures are 6 m of the wall");
        // What stands in front hides the wall.
        assert_eq!(shared(&view(0.0, 0.0, 1.0)), 0.0);
    }
}
