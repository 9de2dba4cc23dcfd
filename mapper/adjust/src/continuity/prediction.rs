//! The motion during an exposure that the neighbours of a frame suggest: a prior for bundle adjustment.

use mba_io::statistics::quantile;
use mba_tracker::geometry::RigidTransform;
use nalgebra::{Vector3, Vector6};

use super::repair::usual_interval;
use super::scales::{MEDIAN_NORM_3, Sample, derivative};
use super::spline::Part;
use super::{ContinuityFrame, ContinuitySettings};

/// Nothing is known more exactly than this, in metres or radians.
const LEAST_SIGMA: f64 = 1e-4;

/// A motion from opening to closing, and how exactly it is predicted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionPrediction {
    /// Translation in the world (metres) and rotation in the camera frame (radians) over the exposure, as
    /// [`ExposureTrajectory::motion`](mba_tracker::trajectory::ExposureTrajectory::motion).
    pub motion: Vector6<f64>,
    /// Standard deviation of the translation along one axis, metres.
    pub translation_sigma: f64,
    /// Standard deviation of the rotation about one axis, radians.
    pub rotation_sigma: f64,
}

impl MotionPrediction {
    /// The prediction for `factor` times the time.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        Self {
            motion: self.motion * factor,
            translation_sigma: self.translation_sigma * factor,
            rotation_sigma: self.rotation_sigma * factor,
        }
    }
}

/// Predicts the motion during every exposure from the mid-exposure poses of the frames around it; `None` for lost frames
/// and where one neighbour is lost or further away than the settings bridge.
///
/// The velocity is the derivative of a polynomial through the tracked frames k-2 to k+2 (k-1 to k+1 where fewer are
/// there), so it does not depend on any measured motion and its direction of time is right. The uncertainty is
/// calibrated by the misfit to the measured motions and grows with the jerk around the frame, at least `1e-4` m and rad over an exposure.
/// Run this after [`repair`](super::repair).
#[must_use]
pub fn predict_motions(
    frames: &[ContinuityFrame],
    settings: &ContinuitySettings,
) -> Vec<Option<MotionPrediction>> {
    let Some(interval) = usual_interval(frames) else { return vec![None; frames.len()] };
    let longest_gap = settings.longest_gap * interval;
    let velocities: Vec<Option<Vector6<f64>>> =
        (0..frames.len()).map(|k| velocity(frames, k, longest_gap)).collect();
    let sigmas = velocity_sigmas(frames, &velocities);
    (0..frames.len())
        .map(|k| {
            let seconds = frames[k].exposure_seconds;
            velocities[k].map(|velocity| MotionPrediction {
                motion: velocity * seconds,
                translation_sigma: (sigmas[0][k] * seconds).max(LEAST_SIGMA),
                rotation_sigma: (sigmas[1][k] * seconds).max(LEAST_SIGMA),
            })
        })
        .collect()
}

/// The velocity at mid exposure of frame `k`: translation in the world, rotation in its camera.
fn velocity(frames: &[ContinuityFrame], k: usize, longest_gap: f64) -> Option<Vector6<f64>> {
    let near = |l: usize, from: usize| {
        let frame = frames.get(l)?;
        let gap = (frame.timestamp - frames.get(from)?.timestamp).abs();
        (frame.noise.is_some() && gap <= longest_gap).then_some(frame)
    };
    let middle = near(k, k)?;
    // Two neighbours make it a parabola; four a quartic, whose error is of the next order but one.
    let mut others = vec![near(k.checked_sub(1)?, k)?, near(k + 1, k)?];
    if let (Some(before), Some(after)) = (k.checked_sub(2).and_then(|l| near(l, l + 1)), near(k + 2, k + 1)) {
        others.extend([before, after]);
    }
    let mid = middle.world_from_camera.mid();
    let offsets: Vec<(f64, RigidTransform)> = others
        .iter()
        .map(|other| (other.timestamp - middle.timestamp, other.world_from_camera.mid()))
        .collect();
    Some(derivative_at_zero(&mid, &offsets))
}

/// Derivative at time 0 of the polynomial (Lagrange) through `mid` at time 0 and the other poses at their times.
fn derivative_at_zero(mid: &RigidTransform, others: &[(f64, RigidTransform)]) -> Vector6<f64> {
    let mut sum = Vector6::zeros();
    for (k, (time, pose)) in others.iter().enumerate() {
        // The derivative of Lagrange's basis polynomial of this pose at time 0.
        let rest = others.iter().enumerate().filter(|&(l, _)| l != k).map(|(_, (other, _))| other);
        let weight: f64 = rest.map(|other| other / (other - time)).product();
        sum += mid.tangent_to(pose) * (weight / time);
    }
    sum
}

/// Standard deviation of every predicted velocity along one axis, m/s and rad/s: the jerk around the frame, scaled so
/// that the measured velocities fit.
fn velocity_sigmas(frames: &[ContinuityFrame], velocities: &[Option<Vector6<f64>>]) -> [Vec<f64>; 2] {
    let tracked: Vec<usize> = (0..frames.len()).filter(|&k| frames[k].noise.is_some()).collect();
    let samples: Vec<Sample> = tracked.iter().map(|&k| frames[k].sample()).collect();
    Part::BOTH.map(|part| {
        let mut jerks = vec![0.0; frames.len()];
        for (jerk, &k) in largest_jerks(&samples, part).iter().zip(&tracked) {
            jerks[k] = *jerk;
        }
        let misfit = |k: usize| {
            let frame = &frames[k];
            let measured = (frame.exposure_seconds > 0.0)
                .then(|| frame.world_from_camera.motion() / frame.exposure_seconds)?;
            let difference = measured - velocities[k]?;
            let of_part = Vector3::from(difference.fixed_rows::<3>(3 * part as usize));
            (jerks[k] > 0.0).then(|| of_part.norm() / jerks[k])
        };
        let misfits: Vec<f64> = (0..frames.len()).filter_map(misfit).collect();
        let scale = quantile(&misfits, 0.5).unwrap_or(0.0) / MEDIAN_NORM_3;
        jerks.iter().map(|jerk| jerk * scale).collect()
    })
}

/// Largest jerk of the four-frame windows that each sample lies in, at least the usual one.
fn largest_jerks(samples: &[Sample], part: Part) -> Vec<f64> {
    const WINDOW: usize = 4;
    let jerks: Vec<f64> = samples.windows(WINDOW).map(|window| derivative(window, part).norm()).collect();
    let usual = quantile(&jerks, 0.5).unwrap_or(0.0);
    (0..samples.len())
        .map(|k| {
            let end = (k + 1).min(jerks.len());
            let around = &jerks[(k + 1).saturating_sub(WINDOW).min(end)..end];
            around.iter().copied().fold(usual, f64::max)
        })
        .collect()
}
