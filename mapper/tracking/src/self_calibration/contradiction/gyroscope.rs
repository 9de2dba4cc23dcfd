//! A gyroscope against the turning of tracked frames: other axes, another unit, another clock.

use std::fmt;

use mba_io::imu::ImuRecording;
use mba_tracker::geometry::so3;
use nalgebra::{Matrix3, Rotation3, Vector3};

use super::super::robust::median;
use super::super::window::Tracked;

/// Longest time between two frames whose turn is compared, seconds.
const LONGEST_STEP: f64 = 0.11;

/// Fewest pairs of frames, and the most that are looked at.
const FEWEST_PAIRS: usize = 20;
const MOST_PAIRS: usize = 600;

/// Median change of the turning, rad/s, below which a gyroscope tells nothing but its noise.
const LEAST_TURNING: f64 = 0.1;

/// Times by which a clock may be off, and the step in which they are tried, seconds.
const LONGEST_LAG: f64 = 0.1;
const LAG_STEP: f64 = 0.0025;

/// What is worth telling: an angle between axes (radians), the logarithm of a factor, a time (seconds).
const TELLING_ANGLE: f64 = 0.07;
const TELLING_FACTOR: f64 = 0.1;
const TELLING_LAG: f64 = 0.006;

/// What the repaired readings leave of the turning, and of what they leave unrepaired, for the repair to be believed.
const EXPLAINED: f64 = 0.3;
const BETTER: f64 = 0.5;

/// Rounds of weighting, and the multiple of the usual residual from which a pair counts less.
const ROUNDS: usize = 5;
const HUBER: f64 = 2.0;

/// How the gyroscope on record has to be read to turn as the camera does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GyroscopeFault {
    /// Takes what is read as in the camera's axes to the camera's axes.
    pub camera_from_read: Rotation3<f64>,
    /// Factor on the rates that are read.
    pub factor: f64,
    /// Seconds to add to its timestamps.
    pub lag: f64,
}

impl fmt::Display for GyroscopeFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { camera_from_read, factor, lag } = self;
        write!(f, "the gyroscope does not turn as the camera does; it would with ")?;
        let mut repairs = Vec::new();
        if camera_from_read.angle() > TELLING_ANGLE {
            repairs.push(format!(
                "axes {:.0} degrees from those that imu_from_camera says",
                camera_from_read.angle().to_degrees()
            ));
        }
        if factor.ln().abs() > TELLING_FACTOR {
            repairs.push(format!("rates {factor:.3} times as large"));
        }
        if lag.abs() > TELLING_LAG {
            repairs.push(format!("{:+.1} ms added to its timestamps", 1e3 * lag));
        }
        f.write_str(&repairs.join(" and "))
    }
}

/// Angular velocities of the camera and of its gyroscope over the same time, rad/s.
type Pair = [Vector3<f64>; 2];

/// What is wrong with a gyroscope; none where it turns as the camera does, or where no reading of it would.
pub(super) fn fault(imu: &ImuRecording, tracked: &[Tracked]) -> Option<GyroscopeFault> {
    let as_read = pairs(imu, tracked, 0.0);
    let turning: Vec<Vector3<f64>> = as_read.iter().map(|pair| pair[0]).collect();
    let mean = turning.iter().sum::<Vector3<f64>>() / turning.len().max(1) as f64;
    let typical = median(&turning.iter().map(|rate| (rate - mean).norm()).collect::<Vec<_>>())?;
    if as_read.len() < FEWEST_PAIRS || typical < LEAST_TURNING {
        return None;
    }
    // What is missed by the readings as they are, for comparison.
    let unrepaired = Reading::weighted(&as_read, |_, _| Some((Rotation3::identity(), 1.0)))?;
    let steps = (LONGEST_LAG / LAG_STEP) as i32;
    let candidates = (-steps..=steps).filter_map(|step| {
        let lag = f64::from(step) * LAG_STEP;
        let pairs = pairs(imu, tracked, -lag);
        // A clock that leaves the recording compares less.
        if 2 * pairs.len() < as_read.len() {
            return None;
        }
        Some((lag, Reading::weighted(&pairs, similarity)?))
    });
    let (lag, best) = candidates.min_by(|a, b| a.1.residual.total_cmp(&b.1.residual))?;
    let fault = GyroscopeFault { camera_from_read: best.rotation, factor: best.factor, lag };
    let is_explained = best.residual < EXPLAINED * typical && best.residual < BETTER * unrepaired.residual;
    let is_telling = best.rotation.angle() > TELLING_ANGLE
        || best.factor.ln().abs() > TELLING_FACTOR
        || lag.abs() > TELLING_LAG;
    (is_explained && is_telling).then_some(fault)
}

/// What camera and gyroscope turned from frame to frame, the times of the gyroscope read `shift` seconds later.
fn pairs(imu: &ImuRecording, tracked: &[Tracked], shift: f64) -> Vec<Pair> {
    let stride = tracked.len() / MOST_PAIRS + 1;
    let pair = |frames: &[Tracked]| {
        let [a, b] = frames else { return None };
        let duration = b.timestamp - a.timestamp;
        if !(a.is_found && b.is_found && duration > 0.0 && duration <= LONGEST_STEP) {
            return None;
        }
        let turn = a.world_from_mid.rotation.inverse() * b.world_from_mid.rotation;
        let read = imu.rotation_between(a.timestamp + shift, b.timestamp + shift)?;
        Some([so3::log(&turn) / duration, so3::log(&read) / duration])
    };
    tracked.windows(2).step_by(stride).filter_map(pair).collect()
}

/// How readings become what the camera turned: a rotation and a factor, about means that hold the bias.
struct Reading {
    rotation: Rotation3<f64>,
    factor: f64,
    /// Median of what is missed, rad/s.
    residual: f64,
}

impl Reading {
    /// Fits with `fit` from weighted deviations from the means; pairs that lie far off count less.
    fn weighted(
        pairs: &[Pair],
        fit: impl Fn(&Matrix3<f64>, f64) -> Option<(Rotation3<f64>, f64)>,
    ) -> Option<Self> {
        let mut weights = vec![1.0; pairs.len()];
        let mut reading = None;
        for _ in 0..ROUNDS {
            let total: f64 = weights.iter().sum();
            let mean = |which: usize| {
                let terms = pairs.iter().zip(&weights).map(|(pair, weight)| pair[which] * *weight);
                terms.sum::<Vector3<f64>>() / total
            };
            let means = [mean(0), mean(1)];
            let deviations: Vec<Pair> =
                pairs.iter().map(|pair| [pair[0] - means[0], pair[1] - means[1]]).collect();
            // About the means: a bias of the gyroscope adds the same to all readings.
            let (mut product, mut power) = (Matrix3::zeros(), 0.0);
            for ([camera, read], weight) in deviations.iter().zip(&weights) {
                product += camera * read.transpose() * *weight;
                power += read.norm_squared() * weight;
            }
            let (rotation, factor) = fit(&product, power)?;
            let missed: Vec<f64> =
                deviations.iter().map(|[camera, read]| (camera - rotation * read * factor).norm()).collect();
            let residual = median(&missed)?;
            let usual = residual.max(f64::MIN_POSITIVE);
            // Huber's weights for the next round.
            weights = missed.iter().map(|missed| (HUBER * usual / missed.max(usual)).min(1.0)).collect();
            reading = Some(Self { rotation, factor, residual });
        }
        reading
    }
}

/// The rotation and the factor that take readings to the camera's, from the sum of `camera * read'` and that of the squared
/// readings (Umeyama, PAMI 1991).
fn similarity(product: &Matrix3<f64>, power: f64) -> Option<(Rotation3<f64>, f64)> {
    let svd = product.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let mirrored = (u * v_t).determinant() < 0.0;
    let signs = Vector3::new(1.0, 1.0, if mirrored { -1.0 } else { 1.0 });
    let rotation = Rotation3::from_matrix_unchecked(u * Matrix3::from_diagonal(&signs) * v_t);
    let factor = svd.singular_values.dot(&signs) / power;
    (factor > 0.0 && factor.is_finite()).then_some((rotation, factor))
}

#[cfg(test)]
mod tests {
    use mba_io::imu::TimedVector;
    use mba_tracker::geometry::RigidTransform;
    use mba_tracker::trajectory::ExposureTrajectory;
    use nalgebra::UnitQuaternion;

    use super::*;

    fn orientation(time: f64) -> UnitQuaternion<f64> {
        so3::exp(&Vector3::new(
            0.1 * (9.0 * time).sin(),
            0.15 * (7.0 * time).cos(),
            0.08 * (5.0 * time).sin(),
        ))
    }

    /// 40 frames of a turning camera; where it is found is off by a milliradian to and fro.
    fn tracked() -> Vec<Tracked> {
        let frame = |index: usize| {
            let timestamp = 1.0 + index as f64 / 30.0;
            let error = Vector3::new(1e-3 * ((index * 7 % 5) as f64 - 2.0), 0.0, 1e-3 * (index % 2) as f64);
            let pose = RigidTransform::new(orientation(timestamp) * so3::exp(&error), Vector3::zeros());
            Tracked {
                index,
                timestamp,
                is_found: true,
                world_from_mid: pose,
                world_from_camera: ExposureTrajectory::still(pose),
                reference: 0,
                gain: 1.0,
                residual: 1.0,
            }
        };
        (0..40).map(frame).collect()
    }

    /// A biased gyroscope that reads the rates turned by `axes`, `factor` as large and `late` seconds too late.
    fn gyroscope(axes: &Rotation3<f64>, factor: f64, late: f64) -> ImuRecording {
        const STEP: f64 = 1e-4;
        let sample = |k: i32| {
            let time = 0.7 + f64::from(k) / 200.0;
            let turn = orientation(time - STEP).inverse() * orientation(time + STEP);
            let rate = so3::log(&turn) / (2.0 * STEP);
            let value = axes * rate * factor + Vector3::new(0.03, -0.02, 0.01);
            TimedVector { time: time + late, value }
        };
        ImuRecording::new((0..420).map(sample).collect(), Vec::new())
    }

    #[test]
    fn a_right_gyroscope_is_not_blamed() {
        assert_eq!(fault(&gyroscope(&Rotation3::identity(), 1.0, 0.0), &tracked()), None);
        assert_eq!(fault(&gyroscope(&Rotation3::identity(), 1.02, 0.003), &tracked()), None, "small errors");
    }

    #[test]
    fn wrong_axes_units_and_clocks_are_found() {
        let axes = Rotation3::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2);
        let found = fault(&gyroscope(&axes, 1.0, 0.0), &tracked()).unwrap();
        assert!(found.camera_from_read.angle_to(&axes.inverse()) < 0.05, "{found:?}");
        assert!((found.factor - 1.0).abs() < 0.05 && found.lag.abs() < 0.005, "{found:?}");

        let found = fault(&gyroscope(&Rotation3::identity(), 57.3, 0.0), &tracked()).unwrap();
        assert!((found.factor * 57.3 - 1.0).abs() < 0.05, "{found:?}");

        let found = fault(&gyroscope(&Rotation3::identity(), 1.0, 0.03), &tracked()).unwrap();
        assert!((found.lag + 0.03).abs() < 0.005, "{found:?}");
        let said =
            "the gyroscope does not turn as the camera does; it would with -30.0 ms added to its timestamps";
        assert_eq!(found.to_string(), said);
    }

    #[test]
    fn a_camera_that_does_not_turn_says_nothing() {
        let mut still = tracked();
        still.iter_mut().for_each(|frame| frame.world_from_mid = RigidTransform::identity());
        assert_eq!(fault(&gyroscope(&Rotation3::identity(), 57.3, 0.0), &still), None);
    }
}
