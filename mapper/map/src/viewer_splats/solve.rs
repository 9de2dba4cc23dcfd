//! Damped least squares within bounds, by conjugate gradients (Hestenes and Stiefel 1952), for three channels side by side.
//!
//! Minimised is `|A x - t|^2 + d^2 |x - own|^2`, with the blending weights A, the pixels t and the damping d. Steps are scaled
//! by the sums of each Gaussian's weights: a wall has a thousand times those of a speck.

use super::blending::{Blending, Colours};

/// Steps of a round.
const STEPS: usize = 12;

/// Rounds. After each, colours beyond what displays show are put back to the border, and rest there in the next if they pull
/// beyond it again: viewers clip them.
const ROUNDS: usize = 2;

/// Damping, as a weight of a pixel: what no view shows keeps its colour.
const DAMPING: f32 = 0.15;

/// The colours in `[0, 1]` next to `own` whose blended views are nearest to `targets`.
pub(super) fn solve(blending: &mut Blending, own: Colours, targets: &[Colours]) -> Colours {
    let white = own.each_ref().map(|plane| vec![1.0; plane.len()]);
    let [weights, ..] =
        blending.there_and_back(&white, |_, image| image.iter_mut().for_each(|plane| plane.fill(1.0)));
    let scale: Vec<f32> = weights.iter().map(|weight| 1.0 / (weight + DAMPING * DAMPING)).collect();
    let mut colours = own.clone();
    for _ in 0..ROUNDS {
        let residual = residual(blending, &colours, &own, targets);
        descend(blending, &mut colours, residual, &scale);
        colours.iter_mut().flatten().for_each(|colour| *colour = colour.clamp(0.0, 1.0));
    }
    colours
}

/// Minus half the gradient of what is minimised; zero where it pulls a colour beyond its bound.
fn residual(blending: &mut Blending, colours: &Colours, own: &Colours, targets: &[Colours]) -> Colours {
    let mut residual = blending.there_and_back(colours, |k, image| {
        for (plane, target) in image.iter_mut().zip(&targets[k]) {
            plane.iter_mut().zip(target).for_each(|(shown, target)| *shown = target - *shown);
        }
    });
    for ((plane, colours), own) in residual.iter_mut().zip(colours).zip(own) {
        for ((residual, colour), own) in plane.iter_mut().zip(colours).zip(own) {
            *residual -= DAMPING * DAMPING * (colour - own);
            if (*colour <= 0.0 && *residual < 0.0) || (*colour >= 1.0 && *residual > 0.0) {
                *residual = 0.0;
            }
        }
    }
    residual
}

/// One round. Colours without a residual stay as they are.
fn descend(blending: &mut Blending, colours: &mut Colours, mut residual: Colours, scale: &[f32]) {
    let moves = residual.each_ref().map(|plane| plane.iter().map(|r| *r != 0.0).collect::<Vec<bool>>());
    let mut scaled = times(&residual, scale);
    let mut direction = scaled.clone();
    let mut square = dot(&residual, &scaled);
    for _ in 0..STEPS {
        let curved = curvature(blending, &direction, &moves);
        let curvature = dot(&direction, &curved);
        for channel in 0..3 {
            // Nothing is left to do, or nothing of this channel is seen.
            if curvature[channel] <= 0.0 || curvature[channel].is_nan() {
                continue;
            }
            let step = (square[channel] / curvature[channel]) as f32;
            add(&mut colours[channel], step, &direction[channel]);
            add(&mut residual[channel], -step, &curved[channel]);
        }
        scaled = times(&residual, scale);
        let before = core::mem::replace(&mut square, dot(&residual, &scaled));
        for channel in 0..3 {
            let share = if before[channel] > 0.0 { (square[channel] / before[channel]) as f32 } else { 0.0 };
            let pairs = direction[channel].iter_mut().zip(&scaled[channel]);
            pairs.for_each(|(direction, scaled)| *direction = scaled + share * *direction);
        }
    }
}

/// `(A^T A + d^2) direction`, zero where nothing moves.
fn curvature(blending: &mut Blending, direction: &Colours, moves: &[Vec<bool>; 3]) -> Colours {
    // The rasterizer takes colours up to a limit.
    let largest = |plane: &Vec<f32>| plane.iter().fold(f32::MIN_POSITIVE, |most, x| most.max(x.abs()));
    let largest = direction.each_ref().map(largest);
    let unit = core::array::from_fn(|channel| {
        direction[channel].iter().map(|x| x / largest[channel]).collect::<Vec<f32>>()
    });
    let mut curved = blending.there_and_back(&unit, |_, _| ());
    for channel in 0..3 {
        let all = curved[channel].iter_mut().zip(&direction[channel]).zip(&moves[channel]);
        for ((curved, direction), moves) in all {
            let value = largest[channel] * *curved + DAMPING * DAMPING * direction;
            *curved = if *moves { value } else { 0.0 };
        }
    }
    curved
}

fn times(colours: &Colours, scale: &[f32]) -> Colours {
    colours.each_ref().map(|plane| plane.iter().zip(scale).map(|(x, scale)| x * scale).collect())
}

fn add(sum: &mut [f32], factor: f32, other: &[f32]) {
    sum.iter_mut().zip(other).for_each(|(sum, x)| *sum += factor * x);
}

/// By channel, in the order of the Gaussians: threads do not matter.
fn dot(a: &Colours, b: &Colours) -> [f64; 3] {
    core::array::from_fn(|channel| {
        a[channel].iter().zip(&b[channel]).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
    })
}
