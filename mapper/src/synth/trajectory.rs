//! The camera's path: a slow sweep there and back, with the shake of a hand on top, exact at every instant.

use mba_tracker::geometry::{RigidTransform, so3};
use mba_tracker::math::{cos, sin};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::noise::{Purpose, stream, uniform};

/// Cubic curves of the camera's position and of the point it looks at, in world coordinates (y up, metres).
#[derive(Clone, Copy, Debug)]
pub(super) struct Sweep {
    pub(super) eye: [[f64; 3]; 4],
    pub(super) target: [[f64; 3]; 4],
}

/// Seconds for one whole sweep along its curve, there and back, at full reach.
const FULL_SWEEP_SECONDS: f64 = 14.0;

/// Base frequencies of hand tremor and sway in hertz, and their shares of the velocity (squares sum to 2, so that
/// the rms of the sum is 1).
const FREQUENCIES: [f64; 4] = [1.13, 2.71, 4.87, 8.41];
const SHARES: [f64; 4] = [0.66, 0.87, 0.77, 0.45];

/// How much each axis shakes: pitch, yaw, roll (relative), then x, y, z in metres per radian.
const AXIS_WEIGHTS: [f64; 6] = [1.0, 1.0, 0.6, 0.25, 0.25, 0.18];

/// Sums of sinusoids of unit rms velocity for six axes.
#[derive(Clone, Debug)]
struct Tremor {
    phases: [[f64; FREQUENCIES.len()]; 6],
}

impl Tremor {
    fn new(seed: u64) -> Self {
        let mut random = stream(seed, Purpose::Shake, 0, 0);
        let phases =
            std::array::from_fn(|_| std::array::from_fn(|_| std::f64::consts::TAU * uniform(&mut random)));
        Self { phases }
    }

    /// Displacement of an axis at time `t`.
    fn at(&self, axis: usize, t: f64) -> f64 {
        // Slightly different frequencies on every axis: the motion never repeats.
        let detune = 1.0 + 0.043 * axis as f64;
        let wave = |k: usize| {
            let omega = std::f64::consts::TAU * FREQUENCIES[k] * detune;
            SHARES[k] / omega * sin(omega * t + self.phases[axis][k])
        };
        AXIS_WEIGHTS[axis] * (0..FREQUENCIES.len()).map(wave).sum::<f64>()
    }
}

/// The whole camera path.
#[derive(Clone, Debug)]
pub(super) struct HandheldPath {
    sweep: Sweep,
    /// Part of the sweep's curve that is travelled, `[0, 1]`.
    pub(super) reach: f64,
    /// Start and period of the sweep, seconds.
    start: f64,
    period: f64,
    tremor: Tremor,
    /// Rms angular rate of the shake about the x axis, rad/s.
    pub(super) shake: f64,
}

impl HandheldPath {
    /// A path that leaves at `start` and is back after `duration` (or every 14 s), without any shake yet.
    pub(super) fn new(sweep: Sweep, start: f64, duration: f64, seed: u64) -> Self {
        let period = duration.clamp(1.0, FULL_SWEEP_SECONDS);
        Self {
            sweep,
            reach: period / FULL_SWEEP_SECONDS,
            start,
            period,
            tremor: Tremor::new(seed),
            shake: 0.0,
        }
    }

    /// The same path with another shake.
    pub(super) fn with_shake(&self, shake: f64) -> Self {
        Self { shake, ..self.clone() }
    }

    /// `world_from_camera` at time `t` in seconds.
    pub(super) fn world_from_camera(&self, t: f64) -> RigidTransform {
        let phase = std::f64::consts::TAU * (t - self.start) / self.period;
        let share = self.reach * 0.5 * (1.0 - cos(phase));
        let steady = look_at(&bezier(&self.sweep.eye, share), &bezier(&self.sweep.target, share));
        let axis = |axis: usize| self.shake * self.tremor.at(axis, t);
        let shaken = RigidTransform::new(
            so3::exp(&Vector3::new(axis(0), axis(1), axis(2))),
            Vector3::new(axis(3), axis(4), axis(5)),
        );
        steady.compose(&shaken)
    }

    /// Angular velocity in the camera frame at time `t`, rad/s: what an ideal gyroscope at the camera measures.
    pub(super) fn angular_velocity(&self, t: f64) -> Vector3<f64> {
        // Central difference: its error is below 1e-7 of the rate at frequencies under 10 Hz.
        let h = 1e-5;
        let (before, after) = (self.world_from_camera(t - h), self.world_from_camera(t + h));
        so3::log(&(before.rotation.inverse() * after.rotation)) / (2.0 * h)
    }
}

fn bezier(points: &[[f64; 3]; 4], s: f64) -> Vector3<f64> {
    let r = 1.0 - s;
    let weights = [r * r * r, 3.0 * r * r * s, 3.0 * r * s * s, s * s * s];
    points.iter().zip(weights).map(|(p, w)| Vector3::from(*p) * w).sum()
}

/// Pose of a level camera (x right, y down, z forward) in a world with y up.
fn look_at(eye: &Vector3<f64>, target: &Vector3<f64>) -> RigidTransform {
    let forward = (target - eye).normalize();
    let right = forward.cross(&Vector3::y()).normalize();
    let down = forward.cross(&right);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[right, down, forward]));
    RigidTransform::new(UnitQuaternion::from_rotation_matrix(&rotation), *eye)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SWEEP: Sweep = Sweep {
        eye: [[0.0, 1.5, 0.0], [0.5, 1.5, 0.0], [1.0, 1.6, 0.2], [1.5, 1.5, 0.0]],
        target: [[0.0, 1.2, -3.0], [0.5, 1.2, -3.0], [1.0, 1.2, -3.0], [2.0, 1.2, -3.0]],
    };

    #[test]
    fn camera_axes_point_right_down_and_forward() {
        let pose = look_at(&Vector3::new(1.0, 1.5, 2.0), &Vector3::new(1.0, 1.5, -4.0));
        let axis = |v: Vector3<f64>| pose.rotation * v;
        assert!((axis(Vector3::x()) - Vector3::x()).norm() < 1e-12);
        assert!((axis(Vector3::y()) + Vector3::y()).norm() < 1e-12);
        assert!((axis(Vector3::z()) + Vector3::z()).norm() < 1e-12);
    }

    #[test]
    fn path_returns_to_its_start_and_stays_at_rest_without_reach_and_shake() {
        let mut path = HandheldPath::new(SWEEP, 0.1, 6.0, 1);
        let distance = |path: &HandheldPath, a: f64, b: f64| {
            path.world_from_camera(a).tangent_to(&path.world_from_camera(b)).norm()
        };
        assert!(distance(&path, 0.1, 6.1) < 1e-9);
        assert!(distance(&path, 0.1, 3.1) > 0.3);
        path.reach = 0.0;
        assert_eq!(distance(&path, 0.1, 2.7), 0.0);
    }

    #[test]
    fn shake_has_the_requested_rms_rate() {
        let mut path = HandheldPath::new(SWEEP, 0.0, 10.0, 5);
        path.reach = 0.0;
        path.shake = 0.7;
        let n = 20_000;
        let sum: Vector3<f64> = (0..n)
            .map(|k| path.angular_velocity(0.01 * f64::from(k)))
            .map(|rate| rate.component_mul(&rate))
            .sum();
        // The axes mix by the products of angles, a few per cent.
        let rms = (sum / f64::from(n)).map(f64::sqrt);
        assert!((rms.x - 0.7).abs() < 0.03 && (rms.y - 0.7).abs() < 0.03, "{rms}");
        assert!((rms.z - 0.42).abs() < 0.03, "{rms}");
    }
}
