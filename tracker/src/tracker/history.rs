//! What the tracker remembers of the motion.

use nalgebra::Vector6;

use super::frame::GyroReading;
use crate::align::{FollowsCentre, MotionPrior};
use crate::geometry::{PinholeCamera, RigidTransform};

/// The last tracked frame and how it was moving. Motions are (translation in the frame that the pose refers to,
/// rotation in the camera), per second.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    pub(super) timestamp: f64,
    /// Pose at mid exposure.
    pub(super) reference_from_mid: RigidTransform,
    /// Motion from the frame before.
    pub(super) between_frames: Vector6<f64>,
    /// Time since the frame before, seconds; infinite while there is none.
    pub(super) interval: f64,
    /// Exposure time, seconds.
    pub(super) exposure: f64,
    /// Motion during the exposure; `None` while it is unknown.
    pub(super) within_exposure: Option<Vector6<f64>>,
    /// Acceleration during the exposure, per square second; zero where it is not estimated.
    pub(super) acceleration: Vector6<f64>,
}

/// Gap in seconds beyond which the motion before says nothing about the motion after.
const MAX_GAP: f64 = 0.25;

/// Standard deviation of the expected blur in pixels when the camera stands still.
pub(super) const FLOOR_PIXELS: f64 = 0.5;

/// The same for the bow, as a multiple: where a path of one unit ends, a quarter of the bow is seen.
const BOW_FLOOR: f64 = 4.0;

/// Accelerations of a violently shaken hand, m/s^2 and rad/s^2.
const MAX_ACCELERATION: f64 = 100.0;
const MAX_ANGULAR_ACCELERATION: f64 = 500.0;

/// Speeds beyond which a hand-held or flying camera's pose is a mistake, m/s and rad/s.
const MAX_SPEED: f64 = 8.0;
const MAX_ANGULAR_SPEED: f64 = 15.0;

/// Change of the pose against steady motion beyond which it is a mistake: a change by so many times the acceleration of a
/// violently shaken hand, and what poses are wrong by, metres and radians, which counts where frames follow fast.
const ACCELERATION_MARGINS: [f64; 2] = [2.0, 1.0];
const POSE_ERROR: f64 = 0.03;

/// Standard deviations of a gyroscope's rate: what is left of its bias and noise, rad/s, and a share of the rate for its
/// scale and its time.
const GYRO_SIGMA: f64 = 0.05;
const GYRO_SCALE_SIGMA: f64 = 0.05;

/// Share of the parabola that samples of a gyroscope at both ends leave open.
const GYRO_BOW_SHARE: f64 = 0.3;

/// How far the motion within an exposure may correct the velocity that the mid poses around it give, as a share of the
/// change of the mean velocity between them.
const EXPOSURE_TRUST: f64 = 0.5;

impl Motion {
    /// A camera at rest.
    pub(super) fn still(timestamp: f64, reference_from_mid: RigidTransform) -> Self {
        Self {
            timestamp,
            reference_from_mid,
            between_frames: Vector6::zeros(),
            interval: f64::INFINITY,
            exposure: 0.0,
            within_exposure: None,
            acceleration: Vector6::zeros(),
        }
    }

    /// The same motion seen from another reference frame.
    pub(super) fn seen_from(&self, other_from_reference: &RigidTransform) -> Self {
        Self {
            reference_from_mid: other_from_reference.compose(&self.reference_from_mid),
            between_frames: rotated(other_from_reference, &self.between_frames),
            within_exposure: self.within_exposure.map(|rate| rotated(other_from_reference, &rate)),
            acceleration: rotated(other_from_reference, &self.acceleration),
            ..*self
        }
    }

    /// Whether a hand can have brought the camera to this pose at `timestamp`: neither speed nor acceleration are impossible.
    pub(super) fn can_reach(&self, reference_from_mid: &RigidTransform, timestamp: f64) -> bool {
        let dt = timestamp - self.timestamp;
        let rate = self.reference_from_mid.tangent_to(reference_from_mid) / dt;
        let length = |motion: &Vector6<f64>, group: usize| motion.fixed_rows::<3>(group).norm();
        let is_slow = length(&rate, 0) < MAX_SPEED && length(&rate, 3) < MAX_ANGULAR_SPEED;
        if dt > MAX_GAP || self.interval > MAX_GAP {
            return is_slow;
        }
        // Velocities are means over the intervals before and after the last frame, whose middles are that far apart.
        let between_middles = 0.5 * (dt + self.interval);
        let change = (rate - self.between_frames) * dt;
        let limits = [MAX_ACCELERATION, MAX_ANGULAR_ACCELERATION];
        let is_steady = (0..2).all(|kind| {
            let possible = ACCELERATION_MARGINS[kind] * limits[kind] * between_middles * dt;
            length(&change, 3 * kind) < possible + POSE_ERROR
        });
        is_slow && is_steady
    }

    /// Pose after `dt` seconds at `rate`.
    pub(super) fn extrapolate(&self, rate: &Vector6<f64>, dt: f64) -> RigidTransform {
        if dt > MAX_GAP { self.reference_from_mid } else { self.reference_from_mid.perturbed(&(rate * dt)) }
    }

    /// Belief about the path of a frame at time `timestamp` whose mid pose is `reference_from_mid` and whose path spans
    /// `span` seconds.
    ///
    /// Mid poses are well measured and never alternate, so the velocity follows from them. The trapezoidal rule, the mean
    /// of the velocities at both ends is that between them, gives `v = 2 m/dt - v_previous`, where `v_previous` is the
    /// mean slope of the mid poses on both sides of the previous frame. That frame's own exposure says it better where the
    /// hand jerks, but what was wrong there would come back here with the other sign, and a blurred picture does not mind
    /// the sign. So it may correct the slope by a share of how much the mid poses themselves change direction: errors
    /// cannot live on, whatever the picture says.
    pub(super) fn expected_motion(
        &self,
        reference_from_mid: &RigidTransform,
        timestamp: f64,
        span: f64,
        camera: &PinholeCamera,
        inverse_depth: f64,
    ) -> MotionPrior {
        let dt = timestamp - self.timestamp;
        let mean_rate = self.reference_from_mid.tangent_to(reference_from_mid) / dt;
        let mut bow = Vector6::zeros();
        let (mut motion_follows, mut bow_follows) = (span / dt, 0.0);
        let (rate, spread) = match self.within_exposure.filter(|_| dt <= MAX_GAP) {
            Some(measured) => {
                let (previous, share) = self.previous_rate(&mean_rate, dt, &measured);
                motion_follows = (2.0 - share) * span / dt;
                bow_follows = (1.0 - share) * (span / dt) * (span / dt);
                let rate = mean_rate * 2.0 - previous;
                let change = rate - previous;
                bow = change * (0.5 * span * span / dt);
                (rate, change.abs() * 0.3 + rate.abs() * 0.15)
            }
            None => (mean_rate, mean_rate.abs() * 0.6),
        };
        let pixel = FLOOR_PIXELS / camera.fx;
        let floors = [pixel / inverse_depth.max(0.02), pixel];
        let information = |spread: &Vector6<f64>, floor_factor: f64| {
            Vector6::from_fn(|i, _| {
                let (first, floor) = if i < 3 { (0, floors[0]) } else { (3, floors[1]) };
                let sigma = spread.fixed_rows::<3>(first).norm() + floor * floor_factor;
                1.0 / (sigma * sigma)
            })
        };
        // A hand's acceleration changes by its own size within a frame; no hand exceeds the limits, wherever a guess of the
        // mid pose lies.
        let mut bow_spread = bow.abs() + rate.abs() * (0.1 * span);
        for (group, limit) in [(0, MAX_ACCELERATION), (3, MAX_ANGULAR_ACCELERATION)] {
            let limit = 0.5 * limit * span * span;
            for part in [&mut bow, &mut bow_spread] {
                let length = part.fixed_rows::<3>(group).norm();
                if length > limit {
                    part.fixed_rows_mut::<3>(group).scale_mut(limit / length);
                }
            }
        }
        MotionPrior {
            expected: rate * span,
            information: information(&(spread * span), 1.0),
            bow,
            bow_information: information(&bow_spread, BOW_FLOOR),
            follows: (dt <= MAX_GAP).then_some(FollowsCentre {
                keyframe_from_mid: *reference_from_mid,
                motion: [motion_follows; 2],
                bow: [bow_follows; 2],
            }),
        }
    }

    /// The belief of [`Self::expected_motion`] with the turning as a gyroscope measured it, without its bias: that owes
    /// nothing to the picture, so it does not follow the mid pose.
    pub(super) fn with_gyro(mut prior: MotionPrior, gyro: &GyroReading, span: f64) -> MotionPrior {
        let turn = gyro.angular_velocity * span;
        let bow = gyro.angular_acceleration * (0.5 * span * span);
        let sigma = GYRO_SIGMA * span + GYRO_SCALE_SIGMA * turn.norm();
        let bow_sigma = GYRO_BOW_SHARE * bow.norm() + GYRO_SIGMA * span;
        for i in 0..3 {
            prior.expected[3 + i] = turn[i];
            prior.information[3 + i] = 1.0 / (sigma * sigma);
            prior.bow[3 + i] = bow[i];
            prior.bow_information[3 + i] = 1.0 / (bow_sigma * bow_sigma);
        }
        if let Some(follows) = &mut prior.follows {
            (follows.motion[1], follows.bow[1]) = (0.0, 0.0);
        }
        prior
    }

    /// Velocity at the last frame, given the mean rate from it to the next, `dt` seconds later, and what its own exposure
    /// says; and the share of a change of the mean rate that it takes on.
    fn previous_rate(
        &self,
        mean_rate: &Vector6<f64>,
        dt: f64,
        measured: &Vector6<f64>,
    ) -> (Vector6<f64>, f64) {
        if self.interval > MAX_GAP {
            return (*measured, 0.0);
        }
        // The slope at the middle of three points: the nearer side counts more.
        let slope = (mean_rate * self.interval + self.between_frames * dt) / (dt + self.interval);
        let mut correction = measured - slope;
        let bend = mean_rate - self.between_frames;
        for group in [0, 3] {
            let limit = EXPOSURE_TRUST * bend.fixed_rows::<3>(group).norm();
            let length = correction.fixed_rows::<3>(group).norm();
            if length > limit {
                correction.fixed_rows_mut::<3>(group).scale_mut(limit / length);
            }
        }
        (slope + correction, self.interval / (dt + self.interval))
    }
}

pub(super) fn rotated(a_from_b: &RigidTransform, rate: &Vector6<f64>) -> Vector6<f64> {
    let mut rotated = *rate;
    let translation = a_from_b.rotation * rate.fixed_rows::<3>(0).into_owned();
    rotated.fixed_rows_mut::<3>(0).copy_from(&translation);
    rotated
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 640, height: 480, fx: 500.0, fy: 500.0, cx: 319.5, cy: 239.5 };
    const DT: f64 = 1.0 / 30.0;

    /// Position of a camera that moves with constant acceleration, and its velocity.
    fn quadratic(t: f64) -> (Vector6<f64>, Vector6<f64>) {
        let (velocity, acceleration) =
            (Vector6::new(0.4, -0.2, 0.1, 0.0, 0.0, 0.3), Vector6::new(-3.0, 5.0, 1.0, 0.0, 0.0, -2.0));
        (velocity * t + acceleration * (0.5 * t * t), velocity + acceleration * t)
    }

    fn pose(t: f64) -> RigidTransform {
        // Rotation about one axis only: rotation vectors then add up.
        RigidTransform::identity().perturbed(&quadratic(t).0)
    }

    fn motion(t: f64) -> Motion {
        Motion { within_exposure: Some(quadratic(t).1), ..Motion::still(t, pose(t)) }
    }

    #[test]
    fn no_hand_jumps_or_turns_round_within_a_frame() {
        let dt = 1.0 / 30.0;
        let steady = Vector6::new(1.0, 0.0, 0.0, 0.0, 0.5, 0.0);
        let motion =
            Motion { between_frames: steady, interval: dt, ..Motion::still(1.0, RigidTransform::identity()) };
        let reaches = |motion: &Motion, change: [f64; 2], dt: f64| {
            let moved = steady * dt + Vector6::new(0.0, change[0], 0.0, change[1], 0.0, 0.0);
            motion.can_reach(&RigidTransform::identity().perturbed(&moved), 1.0 + dt)
        };
        // 200 m/s^2 and 500 rad/s^2 for a thirtieth of a second and as long before: 0.22 m, 0.56 rad, and 0.03 of error.
        assert!(reaches(&motion, [0.24, 0.0], dt) && reaches(&motion, [0.0, 0.4], dt));
        assert!(!reaches(&motion, [0.26, 0.0], dt) && !reaches(&motion, [-0.26, 0.0], dt));
        // Faster than 8 m/s and 15 rad/s are out of reach whatever was before.
        assert!(!reaches(&motion, [0.0, 0.51], dt));
        let unknown = Motion::still(1.0, RigidTransform::identity());
        assert!(reaches(&unknown, [0.26, 0.0], dt) && !reaches(&unknown, [0.28, 0.0], dt));
        assert!(reaches(&motion, [7.0, 0.0], 1.0), "long ago");
        assert!(!reaches(&motion, [9.0, 0.0], 1.0));
    }

    #[test]
    fn constant_acceleration_is_predicted_exactly() {
        let prior = motion(0.2).expected_motion(&pose(0.2 + DT), 0.2 + DT, 0.015, &CAMERA, 0.5);
        let error = prior.expected - quadratic(0.2 + DT).1 * 0.015;
        assert!(error.norm() < 1e-12, "{error:?}");
    }

    #[test]
    fn the_prior_does_not_depend_on_the_reference_frame() {
        let other = RigidTransform::identity().perturbed(&Vector6::new(1.0, 2.0, 3.0, 0.3, -0.2, 0.9));
        let here = motion(0.2).expected_motion(&pose(0.2 + DT), 0.2 + DT, 0.015, &CAMERA, 0.5);
        let mid = other.compose(&pose(0.2 + DT));
        let there = motion(0.2).seen_from(&other).expected_motion(&mid, 0.2 + DT, 0.015, &CAMERA, 0.5);
        assert!((rotated(&other, &here.expected) - there.expected).norm() < 1e-12);
    }

    #[test]
    fn a_wrong_exposure_motion_dies_out_within_three_frames() {
        // Constant velocity. A blurred picture accepts whatever it is told with either sign: what is expected is measured.
        let rate = Vector6::new(0.3, -0.1, 0.2, 0.1, -0.4, 0.2);
        let pose = |k: usize| RigidTransform::identity().perturbed(&(rate * (k as f64 * DT)));
        let wrong = rate * 4.0;
        let mut motion = Motion {
            between_frames: rate,
            interval: DT,
            within_exposure: Some(wrong),
            ..Motion::still(0.0, pose(0))
        };
        for k in 1..4 {
            let time = k as f64 * DT;
            // Mid poses with an error of a tenth of a millimetre to and fro, which the limit is taken from.
            let mid = pose(k).perturbed(&Vector6::repeat(1e-4 * if k % 2 == 0 { 1.0 } else { -1.0 }));
            let expected = motion.expected_motion(&mid, time, 1.0, &CAMERA, 0.5).expected;
            motion = Motion {
                between_frames: motion.reference_from_mid.tangent_to(&mid) / DT,
                within_exposure: Some(expected),
                timestamp: time,
                reference_from_mid: mid,
                ..motion
            };
        }
        let error = (motion.within_exposure.expect("a motion") - rate).norm() / rate.norm();
        let before = (wrong - rate).norm() / rate.norm();
        assert!(before > 2.9 && error < 0.1, "{error} of the motion is left of {before}");
    }

    #[test]
    fn a_gyroscope_replaces_the_turn_and_nothing_else() {
        let prior = motion(0.2).expected_motion(&pose(0.2 + DT), 0.2 + DT, 0.02, &CAMERA, 0.5);
        let gyro = GyroReading {
            angular_velocity: nalgebra::Vector3::new(0.3, -0.2, 0.1),
            angular_acceleration: nalgebra::Vector3::new(10.0, 0.0, -5.0),
        };
        let told = Motion::with_gyro(prior, &gyro, 0.02);
        assert_eq!(told.expected.fixed_rows::<3>(0), prior.expected.fixed_rows::<3>(0));
        assert_eq!(told.expected.fixed_rows::<3>(3), gyro.angular_velocity * 0.02);
        // Half of the acceleration times the square of the span.
        assert_eq!(told.bow.fixed_rows::<3>(3), gyro.angular_acceleration * 2e-4);
        assert_eq!(told.follows.map(|follows| (follows.motion[1], follows.bow[1])), Some((0.0, 0.0)));
    }

    #[test]
    fn extrapolation_continues_the_rate_but_not_across_a_gap() {
        let rate = Vector6::new(1.0, 0.0, 0.0, 0.0, 0.5, 0.0);
        let ahead = motion(0.0).extrapolate(&rate, 0.1);
        assert!((pose(0.0).tangent_to(&ahead) - rate * 0.1).norm() < 1e-12);
        assert_eq!(motion(0.0).extrapolate(&rate, 2.0 * MAX_GAP), pose(0.0));
    }

    #[test]
    fn a_camera_at_rest_is_expected_to_stay_within_half_a_pixel() {
        let still = Motion::still(0.0, RigidTransform::identity());
        let prior = still.expected_motion(&RigidTransform::identity(), DT, 0.01, &CAMERA, 0.5);
        assert_eq!(prior.expected, Vector6::zeros());
        // Half a pixel is 0.5/500 rad, and twice that in metres at 2 m.
        assert!((prior.information[3] - 1e6).abs() < 1e-3);
        assert!((prior.information[0] - 0.25e6).abs() < 1e-3);
    }
}
