//! The motion during an exposure that the neighbours of a frame suggest: a prior for bundle adjustment.

use mba_tracker::geometry::RigidTransform;
use nalgebra::{Vector3, Vector6};

use super::repair::usual_interval;
use super::scales::MEDIAN_NORM_3;
use super::{ContinuityFrame, ContinuitySettings};
use crate::evaluation::quantile;

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

/// Predicts the motion during every exposure from the mid-exposure poses of the frames around it; `None` for lost frames
/// and where one neighbour is lost or further away than the settings bridge.
///
/// The velocity is the derivative of a polynomial through the tracked frames k-2 to k+2 (k-1 to k+1 where fewer are
/// there), so it does not depend on any measured motion and its direction of time is right. The uncertainty is the usual
/// misfit to the measured motions, the same velocity error for every frame, at least `1e-4` m and rad over an exposure.
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
    frames
        .iter()
        .zip(velocities)
        .map(|(frame, velocity)| {
            let seconds = frame.exposure_seconds;
            velocity.map(|velocity| MotionPrediction {
                motion: velocity * seconds,
                translation_sigma: (sigmas[0] * seconds).max(LEAST_SIGMA),
                rotation_sigma: (sigmas[1] * seconds).max(LEAST_SIGMA),
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
        let rest = others.iter().enumerate().filter(|&(l, _)| l != k).map(|(_, (other, _))| other);
        let weight: f64 = rest.map(|other| other / (other - time)).product();
        sum += mid.tangent_to(pose) * (weight / time);
    }
    sum
}

/// Usual difference between measured and predicted velocity along one axis, m/s and rad/s.
fn velocity_sigmas(frames: &[ContinuityFrame], velocities: &[Option<Vector6<f64>>]) -> [f64; 2] {
    let misfits: Vec<Vector6<f64>> = frames
        .iter()
        .zip(velocities)
        .filter(|(frame, _)| frame.exposure_seconds > 0.0)
        .filter_map(|(frame, velocity)| {
            velocity.map(|velocity| frame.world_from_camera.motion() / frame.exposure_seconds - velocity)
        })
        .collect();
    [0, 3].map(|first| {
        let norm = |misfit: &Vector6<f64>| Vector3::from(misfit.fixed_rows::<3>(first)).norm();
        let norms: Vec<f64> = misfits.iter().map(norm).collect();
        quantile(&norms, 0.5).unwrap_or(0.0) / MEDIAN_NORM_3
    })
}
