//! What is estimated for a frame.

use mba_raster::exposure::{ExposurePath, blur_length};
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::trajectory::ExposureTrajectory;
use nalgebra::{Quaternion, UnitQuaternion, Vector3, Vector6};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::path_step::PathMoments;

/// Path and brightness of one frame, and how their optimisation goes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameState {
    /// Path of the camera while anything of the frame was measured: during the exposure, if that is all.
    #[serde(with = "stored_path")]
    pub path: ExposurePath,
    /// Logarithm of the gain on the map's light that gives the frame's.
    pub log_gain: f64,
    /// Moments of the path's gradients.
    pub path_moments: PathMoments,
    /// Moments of the gain's gradients.
    pub gain_moments: ScalarMoments,
    /// Steps that the map made on this frame.
    pub visits: u32,
}

impl FrameState {
    /// A frame on a path, as bright as the map.
    #[must_use]
    pub fn new(path: ExposurePath) -> Self {
        Self {
            path,
            log_gain: 0.0,
            path_moments: PathMoments::default(),
            gain_moments: ScalarMoments::default(),
            visits: 0,
        }
    }

    /// Length of the blur at a depth (metres), pixels of `camera`: of both halves of the exposure together, which takes
    /// the share `exposure` of the path.
    #[must_use]
    pub fn blur_px(&self, camera: &PinholeCamera, depth: f64, exposure: f64) -> f64 {
        let path = self.path.stretched(exposure);
        let ExposurePath { ends: ExposureTrajectory { start, end }, .. } = path;
        let mid = path.mid();
        let halves = [ExposureTrajectory { start, end: mid }, ExposureTrajectory { start: mid, end }];
        halves.iter().map(|half| blur_length(half, camera, depth)).sum()
    }
}

/// Adam's moments of one number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ScalarMoments {
    first: f64,
    second: f64,
    updates: u32,
}

impl ScalarMoments {
    /// The step against `gradient`, of about `length`.
    pub fn step(&mut self, gradient: f64, length: f64) -> f64 {
        self.updates += 1;
        let updates = self.updates.min(10_000) as i32;
        self.first = 0.9 * self.first + 0.1 * gradient;
        self.second = 0.99 * self.second + 0.01 * gradient * gradient;
        let (first, second) = (1.0 - 0.9_f64.powi(updates), 1.0 - 0.99_f64.powi(updates));
        -length * (self.first / first) / ((self.second / second).sqrt() + 1e-20)
    }
}

/// A path as plain numbers, every bit kept.
mod stored_path {
    use super::*;

    #[derive(Serialize, Deserialize)]
    struct Stored {
        start: [f64; 7],
        end: [f64; 7],
        bow: [f64; 6],
    }

    pub(super) fn serialize<S: Serializer>(path: &ExposurePath, serializer: S) -> Result<S::Ok, S::Error> {
        let numbers = |pose: &RigidTransform| {
            let (t, q) = (pose.translation, pose.rotation.coords);
            [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
        };
        let stored =
            Stored { start: numbers(&path.ends.start), end: numbers(&path.ends.end), bow: path.bow.into() };
        stored.serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<ExposurePath, D::Error> {
        let stored = Stored::deserialize(deserializer)?;
        let pose = |[tx, ty, tz, x, y, z, w]: [f64; 7]| {
            // Normalising again would change the last bit.
            let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
            RigidTransform::new(rotation, Vector3::new(tx, ty, tz))
        };
        let ends = ExposureTrajectory { start: pose(stored.start), end: pose(stored.end) };
        Ok(ExposurePath { ends, bow: Vector6::from(stored.bow) })
    }
}
