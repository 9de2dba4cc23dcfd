//! How the camera moves around every frame, from the poses and exposures on both sides of it.
//!
//! A hand that shakes turns round within two or three frames: mid poses alone, 33 ms apart, do not show it. Mid poses and the
//! velocities within the exposures do. The motion is the polynomial through those of a frame and of its neighbours.

use mba_io::trajectory_file::TimedExposure;
use mba_tracker::ExpectedPath;
use mba_tracker::geometry::{RigidTransform, so3};
use nalgebra::{DMatrix, Vector3, Vector6};

/// Time to a neighbour, seconds, beyond which it says nothing about the frame.
const MAX_GAP: f64 = 0.25;

/// Standard deviations of what the polynomial says, as shares: of the velocity, for what exposure times and blur are wrong by,
/// and of the change of velocity and acceleration over a frame, for what a polynomial leaves out.
const SHARE_OF_VELOCITY: f64 = 0.05;
const SHARE_OF_CHANGE: f64 = 0.1;

/// One frame as the polynomial takes it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sighting {
    /// Mid exposure, seconds.
    pub(super) time: f64,
    /// Pose at mid exposure.
    pub(super) world_from_mid: RigidTransform,
    /// Velocity in the axes of the camera, per second: translation, rotation. `None` where nothing moved during the exposure.
    pub(super) velocity: Option<Vector6<f64>>,
}

impl Sighting {
    /// The frame of an exposure of `exposure_seconds`.
    pub(super) fn of(exposure: &TimedExposure, exposure_seconds: f64) -> Self {
        let motion = exposure.start.tangent_to(&exposure.end);
        let has_moved = exposure_seconds > 0.0 && motion != Vector6::zeros();
        let velocity = has_moved.then(|| {
            let velocity = motion / exposure_seconds;
            let translation = exposure.mid.rotation.inverse() * Vector3::from(velocity.fixed_rows::<3>(0));
            joined(&translation, &velocity.fixed_rows::<3>(3).into())
        });
        Self { time: exposure.timestamp, world_from_mid: exposure.mid, velocity }
    }
}

/// One thing that the polynomial has to agree with, at `time` in units of the time between frames: a place or a velocity.
struct Condition {
    time: f64,
    is_velocity: bool,
    value: Vector6<f64>,
}

/// The motion around `frame`, from `neighbours` on one side or both; `None` when they are too far away or too few.
pub(super) fn motion_around(frame: &Sighting, neighbours: [Option<&Sighting>; 2]) -> Option<ExpectedPath> {
    let near = |other: &&Sighting| (other.time - frame.time).abs() <= MAX_GAP;
    let neighbours: Vec<&Sighting> = neighbours.into_iter().flatten().filter(near).collect();
    let unit = neighbours.iter().map(|other| (other.time - frame.time).abs()).fold(0.0, f64::max);
    if unit <= 0.0 {
        return None;
    }
    let mut conditions: Vec<Condition> =
        neighbours.iter().flat_map(|other| conditions_of(frame, other, unit)).collect();
    let own =
        frame.velocity.map(|velocity| Condition { time: 0.0, is_velocity: true, value: velocity * unit });
    let is_between = neighbours.len() == 2;
    // Between two neighbours the frame's own exposure need not be believed, and what it says is measured anew. It is needed
    // for the change of acceleration, which the others hardly tell.
    let (derivatives, jerk) = if is_between {
        let without = derivatives(&conditions)?;
        conditions.extend(own);
        let with = derivatives(&conditions)?;
        (without, with.get(2).copied())
    } else {
        conditions.extend(own);
        let found = derivatives(&conditions)?;
        let jerk = found.get(2).copied();
        (found, jerk)
    };
    let derivative = |order: usize| derivatives.get(order).copied().unwrap_or_default();
    let (velocity, acceleration) = (derivative(0) / unit, derivative(1) / (unit * unit));
    let jerk = jerk.unwrap_or_default() / (unit * unit * unit);
    let size = |vector: &Vector6<f64>, group: usize| vector.fixed_rows::<3>(3 * group).norm();
    let change = |vector: &Vector6<f64>, group| SHARE_OF_CHANGE * unit * size(vector, group);
    Some(ExpectedPath {
        velocity,
        acceleration,
        jerk,
        velocity_sigma: [0, 1]
            .map(|group| SHARE_OF_VELOCITY * size(&velocity, group) + change(&acceleration, group)),
        acceleration_sigma: [0, 1]
            .map(|group| 2.0 * SHARE_OF_CHANGE * size(&acceleration, group) + 2.0 * change(&jerk, group)),
    })
}

/// What a neighbour tells: where it was and how fast, in the axes of the frame.
fn conditions_of(frame: &Sighting, other: &Sighting, unit: f64) -> Vec<Condition> {
    let frame_from_other = frame.world_from_mid.inverse().compose(&other.world_from_mid);
    let turn = so3::log(&frame_from_other.rotation);
    let time = (other.time - frame.time) / unit;
    let place = Condition { time, is_velocity: false, value: joined(&frame_from_other.translation, &turn) };
    let velocity = other.velocity.map(|velocity| {
        let translation = frame_from_other.rotation * Vector3::from(velocity.fixed_rows::<3>(0));
        // The derivative of the rotation vector, given the angular velocity in the turned camera.
        let rotation = so3::right_jacobian_inverse(&turn) * Vector3::from(velocity.fixed_rows::<3>(3));
        Condition { time, is_velocity: true, value: joined(&translation, &rotation) * unit }
    });
    [place].into_iter().chain(velocity).collect()
}

/// Derivatives at time 0, first to last, of the polynomial through the origin that agrees with all conditions.
fn derivatives(conditions: &[Condition]) -> Option<Vec<Vector6<f64>>> {
    let degree = conditions.len();
    let matrix = DMatrix::from_fn(degree, degree, |row, column| {
        let (power, condition) = (column as i32 + 1, &conditions[row]);
        if condition.is_velocity {
            f64::from(power) * condition.time.powi(power - 1)
        } else {
            condition.time.powi(power)
        }
    });
    let values = DMatrix::from_fn(degree, 6, |row, column| conditions[row].value[column]);
    let coefficients = matrix.lu().solve(&values)?;
    let mut factorial = 1.0;
    let derivative = |order: usize| {
        factorial *= order as f64 + 1.0;
        Vector6::from_fn(|i, _| coefficients[(order, i)] * factorial)
    };
    Some((0..degree).map(derivative).collect())
}

fn joined(translation: &Vector3<f64>, rotation: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(translation.x, translation.y, translation.z, rotation.x, rotation.y, rotation.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 1.0 / 30.0;

    /// Position and velocity of a camera whose acceleration changes: coefficients of time, its square and so on.
    const TERMS: [[f64; 6]; 4] = [
        [0.4, -0.2, 0.1, 0.0, 0.0, 0.9],
        [-3.0, 5.0, 1.0, 0.0, 0.0, -12.0],
        [40.0, 10.0, -70.0, 0.0, 0.0, 150.0],
        [300.0, -200.0, 100.0, 0.0, 0.0, -900.0],
    ];

    fn sighting(t: f64) -> Sighting {
        let term = |k: usize| Vector6::from(TERMS[k]);
        let place = (0..4).map(|k| term(k) * t.powi(k as i32 + 1)).sum::<Vector6<f64>>();
        let rate = (0..4).map(|k| term(k) * ((k as f64 + 1.0) * t.powi(k as i32))).sum::<Vector6<f64>>();
        // Rotation about one axis only: rotation vectors then add up.
        let world_from_mid = RigidTransform::identity().perturbed(&place);
        let translation = world_from_mid.rotation.inverse() * Vector3::from(rate.fixed_rows::<3>(0));
        let velocity = Some(joined(&translation, &rate.fixed_rows::<3>(3).into()));
        Sighting { time: t, world_from_mid, velocity }
    }

    #[test]
    fn a_motion_of_the_fourth_degree_is_found_exactly() {
        // At rest in the world's axes at time 0, where both are the same.
        let [before, now, after] = [-DT, 0.0, 0.8 * DT].map(sighting);
        let found = motion_around(&now, [Some(&before), Some(&after)]).unwrap();
        let expected = |k: usize, factorial: f64| Vector6::from(TERMS[k]) * factorial;
        assert!((found.velocity - expected(0, 1.0)).norm() < 1e-9, "{}", found.velocity);
        assert!((found.acceleration - expected(1, 2.0)).norm() < 1e-7, "{}", found.acceleration);
        assert!((found.jerk - expected(2, 6.0)).norm() < 1e-5, "{}", found.jerk);
    }

    #[test]
    fn the_velocity_owes_nothing_to_the_own_exposure() {
        let [before, mut now, after] = [-DT, 0.0, DT].map(sighting);
        now.velocity = now.velocity.map(|velocity| -velocity * 2.0);
        let found = motion_around(&now, [Some(&before), Some(&after)]).unwrap();
        assert!((found.velocity - Vector6::from(TERMS[0])).norm() < 1e-9);
    }

    #[test]
    fn at_an_end_the_own_exposure_helps_and_far_neighbours_do_not() {
        let [now, after, late] = [0.0, DT, 1.0].map(sighting);
        let found = motion_around(&now, [None, Some(&after)]).unwrap();
        assert!((found.velocity - Vector6::from(TERMS[0])).norm() < 1e-9, "it is one of the conditions");
        assert!(motion_around(&now, [None, Some(&late)]).is_none());
        assert!(motion_around(&now, [None, None]).is_none());
    }

    #[test]
    fn sharp_frames_have_no_velocity_but_their_places_do() {
        let [mut before, mut now, mut after] = [-DT, 0.0, DT].map(sighting);
        for frame in [&mut before, &mut now, &mut after] {
            frame.velocity = None;
        }
        let found = motion_around(&now, [Some(&before), Some(&after)]).unwrap();
        // The parabola through three points.
        let chord = before.world_from_mid.tangent_to(&after.world_from_mid) / (2.0 * DT);
        assert!((found.velocity - chord).fixed_rows::<3>(3).norm() < 1e-9);
        assert_eq!(found.jerk, Vector6::zeros());
    }
}
