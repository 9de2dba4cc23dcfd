//! Adam (Kingma and Ba 2015) over the Gaussians that a view draws.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::gaussians::{COLOUR, Gaussians, LOG_SCALE, MEAN, OPACITY_LOGIT, PARAMETERS, PlanesMut, ROTATION};

/// Decay of the mean of the gradient.
const BETA_1: f32 = 0.9;
/// Decay of the mean of its square.
const BETA_2: f32 = 0.99;
/// Keeps a step finite where there never was a gradient.
const EPSILON: f32 = 1e-12;
/// Gaussians per piece of work.
const PIECE: usize = 2048;

/// Step lengths of the parameters, each in its own unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepLengths {
    /// Of centres, as a fraction of the Gaussian's own size.
    pub mean: f32,
    /// Of log scales.
    pub log_scale: f32,
    /// Of quaternions of unit length.
    pub rotation: f32,
    /// Of opacity logits.
    pub opacity: f32,
    /// Of colours, in display values for a display curve that is a square root.
    pub colour: f32,
}

/// First and second moments of the gradients of a set of Gaussians, and how often each was updated.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moments {
    /// Means of gradients.
    pub first: Gaussians,
    /// Means of squared gradients.
    pub second: Gaussians,
    /// Number of updates, per Gaussian.
    pub updates: Vec<u32>,
}

impl Moments {
    /// No moments for `count` Gaussians.
    #[must_use]
    pub fn zeros(count: usize) -> Self {
        Self { first: Gaussians::zeros(count), second: Gaussians::zeros(count), updates: vec![0; count] }
    }
}

/// Moves the Gaussians for which `drawn` says so one step against `gradient`.
pub fn step(
    gaussians: &mut Gaussians,
    gradient: &Gaussians,
    drawn: &(dyn Fn(usize) -> bool + Sync),
    lengths: &StepLengths,
    moments: &mut Moments,
) {
    let mut pieces = Vec::new();
    let mut rest = (gaussians.planes_mut(), moments.first.planes_mut(), moments.second.planes_mut());
    let mut updates = moments.updates.as_mut_slice();
    let mut start = 0;
    while !rest.0.is_empty() {
        let (values, values_rest) = rest.0.split_at(PIECE);
        let (first, first_rest) = rest.1.split_at(PIECE);
        let (second, second_rest) = rest.2.split_at(PIECE);
        let (counts, counts_rest) = updates.split_at_mut(values.len());
        let len = values.len();
        pieces.push((start, values, first, second, counts));
        rest = (values_rest, first_rest, second_rest);
        updates = counts_rest;
        start += len;
    }
    pieces.into_par_iter().for_each(|(start, mut values, mut first, mut second, counts)| {
        step_piece(start, &mut values, gradient, drawn, lengths, &mut first, &mut second, counts);
    });
}

#[expect(clippy::too_many_arguments, reason = "one range of everything that a step touches")]
fn step_piece(
    start: usize,
    values: &mut PlanesMut<'_>,
    gradient: &Gaussians,
    drawn: &(dyn Fn(usize) -> bool + Sync),
    lengths: &StepLengths,
    first: &mut PlanesMut<'_>,
    second: &mut PlanesMut<'_>,
    counts: &mut [u32],
) {
    for i in 0..values.len() {
        if !drawn(start + i) {
            continue;
        }
        counts[i] += 1;
        let t = counts[i].min(10_000) as i32;
        let correction_1 = 1.0 / (1.0 - BETA_1.powi(t));
        let correction_2 = 1.0 / (1.0 - BETA_2.powi(t));
        let unit = units(values, i, lengths);
        for k in 0..PARAMETERS {
            let g = gradient.planes()[k][start + i];
            let m = &mut first.planes[k][i];
            let v = &mut second.planes[k][i];
            *m = BETA_1 * *m + (1.0 - BETA_1) * g;
            *v = BETA_2 * *v + (1.0 - BETA_2) * g * g;
            let step = unit[k] * (*m * correction_1) / ((*v * correction_2).sqrt() + EPSILON);
            values.planes[k][i] -= step;
        }
        normalise(values, i);
    }
}

/// Length of a step of every parameter of Gaussian `i`.
fn units(values: &PlanesMut<'_>, i: usize, lengths: &StepLengths) -> [f32; PARAMETERS] {
    let plane = |k: usize| values.planes[k][i];
    let size = ((plane(LOG_SCALE) + plane(LOG_SCALE + 1) + plane(LOG_SCALE + 2)) / 3.0).exp();
    let mut unit = [0.0; PARAMETERS];
    unit[MEAN..MEAN + 3].fill(lengths.mean * size);
    unit[LOG_SCALE..LOG_SCALE + 3].fill(lengths.log_scale);
    unit[ROTATION..ROTATION + 4].fill(lengths.rotation);
    unit[OPACITY_LOGIT] = lengths.opacity;
    for channel in COLOUR..COLOUR + 3 {
        // Light is the square of the display value, roughly; the slope of a square is twice its root.
        unit[channel] = lengths.colour * (2.0 * plane(channel).max(0.0).sqrt() + 0.02);
    }
    unit
}

/// Scales the quaternion of Gaussian `i` to unit length.
fn normalise(values: &mut PlanesMut<'_>, i: usize) {
    let norm = (ROTATION..ROTATION + 4).map(|k| values.planes[k][i].powi(2)).sum::<f32>().sqrt();
    if norm > 1e-6 {
        (ROTATION..ROTATION + 4).for_each(|k| values.planes[k][i] /= norm);
    }
}
