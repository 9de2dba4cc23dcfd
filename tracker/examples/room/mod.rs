//! Stands in for a camera: the corner of a textured room, photographed along the path of a hand.

use core::f64::consts::TAU;

use mba_tracker::error::FrameError;
use mba_tracker::geometry::{PinholeCamera, RigidTransform, so3};
use mba_tracker::image::{ColourView, DepthView, PixelFormat};
use mba_tracker::trajectory::{ExposureTrajectory, SampleRule};
use nalgebra::Vector3;

/// The camera.
pub(crate) const CAMERA: PinholeCamera =
    PinholeCamera { width: 320, height: 240, fx: 275.0, fy: 275.0, cx: 159.5, cy: 119.5 };
/// Seconds that the shutter is open.
pub(crate) const EXPOSURE: f64 = 0.02;
/// Metres per raw unit of depth.
pub(crate) const METRES_PER_UNIT: f32 = 0.0002;

/// A photograph: bytes of linear light, and raw depth.
pub(crate) struct Picture {
    grey: Vec<u8>,
    depth: Vec<u16>,
}

impl Picture {
    /// As the tracker takes it.
    pub(crate) fn views(&self) -> Result<(ColourView<'_>, DepthView<'_>), FrameError> {
        let (width, height) = (CAMERA.width, CAMERA.height);
        let colour = ColourView::new(&self.grey, width, height, width, PixelFormat::Grey8)?;
        Ok((colour, DepthView::new(&self.depth, width, height, width)?))
    }
}

/// What the camera sees while it moves along `room_from_camera`; the depth is that of the middle.
pub(crate) fn photograph(room_from_camera: &ExposureTrajectory) -> Picture {
    let views = if room_from_camera.start == room_from_camera.end { 1 } else { 9 };
    let mut light = vec![0.0; CAMERA.width * CAMERA.height];
    for k in 0..views {
        let hits = look(room_from_camera.at(SampleRule::Midpoint.time(k, views)));
        light.iter_mut().zip(hits).for_each(|(sum, (light, _))| *sum += light / views as f64);
    }
    Picture {
        grey: light.iter().map(|light| (255.0 * light).round() as u8).collect(),
        depth: look(room_from_camera.mid())
            .map(|(_, depth)| (depth / f64::from(METRES_PER_UNIT)).round() as u16)
            .collect(),
    }
}

/// The camera's motion while the shutter is open around `time`, in seconds.
pub(crate) fn exposure(time: f64) -> ExposureTrajectory {
    let pose = |t: f64| {
        let sway = |hertz: f64| (TAU * hertz * t).sin();
        let rotation = Vector3::new(0.05 * sway(0.9), 0.3 + 0.06 * sway(0.7), 0.03 * sway(1.1));
        let translation = Vector3::new(0.6 + 0.10 * sway(0.8), 0.06 * sway(1.0), 0.4 + 0.05 * sway(0.6));
        RigidTransform::new(so3::exp(&rotation), translation)
    };
    ExposureTrajectory { start: pose(time - 0.5 * EXPOSURE), end: pose(time + 0.5 * EXPOSURE) }
}

/// Light and depth at every pixel.
fn look(room_from_camera: RigidTransform) -> impl Iterator<Item = (f64, f64)> {
    let (rotation, origin) = (room_from_camera.rotation_matrix(), room_from_camera.translation);
    (0..CAMERA.width * CAMERA.height).map(move |k| {
        let ray = rotation * CAMERA.ray((k % CAMERA.width) as f64, (k / CAMERA.width) as f64);
        // Planes x = 2.2, y = 0.9 and z = 3 metres; the ray has unit z in the camera, so the distance is the depth.
        let (axis, depth) = [2.2, 0.9, 3.0]
            .iter()
            .enumerate()
            .map(|(axis, at)| (axis, (at - origin[axis]) / ray[axis]))
            .filter(|(_, depth)| *depth > 0.0)
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or((2, 0.0));
        let hit = origin + ray * depth;
        (paint(hit[(axis + 1) % 3], hit[(axis + 2) % 3], axis as f64), depth)
    })
}

/// Linear light of a wall: waves of a few centimetres to half a metre, so that blur of a few pixels shows.
fn paint(x: f64, y: f64, phase: f64) -> f64 {
    let waves = [[11.0, 5.0], [-9.0, 21.0], [45.0, 17.0], [-23.0, 61.0], [97.0, -37.0], [31.0, 103.0]];
    let sum: f64 = waves.iter().map(|[u, v]| (u * x + v * y + phase * u).sin()).sum();
    0.45 + 0.07 * sum
}
