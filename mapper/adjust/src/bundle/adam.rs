//! Adam (Kingma and Ba 2015) over the Gaussians that a view draws.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use mba_raster::gaussians::{
    COLOUR, Gaussians, LOG_SCALE, MEAN, OPACITY_LOGIT, PARAMETERS, PlanesMut, ROTATION,
};

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

impl StepLengths {
    /// All lengths times `factor`.
    #[must_use]
    pub(super) fn scaled(&self, factor: f32) -> Self {
        Self {
            mean: self.mean * factor,
            log_scale: self.log_scale * factor,
            rotation: self.rotation * factor,
            opacity: self.opacity * factor,
            colour: self.colour * factor,
        }
    }
}

/// First and second moments of the gradients of a set of Gaussians, and how often each was updated.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Moments {
    /// Means of gradients.
    pub(super) first: Gaussians,
    /// Means of squared gradients.
    pub(super) second: Gaussians,
    /// Number of updates, per Gaussian.
    pub(super) updates: Vec<u32>,
}

/// A range of everything that a step touches.
struct Piece<'a> {
    /// First Gaussian of the range.
    start: usize,
    values: PlanesMut<'a>,
    first: PlanesMut<'a>,
    second: PlanesMut<'a>,
    updates: &'a mut [u32],
}

impl<'a> Piece<'a> {
    /// The first Gaussians of the range, and the rest.
    fn split(self) -> (Self, Self) {
        let (values, values_rest) = self.values.split_at(PIECE);
        let (first, first_rest) = self.first.split_at(PIECE);
        let (second, second_rest) = self.second.split_at(PIECE);
        let (updates, updates_rest) = self.updates.split_at_mut(values.len());
        let start = self.start + values.len();
        let rest = Self {
            start,
            values: values_rest,
            first: first_rest,
            second: second_rest,
            updates: updates_rest,
        };
        (Self { start: self.start, values, first, second, updates }, rest)
    }

    /// Moves the Gaussians of the range that are drawn.
    fn step(mut self, gradient: &Gaussians, drawn: &[bool], lengths: &StepLengths) {
        for i in 0..self.values.len() {
            let index = self.start + i;
            if drawn.get(index).is_some_and(|drawn| *drawn) {
                let by = core::array::from_fn(|k| gradient.planes()[k][index]);
                self.step_one(i, &by, lengths);
            }
        }
    }

    fn step_one(&mut self, i: usize, gradient: &[f32; PARAMETERS], lengths: &StepLengths) {
        self.updates[i] += 1;
        let updates = self.updates[i].min(10_000) as i32;
        let corrections = [BETA_1, BETA_2].map(|beta| 1.0 / (1.0 - beta.powi(updates)));
        let units = units(&self.values, i, lengths);
        let squares = squares(gradient);
        for (k, (unit, square)) in units.into_iter().zip(squares).enumerate() {
            let (first, second) = (&mut self.first.planes[k][i], &mut self.second.planes[k][i]);
            *first = BETA_1 * *first + (1.0 - BETA_1) * gradient[k];
            *second = BETA_2 * *second + (1.0 - BETA_2) * square;
            let scale = (*second * corrections[1]).sqrt() + EPSILON;
            self.values.planes[k][i] -= unit * *first * corrections[0] / scale;
        }
        normalise(&mut self.values, i);
    }
}

/// Moves the Gaussians that are marked in `drawn` one step against `gradient`.
pub(super) fn step(
    gaussians: &mut Gaussians,
    gradient: &Gaussians,
    drawn: &[bool],
    lengths: &StepLengths,
    moments: &mut Moments,
) {
    let mut rest = Piece {
        start: 0,
        values: gaussians.planes_mut(),
        first: moments.first.planes_mut(),
        second: moments.second.planes_mut(),
        updates: &mut moments.updates,
    };
    let mut pieces = Vec::new();
    while !rest.values.is_empty() {
        let (piece, others) = rest.split();
        pieces.push(piece);
        rest = others;
    }
    pieces.into_par_iter().for_each(|piece| piece.step(gradient, drawn, lengths));
}

/// Squares of the gradient that steps are measured by. The three of a centre share one: views hardly tell how far away a
/// Gaussian is, and with a scale of its own every bit of noise would move it along the line of sight, where whatever
/// comes nearer hides the rest.
fn squares(gradient: &[f32; PARAMETERS]) -> [f32; PARAMETERS] {
    let mut squares = gradient.map(|value| value * value);
    let of_mean = squares[MEAN..MEAN + 3].iter().sum::<f32>() / 3.0;
    squares[MEAN..MEAN + 3].fill(of_mean);
    squares
}

/// Length of a step of every parameter of Gaussian `i`.
fn units(values: &PlanesMut<'_>, i: usize, lengths: &StepLengths) -> [f32; PARAMETERS] {
    let plane = |k: usize| values.planes[k][i];
    let size = ((plane(LOG_SCALE) + plane(LOG_SCALE + 1) + plane(LOG_SCALE + 2)) / 3.0).exp();
    // Light is the square of the display value, roughly; the slope of a square is twice its root.
    let colour = |channel: usize| lengths.colour * (2.0 * plane(COLOUR + channel).max(0.0).sqrt() + 0.02);
    let mut unit = [0.0; PARAMETERS];
    unit[MEAN..MEAN + 3].fill(lengths.mean * size);
    unit[LOG_SCALE..LOG_SCALE + 3].fill(lengths.log_scale);
    unit[ROTATION..ROTATION + 4].fill(lengths.rotation);
    unit[OPACITY_LOGIT] = lengths.opacity;
    unit[COLOUR..COLOUR + 3].copy_from_slice(&[colour(0), colour(1), colour(2)]);
    unit
}

/// Scales the quaternion of Gaussian `i` to unit length.
fn normalise(values: &mut PlanesMut<'_>, i: usize) {
    let norm = (ROTATION..ROTATION + 4).map(|k| values.planes[k][i].powi(2)).sum::<f32>().sqrt();
    if norm > 1e-6 {
        (ROTATION..ROTATION + 4).for_each(|k| values.planes[k][i] /= norm);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mba_raster::gaussians::Gaussian;

    const LENGTHS: StepLengths =
        StepLengths { mean: 0.1, log_scale: 0.02, rotation: 0.01, opacity: 0.05, colour: 0.01 };

    fn gaussian() -> Gaussian {
        Gaussian {
            mean: [1.0, 2.0, 3.0],
            log_scale: [0.05_f32.ln(); 3],
            rotation: [1.0, 0.0, 0.0, 0.0],
            opacity_logit: 1.0,
            colour: [0.25, 0.0, 1.0],
        }
    }

    fn stepped(gradient: &Gaussian, drawn: bool) -> Gaussian {
        let mut map: Gaussians = [gaussian()].into_iter().collect();
        let gradient: Gaussians = [*gradient].into_iter().collect();
        let mut moments =
            Moments { first: Gaussians::zeros(1), second: Gaussians::zeros(1), updates: vec![0] };
        step(&mut map, &gradient, &[drawn], &LENGTHS, &mut moments);
        map.get(0).unwrap()
    }

    #[test]
    fn the_first_step_has_its_length_in_every_unit() {
        let gradient = Gaussian { opacity_logit: -7.0, colour: [1e-6, 0.0, 3.0], ..Gaussian::default() };
        let after = stepped(&gradient, true);
        assert!((after.opacity_logit - 1.05).abs() < 1e-5);
        // 0.01 (2 sqrt(0.25) + 0.02) and 0.01 (2 + 0.02).
        assert!((after.colour[0] - (0.25 - 0.0102)).abs() < 1e-5 && (after.colour[2] - 0.9798).abs() < 1e-5);
        assert_eq!((after.colour[1], after.mean), (0.0, gaussian().mean));
    }

    #[test]
    fn a_centre_moves_along_its_gradient_by_a_fraction_of_its_size() {
        let after = stepped(&Gaussian { mean: [4.0, 0.0, -0.004], ..Gaussian::default() }, true);
        // One scale for all three: sqrt(16/3), so x moves by sqrt(3) 0.1 0.05 m, and z a thousandth of that.
        assert!((after.mean[0] - (1.0 - 3.0_f32.sqrt() * 0.005)).abs() < 1e-6, "{:?}", after.mean);
        assert!((after.mean[2] - 3.0).abs() < 2e-5);
    }

    #[test]
    fn what_is_not_drawn_stays_and_quaternions_keep_their_length() {
        let gradient = Gaussian { mean: [1.0; 3], rotation: [0.3, -0.2, 0.1, 0.9], ..Gaussian::default() };
        assert_eq!(stepped(&gradient, false), gaussian());
        let norm: f32 = stepped(&gradient, true).rotation.iter().map(|q| q * q).sum();
        assert!((norm - 1.0).abs() < 1e-6);
    }
}
