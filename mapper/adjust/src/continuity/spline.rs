//! Uniform cubic B-splines of position and rotation.

use mba_tracker::geometry::{RigidTransform, so3};
use mba_tracker::trajectory::ExposureTrajectory;
use nalgebra::{UnitQuaternion, Vector3};

/// Where in the exposure the straight line fitted to a parabola meets it (Gauss points): a blurred image shows the
/// straight motion, which misses the ends of a curved one.
pub(super) const MEETING_POINTS: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

/// The times of the meeting points between opening and closing.
pub(super) fn meeting_times([opening, closing]: [f64; 2]) -> [f64; 2] {
    MEETING_POINTS.map(|s| opening + s * (closing - opening))
}

/// Control points at equal steps of time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Knots {
    start: f64,
    /// Seconds between control points.
    pub(super) step: f64,
    /// Number of control points, at least 4.
    pub(super) count: usize,
}

/// The four control points that decide about one instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Support {
    pub(super) first: usize,
    pub(super) weights: [f64; 4],
}

impl Knots {
    /// Control points for the time from `start` to `end` (above `start`), at most `step` seconds apart.
    pub(super) fn over([start, end]: [f64; 2], step: f64) -> Self {
        let pieces = ((end - start) / step).ceil().max(1.0);
        Self { start, step: (end - start) / pieces, count: pieces as usize + 3 }
    }

    /// The instant that control point `k` belongs to.
    pub(super) fn time(&self, k: usize) -> f64 {
        self.start + (k as f64 - 1.0) * self.step
    }

    /// Support and weights of `time`; outside of the knots the nearest piece is continued.
    pub(super) fn support(&self, time: f64) -> Support {
        let position = (time - self.start) / self.step;
        let piece = position.floor().clamp(0.0, (self.count - 4) as f64);
        let u = position - piece;
        let v = 1.0 - u;
        let weights = [
            v * v * v / 6.0,
            (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0,
            (3.0 * v * v * v - 6.0 * v * v + 4.0) / 6.0,
            u * u * u / 6.0,
        ];
        Support { first: piece as usize, weights }
    }
}

/// A camera path: a B-spline of positions, and a cumulative B-spline of rotations (Kim, Kim and Shin 1995).
#[derive(Clone, Debug)]
pub(super) struct Path {
    pub(super) knots: Knots,
    /// Control points, `world_from_camera`.
    pub(super) controls: Vec<RigidTransform>,
}

impl Path {
    /// `world_from_camera` at `time`.
    pub(super) fn at(&self, time: f64) -> RigidTransform {
        let Support { first, weights: [_, w1, w2, w3] } = self.knots.support(time);
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| self.controls[first + k]);
        let w0 = 1.0 - w1 - w2 - w3;
        let step = |from: &RigidTransform, to: &RigidTransform, share: f64| {
            so3::exp(&(turn_between(&from.rotation, &to.rotation) * share))
        };
        let rotation = step(&c, &d, w3) * step(&b, &c, w2 + w3) * step(&a, &b, w1 + w2 + w3) * a.rotation;
        RigidTransform {
            rotation: so3::renormalised(&rotation),
            translation: a.translation * w0 + b.translation * w1 + c.translation * w2 + d.translation * w3,
        }
    }

    /// The straight exposure that the path looks like between the times of opening and closing.
    pub(super) fn exposure(&self, shutter: [f64; 2]) -> ExposureTrajectory {
        let [start, end] = meeting_times(shutter).map(|time| self.at(time));
        let meeting = ExposureTrajectory { start, end };
        let [first, last] = MEETING_POINTS;
        let stretched = |s: f64| meeting.at((s - first) / (last - first));
        ExposureTrajectory { start: stretched(0.0), end: stretched(1.0) }
    }

    /// Steps from each control point to the next as world vectors.
    pub(super) fn steps(&self, part: Part) -> Vec<Vector3<f64>> {
        self.controls.windows(2).map(|pair| part.step(&pair[0], &pair[1])).collect()
    }

    /// Moves every control point by its increment, a world vector, and returns the length of the largest.
    pub(super) fn advance(&mut self, part: Part, increments: &[Vector3<f64>]) -> f64 {
        for (control, increment) in self.controls.iter_mut().zip(increments) {
            match part {
                Part::Translation => control.translation += increment,
                Part::Rotation => {
                    control.rotation = so3::renormalised(&(so3::exp(increment) * control.rotation));
                }
            }
        }
        increments.iter().map(Vector3::norm).fold(0.0, f64::max)
    }
}

/// The half of a pose that a problem is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Translation,
    Rotation,
}

impl Part {
    pub(super) const BOTH: [Self; 2] = [Self::Translation, Self::Rotation];

    /// From one pose to another as a world vector, metres or radians.
    pub(super) fn step(self, from: &RigidTransform, to: &RigidTransform) -> Vector3<f64> {
        match self {
            Self::Translation => to.translation - from.translation,
            Self::Rotation => turn_between(&from.rotation, &to.rotation),
        }
    }
}

/// The rotation vector, in world axes, that takes `from` to `to`.
fn turn_between(from: &UnitQuaternion<f64>, to: &UnitQuaternion<f64>) -> Vector3<f64> {
    so3::log(&(to * from.inverse()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_screw_of_constant_speed_is_reproduced() {
        let knots = Knots::over([2.0, 3.0], 0.3);
        assert_eq!(knots.count, 7);
        let speed = Vector3::new(0.3, -0.2, 0.5);
        let turn = Vector3::new(1.0, 0.4, -0.8);
        let pose = |time: f64| RigidTransform::new(so3::exp(&(turn * time)), speed * time);
        let path = Path { knots, controls: (0..knots.count).map(|k| pose(knots.time(k))).collect() };
        for time in [2.0, 2.1, 2.49, 2.5, 3.0] {
            assert!(path.at(time).tangent_to(&pose(time)).norm() < 1e-12, "{time}");
        }
    }

    #[test]
    fn weights_reproduce_a_parabola_up_to_its_known_offset() {
        // Sampling x² at the control points gives x² + step²/3.
        let knots = Knots::over([0.0, 1.0], 0.25);
        for time in [0.0, 0.33, 0.77, 1.0] {
            let s = knots.support(time);
            let value: f64 = (0..4).map(|k| s.weights[k] * knots.time(s.first + k).powi(2)).sum();
            assert!((value - time * time - 0.0625 / 3.0).abs() < 1e-14);
        }
    }
}
