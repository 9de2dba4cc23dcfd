//! The direction of time of every exposure, by dynamic programming over the frames.
//!
//! The motion between two frames is told by their mid-exposure poses, which a swap does not change. A pair of exposures
//! costs the energy of the gentlest motion that has their velocities and joins their middles; the cheapest chain of
//! directions wins.

use nalgebra::Vector3;

use super::measured::Measured;
use super::scales::{Sample, typical_derivatives};
use super::spline::Part;

/// Cost at which a pair says nothing more: one of the two was aligned to the wrong place.
const HIGHEST_PAIR_COST: f64 = 60.0;

/// Energy of a pair whose six numbers are as usual.
pub(super) const USUAL_ENERGY: f64 = 3.0;

/// Which of `measured` run against time as measured. A swap has to lower the cost by `evidence`.
pub(super) fn reversed_exposures(measured: &[Measured], evidence: f64) -> Vec<bool> {
    let samples: Vec<Sample> = measured.iter().map(Measured::sample).collect();
    let accelerations = Part::BOTH.map(|part| typical_derivatives(&samples, part, 2));
    let prior_of_swap = |frame: &Measured| if frame.held.direction { f64::INFINITY } else { evidence };
    // Per direction of a frame: the lowest cost of all frames up to it, and the direction of the one before.
    let mut costs = vec![[0.0, measured.first().map_or(evidence, prior_of_swap)]];
    let mut before = vec![[false; 2]];
    for (k, pair) in measured.windows(2).enumerate() {
        // Of both ends of the pair, the larger acceleration is what to expect in between.
        let usual = [0, 1].map(|part| accelerations[part][k].max(accelerations[part][k + 1]));
        let [forward, backward] = costs[k];
        let of_pair = pair_costs(pair, usual);
        // For each direction of the second frame, the cheaper of both directions of the first.
        let step = [false, true].map(|direction| {
            let [after_forward, after_backward] = of_pair[usize::from(direction)];
            let (from_forward, from_backward) = (forward + after_forward, backward + after_backward);
            let prior = if direction { prior_of_swap(&pair[1]) } else { 0.0 };
            (from_forward.min(from_backward) + prior, from_backward < from_forward)
        });
        costs.push(step.map(|(cost, _)| cost));
        before.push(step.map(|(_, direction)| direction));
    }
    trace_back(&costs, &before)
}

fn trace_back(costs: &[[f64; 2]], before: &[[bool; 2]]) -> Vec<bool> {
    let mut direction = costs.last().is_some_and(|&[forward, backward]| backward < forward);
    let mut reversed = vec![false; costs.len()];
    for (k, choice) in before.iter().enumerate().rev() {
        reversed[k] = direction;
        direction = choice[usize::from(direction)];
    }
    reversed
}

/// Costs of a pair by the directions of its second and its first frame. Where even the best pair of directions needs an
/// unusual motion, as after a jerk of the hand, the motion was that unusual, and only what exceeds it tells directions
/// apart.
fn pair_costs(pair: &[Measured], usual_accelerations: [f64; 2]) -> [[f64; 2]; 2] {
    let energies = [false, true]
        .map(|second| [false, true].map(|first| pair_energy(pair, [first, second], usual_accelerations)));
    let least = energies.as_flattened().iter().copied().fold(f64::INFINITY, f64::min);
    let unusual = (least / USUAL_ENERGY).max(1.0);
    energies.map(|second| second.map(|energy| (energy / unusual).min(HIGHEST_PAIR_COST)))
}

/// Energy of the gentlest motion between two exposures, in units of what is usual.
fn pair_energy(pair: &[Measured], reversed: [bool; 2], usual_accelerations: [f64; 2]) -> f64 {
    let [a, b] = [&pair[0], &pair[1]];
    let seconds = b.timestamp - a.timestamp;
    let cost = |part: Part, acceleration: f64| {
        // Mean velocity between the middles, from which both exposures differ by what accelerates them.
        let middle = part.step(&a.exposure.mid(), &b.exposure.mid()) / seconds;
        let excess = |frame: &Measured, reversed| {
            if frame.has_velocity() { frame.velocity(part, reversed) - middle } else { Vector3::zeros() }
        };
        let (at_a, at_b) = (excess(a, reversed[0]), excess(b, reversed[1]));
        // Integral of the squared acceleration of the cubic between them, divided by 4 over the time.
        let energy = at_a.norm_squared() + at_a.dot(&at_b) + at_b.norm_squared();
        let noise = a.velocity_sigma(part).powi(2) + b.velocity_sigma(part).powi(2);
        energy / ((0.5 * acceleration * seconds).powi(2) + noise)
    };
    let [translation, rotation] = usual_accelerations;
    let cost = cost(Part::Translation, translation) + cost(Part::Rotation, rotation);
    0.5 * cost
}
