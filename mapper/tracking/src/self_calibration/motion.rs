//! How the camera moves around a frame, from the poses at mid exposure.

use nalgebra::Vector6;

use super::window::Tracked;

/// Longest gap between neighbours whose poses tell a velocity, seconds: three frames of a video.
const MAX_GAP: f64 = 0.11;

/// Time over which an acceleration is taken, seconds: short beside the gap between frames, long beside rounding.
const STEP: f64 = 5e-3;

/// Motion at a frame, as tangent vectors at its pose.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    /// Per second.
    pub(super) velocity: Vector6<f64>,
    /// Per square of a second.
    pub(super) acceleration: Vector6<f64>,
}

/// Motion at frame `index` of `tracked`: the derivatives of the polynomial through the poses at mid exposure of two
/// frames on either side, of one where there are no two.
///
/// Three points would be too few: with a hand that shakes at 4 Hz, a difference over two intervals of 1/30 s is
/// 11 % too short, the polynomial of five points 2 %.
pub(super) fn motion(tracked: &[Tracked], index: usize) -> Option<Motion> {
    let centre = &tracked[index];
    let near = |other: &Tracked, frames: f64| {
        other.is_found && (other.timestamp - centre.timestamp).abs() <= frames * MAX_GAP
    };
    let side = |reach: usize| {
        let (first, last) = (index.checked_sub(reach)?, index + reach);
        let stretch = tracked.get(first..=last)?;
        stretch.iter().all(|other| near(other, reach as f64)).then_some(stretch)
    };
    let stretch = side(2).or_else(|| side(1))?;
    let times: Vec<f64> = stretch.iter().map(|other| other.timestamp - centre.timestamp).collect();
    let others = |j: usize| (0..times.len()).filter(move |&k| k != j);
    // Lagrange polynomial of each point; that of the middle point has no part in motion, as its tangent is zero.
    let denominator = |j: usize| others(j).map(|k| times[j] - times[k]).product::<f64>();
    let value = |j: usize, time: f64| others(j).map(|k| time - times[k]).product::<f64>() / denominator(j);
    let slope = |j: usize| {
        let numerator: f64 = others(j).filter(|&k| times[k] != 0.0).map(|k| -times[k]).product();
        numerator / denominator(j)
    };
    let mut motion = Motion { velocity: Vector6::zeros(), acceleration: Vector6::zeros() };
    for (j, other) in stretch.iter().enumerate().filter(|(j, _)| times[*j] != 0.0) {
        let tangent = centre.world_from_mid.tangent_to(&other.world_from_mid);
        motion.velocity += tangent * slope(j);
        motion.acceleration += tangent * ((value(j, STEP) + value(j, -STEP)) / (STEP * STEP));
    }
    Some(motion)
}
