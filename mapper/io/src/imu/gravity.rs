//! What an accelerometer says about the poses of a camera: which way is up, and how long a metre is.
//!
//! Poses that were found from pictures and depth are as long as the depth camera's metre, in a world that lies as its first
//! camera was held. The specific force that was felt, twice integrated with the orientations of the poses, is the same
//! path in true metres but for a start, a velocity, gravity and a bias, all of which enter linearly (as in Qin and Shen,
//! IROS 2017, without their limits on what is known):
//!
//! `metre * p_k = p_0 + v_0 t_k + g t_k^2 / 2 + D_k - B_k b`
//!
//! `D_k` is the double integral of the rotated force, `B_k` that of the rotation itself.

use mba_tracker::geometry::{RigidTransform, so3};
use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, UnitVector3, Vector3};

use super::ImuRecording;

/// Standard gravity, m/s^2, and how much it differs over the Earth.
const GRAVITY: f64 = 9.806_65;
const GRAVITY_SIGMA: f64 = 0.02;

/// Standard deviation of an accelerometer's bias, m/s^2.
const BIAS_SIGMA: f64 = 0.1;

/// Steps of integration between two poses: a hand shakes at up to 10 Hz, so that the force bends little within a step.
const STEPS: usize = 20;

/// Longest time between two poses, seconds.
const LONGEST_STEP: f64 = 0.11;

/// Fewest poses that tell more than the unknowns.
const MIN_POSES: usize = 12;

/// Rounds of weighting, and the multiple of the usual residual from which a pose counts less.
const ROUNDS: usize = 20;
const HUBER: f64 = 2.0;

/// Poses are not more accurate than this, metres.
const MIN_RESIDUAL: f64 = 1e-4;

/// Unknowns: metre, start, velocity, gravity, bias.
const UNKNOWNS: usize = 13;
const GRAVITY_AT: usize = 7;
const BIAS_AT: usize = 10;

/// What poses and accelerometer say together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InertialFit {
    /// True metres per metre of the poses.
    pub metre: f64,
    /// Its standard deviation.
    pub metre_sigma: f64,
    /// The direction against gravity, in the world of the poses.
    pub up: UnitVector3<f64>,
    /// Its standard deviation, radians.
    pub up_sigma: f64,
}

/// Fits `poses`, timestamps in seconds and `world_from_camera`, of increasing time and without long gaps, to what the
/// accelerometer felt meanwhile; a second or two of them, for biases and the errors of orientations add up. None where the
/// accelerometer does not cover them or nothing is told.
#[must_use]
pub fn inertial_fit(imu: &ImuRecording, poses: &[(f64, RigidTransform)]) -> Option<InertialFit> {
    if poses.len() < MIN_POSES {
        return None;
    }
    let integrals = Integrals::along(imu, poses)?;
    // Positions count from the first, so that the metre does not stretch what lies before it.
    let positions: Vec<Vector3<f64>> =
        poses.iter().map(|(_, pose)| pose.translation - poses[0].1.translation).collect();
    let mut solution = SVector::<f64, UNKNOWNS>::zeros();
    (solution[0], solution[GRAVITY_AT + 1]) = (1.0, -GRAVITY);
    let mut weights = vec![1.0; poses.len()];
    let mut covariance = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
    let mut attenuation = 0.0;
    for round in 0..ROUNDS {
        let (mut normal, mut right) = prior(&solution, round > 0);
        for (k, weight) in weights.iter().enumerate() {
            let rows = integrals.rows(k, &positions[k]);
            normal += rows.transpose() * rows * *weight;
            right += rows.transpose() * integrals.force[k] * *weight;
        }
        covariance = normal.try_inverse()?;
        solution = covariance * right;
        let residual = residual_power(&integrals, &positions, &solution, &weights);
        // What the positions explain besides everything else.
        let explained = solution[0] * solution[0] / covariance[(0, 0)];
        attenuation = residual / (residual + explained);
        weights = reweighted(&integrals, &positions, &solution);
    }
    let gravity = Vector3::from(solution.fixed_rows::<3>(GRAVITY_AT));
    let up = UnitVector3::try_new(-gravity, 0.5 * GRAVITY)?;
    let across = covariance.fixed_view::<3, 3>(GRAVITY_AT, GRAVITY_AT).trace();
    let fit = InertialFit {
        metre: solution[0],
        // Errors of the positions make the metre too short by this share, those of the force do not; which they are, nobody
        // knows.
        metre_sigma: covariance[(0, 0)].sqrt().hypot(attenuation),
        up,
        up_sigma: across.sqrt() / GRAVITY,
    };
    (fit.metre.is_finite() && fit.metre > 0.0 && fit.up_sigma.is_finite()).then_some(fit)
}

/// What is known beforehand: the size of a bias, and, once its direction is, that of gravity.
fn prior(
    solution: &SVector<f64, UNKNOWNS>,
    gravity_is_known: bool,
) -> (SMatrix<f64, UNKNOWNS, UNKNOWNS>, SVector<f64, UNKNOWNS>) {
    let (mut normal, mut right) = (SMatrix::zeros(), SVector::zeros());
    for k in BIAS_AT..UNKNOWNS {
        normal[(k, k)] = 1.0 / (BIAS_SIGMA * BIAS_SIGMA);
    }
    let gravity = Vector3::from(solution.fixed_rows::<3>(GRAVITY_AT));
    if gravity_is_known && gravity.norm() > 0.0 {
        let mut row = SVector::<f64, UNKNOWNS>::zeros();
        row.fixed_rows_mut::<3>(GRAVITY_AT).copy_from(&(gravity.normalize() / GRAVITY_SIGMA));
        normal += row * row.transpose();
        right += row * (GRAVITY / GRAVITY_SIGMA);
    }
    (normal, right)
}

/// Sum of the weighted squares of what is missed.
fn residual_power(
    integrals: &Integrals,
    positions: &[Vector3<f64>],
    solution: &SVector<f64, UNKNOWNS>,
    weights: &[f64],
) -> f64 {
    let missed = |k: usize| (integrals.rows(k, &positions[k]) * solution - integrals.force[k]).norm_squared();
    weights.iter().enumerate().map(|(k, weight)| weight * missed(k)).sum()
}

/// Weight of each pose: that of its usual residual, less for those that lie farther off.
fn reweighted(
    integrals: &Integrals,
    positions: &[Vector3<f64>],
    solution: &SVector<f64, UNKNOWNS>,
) -> Vec<f64> {
    let residual = |(k, position): (usize, &Vector3<f64>)| {
        (integrals.rows(k, position) * solution - integrals.force[k]).norm()
    };
    let residuals: Vec<f64> = positions.iter().enumerate().map(residual).collect();
    let mut sorted = residuals.clone();
    sorted.sort_by(f64::total_cmp);
    // The length of three independent errors has a median of 1.54 standard deviations.
    let sigma = (sorted[sorted.len() / 2] / 1.54).max(MIN_RESIDUAL);
    let weight = |residual: &f64| (HUBER * sigma / residual).min(1.0) / (sigma * sigma);
    residuals.iter().map(weight).collect()
}

/// Double integrals up to each pose, with the orientations of the poses.
struct Integrals {
    /// Seconds since the first pose.
    time: Vec<f64>,
    /// Of the specific force in the world, metres.
    force: Vec<Vector3<f64>>,
    /// Of `world_from_camera`, square seconds.
    rotation: Vec<Matrix3<f64>>,
}

impl Integrals {
    fn along(imu: &ImuRecording, poses: &[(f64, RigidTransform)]) -> Option<Self> {
        let count = poses.len();
        let mut integrals = Self {
            time: poses.iter().map(|(time, _)| time - poses[0].0).collect(),
            force: Vec::with_capacity(count),
            rotation: Vec::with_capacity(count),
        };
        // Position and velocity of a camera that starts at rest and feels the force alone.
        let (mut position, mut velocity) = (Vector3::zeros(), Vector3::zeros());
        let (mut turned, mut turning) = (Matrix3::zeros(), Matrix3::zeros());
        integrals.force.push(position);
        integrals.rotation.push(turned);
        for pair in poses.windows(2) {
            let [(from, start), (to, end)] = [pair[0], pair[1]];
            let step = (to - from) / STEPS as f64;
            if !(step > 0.0 && to - from <= LONGEST_STEP) {
                return None;
            }
            let path = Orientations::between(imu, (from, start.rotation), (to, end.rotation));
            for k in 0..STEPS {
                let [begin, finish] = [k, k + 1].map(|k| from + k as f64 * step);
                let orientation = path.at(imu, begin + 0.5 * step).to_rotation_matrix();
                let force = orientation * imu.mean_specific_force(begin, finish)?;
                position += velocity * step + force * (0.5 * step * step);
                velocity += force * step;
                let orientation = orientation.matrix();
                turned += turning * step + orientation * (0.5 * step * step);
                turning += orientation * step;
            }
            integrals.force.push(position);
            integrals.rotation.push(turned);
        }
        Some(integrals)
    }

    /// The three equations of a pose: coefficients of the unknowns, whose right side is the integral of the force.
    fn rows(&self, pose: usize, position: &Vector3<f64>) -> SMatrix<f64, 3, UNKNOWNS> {
        let time = self.time[pose];
        let mut rows = SMatrix::<f64, 3, UNKNOWNS>::zeros();
        rows.fixed_view_mut::<3, 1>(0, 0).copy_from(position);
        rows.fixed_view_mut::<3, 3>(0, 1).copy_from(&-Matrix3::identity());
        rows.fixed_view_mut::<3, 3>(0, 4).copy_from(&(Matrix3::identity() * -time));
        rows.fixed_view_mut::<3, 3>(0, GRAVITY_AT).copy_from(&(Matrix3::identity() * (-0.5 * time * time)));
        rows.fixed_view_mut::<3, 3>(0, BIAS_AT).copy_from(&self.rotation[pose]);
        rows
    }
}

/// How a camera turned between two poses: as its gyroscope says, with what that misses at the end spread evenly; evenly
/// where there is no gyroscope.
struct Orientations {
    from: f64,
    duration: f64,
    start: UnitQuaternion<f64>,
    has_gyroscope: bool,
    /// Rotation vector by which the end is missed.
    missed: Vector3<f64>,
}

impl Orientations {
    fn between(
        imu: &ImuRecording,
        (from, start): (f64, UnitQuaternion<f64>),
        (to, end): (f64, UnitQuaternion<f64>),
    ) -> Self {
        let measured = imu.rotation_between(from, to);
        let reached = start * measured.unwrap_or_else(UnitQuaternion::identity);
        let missed = so3::log(&(reached.inverse() * end));
        Self { from, duration: to - from, start, has_gyroscope: measured.is_some(), missed }
    }

    fn at(&self, imu: &ImuRecording, time: f64) -> UnitQuaternion<f64> {
        let measured = if self.has_gyroscope { imu.rotation_between(self.from, time) } else { None };
        let share = (time - self.from) / self.duration;
        self.start * measured.unwrap_or_else(UnitQuaternion::identity) * so3::exp(&(self.missed * share))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::imu::TimedVector;

    /// Orientation and position of a shaken camera, in a world whose y axis is up.
    fn pose(time: f64) -> RigidTransform {
        let turn = Vector3::new(0.3 * (9.0 * time).sin(), 0.4 * (7.0 * time).cos(), 0.2 * (5.0 * time).sin());
        let position = Vector3::new(
            0.08 * (14.0 * time).sin(),
            0.06 * (11.0 * time).cos(),
            0.5 * time + 0.05 * (17.0 * time).sin(),
        );
        RigidTransform::new(so3::exp(&turn), position)
    }

    /// What an ideal IMU measures along the path, 400 times a second, by central differences.
    fn recording(bias: Vector3<f64>) -> ImuRecording {
        const STEP: f64 = 1e-4;
        let (mut rates, mut forces) = (Vec::new(), Vec::new());
        for k in 0..=800 {
            let time = f64::from(k) / 400.0;
            let [before, now, after] = [time - STEP, time, time + STEP].map(pose);
            let acceleration =
                (after.translation - now.translation * 2.0 + before.translation) / (STEP * STEP);
            let felt = now.rotation.inverse() * (acceleration + Vector3::y() * GRAVITY) + bias;
            let rate = so3::log(&(before.rotation.inverse() * after.rotation)) / (2.0 * STEP);
            rates.push(TimedVector { time, value: rate });
            forces.push(TimedVector { time, value: felt });
        }
        ImuRecording::new(rates, forces)
    }

    /// Poses of a depth camera whose metre is `1 / metre` long, 30 a second, with an error of a millimetre to and fro.
    fn poses(metre: f64) -> Vec<(f64, RigidTransform)> {
        let seen = |k: i32| {
            let time = 0.1 + f64::from(k) / 30.0;
            let exact = pose(time);
            let error =
                Vector3::new(f64::from(k * 7 % 5 - 2), f64::from(k * 3 % 5 - 2), f64::from(k * 11 % 5 - 2));
            let position = exact.translation / metre + error * 7e-4;
            (time, RigidTransform::new(exact.rotation, position))
        };
        (0..48).map(seen).collect()
    }

    #[test]
    fn metre_and_up_are_found_in_spite_of_a_bias() {
        let imu = recording(Vector3::new(0.05, -0.03, 0.04));
        for metre in [0.98, 1.0, 1.03] {
            let fit = inertial_fit(&imu, &poses(metre)).unwrap();
            assert!((fit.metre / metre - 1.0).abs() < 0.004, "{fit:?} of {metre}");
            assert!((fit.metre / metre - 1.0).abs() < 3.0 * fit.metre_sigma, "{fit:?} of {metre}");
            assert!(fit.up.angle(&Vector3::y_axis()) < 0.01, "{fit:?}");
        }
    }

    #[test]
    fn a_sensor_that_felt_another_motion_measures_no_metre() {
        let mut imu = recording(Vector3::zeros());
        let elsewhere = recording(Vector3::zeros());
        // The forces of the path played backwards.
        let last = elsewhere.specific_forces().len() - 1;
        let forces = (0..=last)
            .map(|k| TimedVector {
                time: elsewhere.specific_forces()[k].time,
                value: elsewhere.specific_forces()[last - k].value,
            })
            .collect();
        imu = ImuRecording::new(imu.angular_velocities().to_vec(), forces);
        if let Some(fit) = inertial_fit(&imu, &poses(1.0)) {
            assert!(fit.metre_sigma > 0.3, "{fit:?}");
        }
    }

    #[test]
    fn one_wrong_pose_changes_little() {
        let imu = recording(Vector3::zeros());
        let mut poses = poses(1.0);
        poses[20].1.translation.x += 0.1;
        let fit = inertial_fit(&imu, &poses).unwrap();
        assert!((fit.metre - 1.0).abs() < 0.005, "{fit:?}");
    }

    #[test]
    fn without_a_gyroscope_the_poses_tell_the_turn() {
        let imu = recording(Vector3::zeros());
        let deaf = ImuRecording::new(Vec::new(), imu.specific_forces().to_vec());
        let fit = inertial_fit(&deaf, &poses(1.0)).unwrap();
        assert!((fit.metre - 1.0).abs() < 0.02, "{fit:?}");
        assert!(fit.up.angle(&Vector3::y_axis()) < 0.02, "{fit:?}");
    }

    #[test]
    fn nothing_is_told_without_an_accelerometer_or_over_a_gap() {
        let imu = recording(Vector3::zeros());
        let deaf = ImuRecording::new(imu.angular_velocities().to_vec(), Vec::new());
        assert_eq!(inertial_fit(&deaf, &poses(1.0)), None);
        let mut poses = poses(1.0);
        assert_eq!(inertial_fit(&imu, &poses[..8]), None, "too few");
        poses.drain(10..20);
        assert_eq!(inertial_fit(&imu, &poses), None, "a gap");
    }
}
