//! Linear motion plus a parabola and a cubic, and when the rows of a frame were exposed along it.

use nalgebra::{Matrix3, Vector3, Vector6};

use super::ExposureTrajectory;
use crate::geometry::{RigidTransform, so3};

/// A path with acceleration: the linear motion of an [`ExposureTrajectory`] plus a parabola and a cubic that are zero in its
/// middle.
///
/// With `d = s - 1/2`, translation gets `d^2 bow_t + d^3 jerk_t` in the reference frame, and rotation the factor
/// `exp(d^2 bow_r + d^3 jerk_r)` from the right. Rows that are exposed one after the other see the path far outside of one
/// exposure, where a hand's acceleration moves the image by several pixels, and a change of the acceleration by one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BowedTrajectory {
    /// `reference_from_camera` at s = 0 and s = 1 of the linear motion.
    pub linear: ExposureTrajectory,
    /// (translation in the reference frame in metres, rotation in the camera in radians) per square of s.
    pub bow: Vector6<f64>,
    /// The same per cube of s.
    pub jerk: Vector6<f64>,
}

/// A path at one time.
#[derive(Clone, Copy, Debug)]
pub struct PathPoint {
    /// See [`BowedTrajectory::at`].
    pub pose: RigidTransform,
    /// See [`ExposureTrajectory::rotation_blend_left`].
    pub rotation_blend_left: Matrix3<f64>,
    /// See [`BowedTrajectory::bow_blend_left`].
    pub bow_blend_left: Matrix3<f64>,
    /// See [`BowedTrajectory::velocity_left`].
    pub velocity_left: Vector6<f64>,
}

impl BowedTrajectory {
    /// The path without acceleration.
    #[must_use]
    pub fn without_bow(linear: ExposureTrajectory) -> Self {
        Self { linear, bow: Vector6::zeros(), jerk: Vector6::zeros() }
    }

    /// The path through the poses at s = 0, 1/2 and 1.
    #[must_use]
    pub fn through(start: &RigidTransform, mid: &RigidTransform, end: &RigidTransform) -> Self {
        let before = mid.tangent_to(start);
        let after = mid.tangent_to(end);
        // A quarter of the bow is what both ends have in common. Turns do not commute, so that it is found in rounds; the
        // error falls by the square of the angle in each.
        let mut quarter = (before + after) * 0.5;
        let mut linear = ExposureTrajectory { start: *start, end: *end };
        for _ in 0..4 {
            linear = ExposureTrajectory { start: start.perturbed(&-quarter), end: end.perturbed(&-quarter) };
            quarter -= linear.mid().tangent_to(mid);
        }
        Self { linear, bow: quarter * 4.0, jerk: Vector6::zeros() }
    }

    /// `reference_from_camera` at normalised time `s`, also outside of `[0, 1]`.
    #[must_use]
    pub fn at(&self, s: f64) -> RigidTransform {
        let linear = self.linear.at(s);
        if self.is_bent() { linear.perturbed(&self.bend(s)) } else { linear }
    }

    /// The matrix C with `phi_s = C dr` for a change `dr` of the rotational bow, where `phi_s` is a left rotation, without
    /// its factor `(s - 1/2)^2`.
    #[must_use]
    pub fn bow_blend_left(&self, s: f64) -> Matrix3<f64> {
        self.point(s, &self.linear.rotation_vector()).bow_blend_left
    }

    /// Velocity at `s` per unit of s: translation in the reference frame, left rotation.
    #[must_use]
    pub fn velocity_left(&self, s: f64) -> Vector6<f64> {
        self.point(s, &self.linear.rotation_vector()).velocity_left
    }

    /// All that is known of the path at `s`, for the rotation vector `omega` of its linear motion, which many times share.
    #[must_use]
    pub fn point(&self, s: f64, omega: &Vector3<f64>) -> PathPoint {
        let linear = self.linear.at_turned(s, omega);
        let d = s - 0.5;
        let slope = self.bow * (2.0 * d) + self.jerk * (3.0 * d * d);
        let shift = self.linear.end.translation - self.linear.start.translation + slope.fixed_rows::<3>(0);
        let bend = self.bend(s);
        let bow_blend_left =
            linear.rotation_matrix() * so3::right_jacobian(&-Vector3::from(bend.fixed_rows::<3>(3)));
        let slope_turn = Vector3::from(slope.fixed_rows::<3>(3));
        // A turn about an axis that stays turns about it at every time.
        let axis_stays = self.jerk == Vector6::zeros();
        let bent_turn = if axis_stays { linear.rotation * slope_turn } else { bow_blend_left * slope_turn };
        let turn = self.linear.start.rotation * omega + bent_turn;
        PathPoint {
            pose: if self.is_bent() { linear.perturbed(&bend) } else { linear },
            rotation_blend_left: self.linear.rotation_blend_left_turned(s, omega),
            bow_blend_left,
            velocity_left: Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z),
        }
    }

    /// The linear motion between the poses at `from` and `to`.
    #[must_use]
    pub fn between(&self, from: f64, to: f64) -> ExposureTrajectory {
        ExposureTrajectory { start: self.at(from), end: self.at(to) }
    }

    /// The path seen from another reference frame.
    #[must_use]
    pub fn seen_from(&self, other_from_reference: &RigidTransform) -> Self {
        let turned = |bend: &Vector6<f64>| {
            let mut turned = *bend;
            let shift = other_from_reference.rotation * Vector3::from(bend.fixed_rows::<3>(0));
            turned.fixed_rows_mut::<3>(0).copy_from(&shift);
            turned
        };
        let linear = self.linear.seen_from(other_from_reference);
        Self { linear, bow: turned(&self.bow), jerk: turned(&self.jerk) }
    }

    fn is_bent(&self) -> bool {
        self.bow != Vector6::zeros() || self.jerk != Vector6::zeros()
    }

    /// What the path has at `s` beyond linear motion.
    fn bend(&self, s: f64) -> Vector6<f64> {
        let d = s - 0.5;
        self.bow * (d * d) + self.jerk * (d * d * d)
    }
}

/// When the parts of a frame are exposed, in units of the time that its path spans and relative to the middle of the
/// colour image's exposure.
///
/// Row `v` of `h` is exposed for `exposure` around `((v + 1/2)/h - 1/2) readout`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameTiming {
    /// Time that the shutter is open.
    pub exposure: f64,
    /// Time from the first row of the colour image to the last; negative when the last row comes first, 0 for a global
    /// shutter.
    pub readout: f64,
    /// Bands of rows that share their virtual views; 1 for a global shutter.
    pub bands: usize,
    /// Time of the depth map's middle row.
    pub depth_time: f64,
    /// Time from the first row of the depth map to the last.
    pub depth_readout: f64,
}

impl FrameTiming {
    /// All pixels at the same time, for the whole of the path.
    pub const GLOBAL: Self =
        Self { exposure: 1.0, readout: 0.0, bands: 1, depth_time: 0.0, depth_readout: 0.0 };

    /// Whether the rows of the colour image are exposed one after the other.
    #[must_use]
    #[inline]
    pub fn is_rolling(&self) -> bool {
        self.readout != 0.0
    }

    /// Whether the path matters beyond the exposure itself, so that its acceleration has to be known.
    #[must_use]
    pub fn reaches_outside(&self) -> bool {
        self.readout != 0.0 || self.depth_time != 0.0 || self.depth_readout != 0.0
    }

    /// Normalised time `s` of the middle of the exposure of row `v` (may be fractional) of `height`.
    #[must_use]
    #[inline]
    pub fn row_time(&self, v: f64, height: usize) -> f64 {
        0.5 + self.readout * row_share(v, height)
    }

    /// Normalised time `s` of row `v` of `height` of the depth map.
    #[must_use]
    #[inline]
    pub fn depth_row_time(&self, v: f64, height: usize) -> f64 {
        0.5 + self.depth_time + self.depth_readout * row_share(v, height)
    }
}

/// Where row `v` lies between the first (-1/2) and the last.
fn row_share(v: f64, height: usize) -> f64 {
    (v + 0.5) / height as f64 - 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path() -> BowedTrajectory {
        let start = RigidTransform::identity().perturbed(&Vector6::new(0.3, -0.2, 0.5, 0.4, -0.3, 0.2));
        let end = start.perturbed(&Vector6::new(0.02, 0.01, -0.03, 0.05, -0.08, 0.03));
        let bow = Vector6::new(0.03, -0.02, 0.01, -0.06, 0.05, 0.04);
        let jerk = Vector6::new(0.01, 0.02, -0.03, 0.02, -0.07, 0.03);
        BowedTrajectory { linear: ExposureTrajectory { start, end }, bow, jerk }
    }

    fn left_tangent(from: &RigidTransform, to: &RigidTransform) -> Vector6<f64> {
        let shift = to.translation - from.translation;
        let turn = so3::log(&(to.rotation * from.rotation.inverse()));
        Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
    }

    #[test]
    fn derivatives_are_those_of_finite_differences() {
        const STEP: f64 = 1e-6;
        let path = path();
        for s in [-0.7, 0.0, 0.5, 0.8, 1.6] {
            let velocity = left_tangent(&path.at(s - STEP), &path.at(s + STEP)) / (2.0 * STEP);
            assert!((velocity - path.velocity_left(s)).norm() < 1e-8, "at {s}: {velocity}");
            for axis in 0..3 {
                let bent = |step: f64| {
                    let mut bent = path;
                    bent.bow[3 + axis] += step;
                    bent.at(s)
                };
                let jacobian_bow = left_tangent(&bent(-STEP), &bent(STEP)).fixed_rows::<3>(3) / (2.0 * STEP);
                let expected = path.bow_blend_left(s).column(axis) * (s - 0.5) * (s - 0.5);
                assert!((jacobian_bow - expected).norm() < 1e-8, "axis {axis} at {s}");
            }
        }
    }

    #[test]
    fn the_bow_is_zero_in_the_middle_and_another_frame_sees_the_same_path() {
        let path = path();
        assert!(path.at(0.5).tangent_to(&path.linear.mid()).norm() < 1e-12);
        let other = RigidTransform::identity().perturbed(&Vector6::new(1.0, -2.0, 0.5, 1.1, 0.4, -0.6));
        for s in [-0.5, 0.2, 1.3] {
            let expected = other.compose(&path.at(s));
            assert!(path.seen_from(&other).at(s).tangent_to(&expected).norm() < 1e-12);
        }
    }

    #[test]
    fn three_poses_define_the_path() {
        let path = BowedTrajectory { jerk: Vector6::zeros(), ..path() };
        let found = BowedTrajectory::through(&path.at(0.0), &path.at(0.5), &path.at(1.0));
        for s in [-0.8, 0.3, 1.9] {
            let error = found.at(s).tangent_to(&path.at(s)).norm();
            assert!(error < 1e-9, "at {s}: {error}");
        }
    }

    #[test]
    fn rows_run_from_the_first_to_the_last_around_the_middle() {
        let timing =
            FrameTiming { readout: 0.6, depth_time: 0.3, depth_readout: -0.2, ..FrameTiming::GLOBAL };
        // Rows 0 and 479 of 480 lie 479/480 of the readout apart, symmetric about the middle.
        assert!(
            (timing.row_time(479.0, 480) - timing.row_time(0.0, 480) - 0.6 * 479.0 / 480.0).abs() < 1e-12
        );
        assert!((timing.row_time(239.5, 480) - 0.5).abs() < 1e-12);
        assert!((timing.depth_row_time(0.0, 120) - (0.8 + 0.1 * 119.0 / 120.0)).abs() < 1e-12);
    }
}
