//! Samples of an IMU, and means and integrals over time.

use mba_tracker::geometry::so3;
use nalgebra::{Rotation3, UnitQuaternion, Vector3};

/// Longest time between samples over which one still knows what happened, seconds.
pub const LONGEST_GAP: f64 = 0.05;

/// A vector measured at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedVector {
    /// Seconds, on the clock of the frames.
    pub time: f64,
    /// What was measured.
    pub value: Vector3<f64>,
}

/// The recording of a gyroscope, an accelerometer or both, in the camera's axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImuRecording {
    angular_velocities: Vec<TimedVector>,
    specific_forces: Vec<TimedVector>,
}

impl ImuRecording {
    /// A recording of angular velocities (rad/s) and specific forces (m/s^2) of increasing time, in the camera's
    /// axes; either may be empty. Samples that are not later than the one before are left out.
    #[must_use]
    pub fn new(mut angular_velocities: Vec<TimedVector>, mut specific_forces: Vec<TimedVector>) -> Self {
        for samples in [&mut angular_velocities, &mut specific_forces] {
            let mut latest = f64::NEG_INFINITY;
            samples.retain(|sample| {
                let is_later = sample.time > latest;
                latest = latest.max(sample.time);
                is_later
            });
        }
        Self { angular_velocities, specific_forces }
    }

    /// Angular velocities in rad/s, increasing in time; empty without a gyroscope.
    #[must_use]
    pub fn angular_velocities(&self) -> &[TimedVector] {
        &self.angular_velocities
    }

    /// Specific forces in m/s^2, increasing in time; empty without an accelerometer.
    #[must_use]
    pub fn specific_forces(&self) -> &[TimedVector] {
        &self.specific_forces
    }

    /// The same motion as another rigid set of axes measures it, `other_from_camera` away.
    #[must_use]
    pub fn seen_from(&self, other_from_camera: &Rotation3<f64>) -> Self {
        let turned = |samples: &[TimedVector]| {
            let turn =
                |sample: &TimedVector| TimedVector { value: other_from_camera * sample.value, ..*sample };
            samples.iter().map(turn).collect()
        };
        Self {
            angular_velocities: turned(&self.angular_velocities),
            specific_forces: turned(&self.specific_forces),
        }
    }

    /// The recording less constant biases: of angular velocity (rad/s) and of specific force (m/s^2).
    #[must_use]
    pub fn without_bias(&self, gyroscope: &Vector3<f64>, accelerometer: &Vector3<f64>) -> Self {
        let less = |samples: &[TimedVector], bias: &Vector3<f64>| {
            let corrected = |sample: &TimedVector| TimedVector { value: sample.value - bias, ..*sample };
            samples.iter().map(corrected).collect()
        };
        Self {
            angular_velocities: less(&self.angular_velocities, gyroscope),
            specific_forces: less(&self.specific_forces, accelerometer),
        }
    }

    /// Mean angular velocity from one time to another (seconds), rad/s: between samples it changes evenly. That of
    /// an instant when both are equal. `None` where the gyroscope does not cover the time, or has gaps of more than
    /// [`LONGEST_GAP`].
    #[must_use]
    pub fn mean_angular_velocity(&self, from: f64, to: f64) -> Option<Vector3<f64>> {
        mean(&self.angular_velocities, from, to)
    }

    /// Mean specific force from one time to another (seconds), m/s^2, as [`Self::mean_angular_velocity`]. Over a
    /// second or more of a hand-held camera that does not turn it points up, but for the accelerometer's bias.
    #[must_use]
    pub fn mean_specific_force(&self, from: f64, to: f64) -> Option<Vector3<f64>> {
        mean(&self.specific_forces, from, to)
    }

    /// How the camera turned from one time to another (seconds): the orientation at `to` is the one at `from` times
    /// this, both `world_from_camera`. `None` as in [`Self::mean_angular_velocity`].
    #[must_use]
    pub fn rotation_between(&self, from: f64, to: f64) -> Option<UnitQuaternion<f64>> {
        if to < from {
            return Some(self.rotation_between(to, from)?.inverse());
        }
        let turn = |total: UnitQuaternion<f64>, [start, end]: [TimedVector; 2]| {
            let duration = end.time - start.time;
            // For a rate that changes evenly the axis turns as well: second term of Magnus' series, error of order
            // duration^5.
            let coning = start.value.cross(&end.value) * (duration * duration / 12.0);
            total * so3::exp(&((start.value + end.value) * (0.5 * duration) + coning))
        };
        let pieces = pieces(&self.angular_velocities, from, to)?;
        Some(so3::renormalised(&pieces.fold(UnitQuaternion::identity(), turn)))
    }

    /// Whether any of the samples lies within these times, seconds.
    pub(crate) fn overlaps(&self, from: f64, to: f64) -> bool {
        [&self.angular_velocities, &self.specific_forces].into_iter().any(|samples| {
            match samples.as_slice() {
                [first, .., last] => first.time <= to && last.time >= from,
                _ => false,
            }
        })
    }
}

/// Mean over time by the trapezoidal rule, exact for values that change evenly between samples.
fn mean(samples: &[TimedVector], from: f64, to: f64) -> Option<Vector3<f64>> {
    let (from, to) = if to < from { (to, from) } else { (from, to) };
    if from == to {
        return at(samples, from);
    }
    let area = |[start, end]: [TimedVector; 2]| (start.value + end.value) * (0.5 * (end.time - start.time));
    Some(pieces(samples, from, to)?.map(area).sum::<Vector3<f64>>() / (to - from))
}

/// The value at a time between samples that are near enough.
fn at(samples: &[TimedVector], time: f64) -> Option<Vector3<f64>> {
    let after = samples.partition_point(|sample| sample.time < time);
    let end = samples.get(after)?;
    if end.time == time {
        return Some(end.value);
    }
    let start = samples.get(after.checked_sub(1)?)?;
    let share = (time - start.time) / (end.time - start.time);
    is_near(start, end).then(|| start.value + (end.value - start.value) * share)
}

/// Whether what happened between two samples is known. A microsecond of slack is for timestamps that were rounded.
fn is_near(start: &TimedVector, end: &TimedVector) -> bool {
    end.time - start.time <= LONGEST_GAP + 1e-6
}

/// The stretches between neighbouring samples from one time to a later one, interpolated at both ends; nothing if they
/// do not cover it without gaps.
fn pieces(samples: &[TimedVector], from: f64, to: f64) -> Option<impl Iterator<Item = [TimedVector; 2]>> {
    let first = TimedVector { time: from, value: at(samples, from)? };
    let last = TimedVector { time: to, value: at(samples, to)? };
    let begin = samples.partition_point(|sample| sample.time <= from);
    let end = samples.partition_point(|sample| sample.time < to);
    let between = samples.get(begin..end).unwrap_or_default();
    let ends = between.iter().copied().chain([last]);
    let starts = std::iter::once(first).chain(between.iter().copied());
    let pieces = starts.zip(ends).map(|(start, end)| [start, end]);
    pieces.clone().all(|[start, end]| is_near(&start, &end)).then_some(pieces)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of a rate of change, 200 a second from 0 to 1 s.
    fn sampled(rate: impl Fn(f64) -> Vector3<f64>) -> Vec<TimedVector> {
        let time = |k: i32| f64::from(k) / 200.0;
        (0..=200).map(|k| TimedVector { time: time(k), value: rate(time(k)) }).collect()
    }

    fn gyroscope(rate: impl Fn(f64) -> Vector3<f64>) -> ImuRecording {
        ImuRecording::new(sampled(rate), Vec::new())
    }

    #[test]
    fn mean_is_the_integral_with_its_ends_between_samples() {
        // The mean of a + b t from t1 to t2 is a + b (t1 + t2) / 2, whatever falls between samples.
        let rate = |t: f64| Vector3::new(1.0 + 2.0 * t, -3.0 * t, 0.5);
        let imu = ImuRecording::new(sampled(rate), sampled(|t| -rate(t)));
        for (from, to) in [(0.0, 1.0), (0.1013, 0.1177), (0.1021, 0.1023), (0.25, 0.26), (0.3017, 0.3017)] {
            let expected = rate(0.5 * (from + to));
            for mean in [imu.mean_angular_velocity(from, to), imu.mean_angular_velocity(to, from)] {
                assert!((mean.unwrap() - expected).norm() < 1e-12, "{from} to {to}: {mean:?}");
            }
            assert!((imu.mean_specific_force(from, to).unwrap() + expected).norm() < 1e-12);
        }
    }

    #[test]
    fn what_is_not_covered_or_has_gaps_is_not_known() {
        let imu = gyroscope(|_| Vector3::x());
        for (from, to) in [(-0.01, 0.1), (0.9, 1.001), (2.0, 3.0), (f64::NAN, 0.5), (0.5, f64::NAN)] {
            assert_eq!(imu.mean_angular_velocity(from, to), None, "{from} to {to}");
            assert_eq!(imu.rotation_between(from, to), None, "{from} to {to}");
        }
        assert_eq!(imu.mean_specific_force(0.1, 0.2), None, "there is no accelerometer");
        let holed = |gap: f64| {
            let keep = |sample: &TimedVector| !(0.5001..0.4999 + gap).contains(&sample.time);
            let samples = sampled(|_| Vector3::x()).into_iter().filter(keep).collect();
            ImuRecording::new(samples, Vec::new())
        };
        assert!(holed(0.05).mean_angular_velocity(0.4, 0.7).is_some(), "50 ms are no gap");
        let gap = holed(0.06);
        assert_eq!(gap.mean_angular_velocity(0.4, 0.7), None);
        assert_eq!(gap.mean_angular_velocity(0.5, 0.7), None, "begins with it");
        assert_eq!(gap.mean_angular_velocity(0.4, 0.52), None, "ends within it");
        assert_eq!(gap.mean_angular_velocity(0.53, 0.54), None, "lies within it");
        assert_eq!(gap.mean_angular_velocity(0.4, 0.5), Some(Vector3::x()), "ends before it");
    }

    /// A camera on a known path: orientation `exp(a(t)) exp(b(t))` about fixed axes, with its rate in closed form.
    fn nodding(time: f64) -> (UnitQuaternion<f64>, Vector3<f64>) {
        let (a, b) = ((7.0 * time).sin(), 0.5 * (11.0 * time).cos());
        let (da, db) = (7.0 * (7.0 * time).cos(), -5.5 * (11.0 * time).sin());
        let inner = so3::exp(&(Vector3::y() * b));
        (so3::exp(&(Vector3::x() * a)) * inner, inner.inverse() * Vector3::x() * da + Vector3::y() * db)
    }

    #[test]
    fn rotation_takes_the_orientation_from_one_time_to_the_other() {
        let imu = gyroscope(|time| nodding(time).1);
        for (from, to) in [(0.0, 1.0), (0.1013, 0.1177), (0.201, 0.203), (0.7, 0.2)] {
            let rotation = imu.rotation_between(from, to).unwrap();
            let error = (nodding(from).0 * rotation).angle_to(&nodding(to).0);
            // Between samples 5 ms apart the rate bends by up to w'' = 7^3 + 5.5 * 11^2 rad/s^3: w'' dt^3 / 12 is
            // 1e-5 rad for each of up to 200 of them, with changing sign.
            assert!(error < 5e-4, "{from} to {to}: {error} rad off");
            let wrong_way = (rotation * nodding(from).0).angle_to(&nodding(to).0);
            assert!(
                to - from < 0.01 || wrong_way > 10.0 * error,
                "the order of the factors shows: {wrong_way}"
            );
        }
    }

    #[test]
    fn a_turning_axis_is_followed_within_a_stretch() {
        // One long stretch with a rate from x to y; the exact rotation by ten thousand short ones.
        let (start, end) = (Vector3::new(4.0, 0.0, 0.0), Vector3::new(0.0, 4.0, 0.0));
        let rate = |share: f64| start + (end - start) * share;
        let samples = [0.0, 0.04].map(|time| TimedVector { time, value: rate(time / 0.04) });
        let imu = ImuRecording::new(samples.to_vec(), Vec::new());
        let short = |k: i32| so3::exp(&(rate((f64::from(k) + 0.5) / 1e4) * (0.04 / 1e4)));
        let exact = (0..10_000).fold(UnitQuaternion::identity(), |total, k| total * short(k));
        let error = imu.rotation_between(0.0, 0.04).unwrap().angle_to(&exact);
        // The next term of the series is of the order of (4 * 0.04)^3 / 240.
        assert!(error < 5e-5, "{error} rad; without the turn of the axis it is 2e-3");
    }

    #[test]
    fn axes_and_biases_are_taken_out() {
        let imu = ImuRecording::new(sampled(|_| Vector3::new(1.0, 2.0, 3.0)), sampled(|_| Vector3::z()));
        let quarter = Rotation3::new(Vector3::z() * std::f64::consts::FRAC_PI_2);
        let turned = imu.seen_from(&quarter).mean_angular_velocity(0.1, 0.2).unwrap();
        assert!((turned - Vector3::new(-2.0, 1.0, 3.0)).norm() < 1e-12);
        let calm = imu.without_bias(&Vector3::new(1.0, 2.0, 2.5), &Vector3::new(0.0, 0.1, 0.0));
        assert!((calm.mean_angular_velocity(0.1, 0.2).unwrap() - Vector3::z() * 0.5).norm() < 1e-12);
        let force = calm.mean_specific_force(0.1, 0.2).unwrap();
        assert!((force - Vector3::new(0.0, -0.1, 1.0)).norm() < 1e-12);
    }

    #[test]
    fn samples_that_do_not_come_later_are_left_out() {
        let sample = |time: f64| TimedVector { time, value: Vector3::x() * time };
        let imu = ImuRecording::new([0.1, 0.1, 0.2, 0.15, 0.3].map(sample).to_vec(), Vec::new());
        let times: Vec<f64> = imu.angular_velocities().iter().map(|sample| sample.time).collect();
        assert_eq!(times, [0.1, 0.2, 0.3]);
        assert!(imu.overlaps(0.2, 5.0) && imu.overlaps(-1.0, 0.1) && !imu.overlaps(0.4, 5.0));
    }
}
