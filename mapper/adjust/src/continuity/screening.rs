//! Which exposures lie elsewhere: each is compared with what the frames around it predict for its middle.
//!
//! A jolt of the hand is as rare and as large as an outlier, and tells itself apart by the velocities: those of the
//! exposures before and after a jolt agree with it. The path alone could follow either.

use mba_io::statistics::quantile;
use nalgebra::{DMatrix, DVector, Vector3};

use super::ContinuitySettings;
use super::direction::reversed_exposures;
use super::measured::{Judgement, Measured};
use super::scales::{MEDIAN_NORM_3, Sample, derivative, typical_derivatives};
use super::spline::Part;

/// Error of a prediction from both sides, and from one, in units of jerk × (time to the neighbour)³.
const BRIDGED_ERROR: f64 = 0.05;
const CONTINUED_ERROR: f64 = 0.5;

/// Frames to either side that predict: the positions of all, the velocity of the nearest.
const PREDICTORS: usize = 2;

/// Frames to either side whose jerk tells what to expect in between.
const WITNESSES: usize = 3;

/// More outliers in a row than this are no outliers but another opinion about the world.
const LONGEST_RUN: usize = 4;

/// Judges every frame of a part by its neighbours: takes out the worst ones, and looks again, since an outlier also
/// spoils the directions and the predictions of its neighbours.
pub(super) fn judge(measured: &[Measured], settings: &ContinuitySettings) -> Vec<Judgement> {
    let mut judgements = vec![Judgement::default(); measured.len()];
    loop {
        set_directions(measured, &mut judgements, settings.swap_evidence);
        let outliers = Screen::new(measured, &judgements).worst_frames(settings.outlier);
        if outliers.is_empty() {
            break;
        }
        outliers.into_iter().for_each(|k| judgements[k].outlier = true);
    }
    forgive_long_runs(&mut judgements);
    judgements
}

/// Directions of the frames in their place.
fn set_directions(measured: &[Measured], judgements: &mut [Judgement], evidence: f64) {
    let in_place: Vec<usize> = (0..measured.len()).filter(|&k| !judgements[k].outlier).collect();
    let frames: Vec<Measured> = in_place.iter().map(|&k| measured[k]).collect();
    for (&k, reversed) in in_place.iter().zip(reversed_exposures(&frames, evidence)) {
        judgements[k].reversed = reversed;
    }
}

struct Screen<'a> {
    measured: &'a [Measured],
    judgements: &'a [Judgement],
    /// Usual jerk near each frame, translation and rotation.
    jerks: [Vec<f64>; 2],
}

impl<'a> Screen<'a> {
    fn new(measured: &'a [Measured], judgements: &'a [Judgement]) -> Self {
        let samples: Vec<Sample> = measured.iter().map(Measured::sample).collect();
        let jerks = Part::BOTH.map(|part| typical_derivatives(&samples, part, 3));
        Self { measured, judgements, jerks }
    }

    /// Frames further than `outlier` expected errors from their prediction that are the worst of their neighbourhood.
    fn worst_frames(&self, outlier: f64) -> Vec<usize> {
        let surprises = self.surprises();
        let is_worst = |&k: &usize| {
            let around = self.before(k, None).take(WITNESSES).chain(self.after(k, None).take(WITNESSES));
            around.into_iter().all(|l| (surprises[l], l) < (surprises[k], k))
        };
        let worst = (0..surprises.len()).filter(|&k| surprises[k] > outlier).filter(is_worst);
        let mut outliers: Vec<usize> = worst.map(|k| self.culprit(k)).collect();
        outliers.dedup();
        outliers
    }

    /// The frame whose absence makes the rest agree best: `k` or one beside it. At the ends of a sequence an outlier
    /// surprises less than its neighbour, which is expected to lie between two others.
    fn culprit(&self, k: usize) -> usize {
        let beside = self.before(k, None).take(1).chain(self.after(k, None).take(1));
        let free = |l: &usize| !self.measured[*l].held.place;
        let candidates: Vec<usize> = [k].into_iter().chain(beside.filter(free)).collect();
        // The largest error that is left among the others without one of them.
        let disagreement = |&absent: &usize| {
            let others = candidates.iter().filter(|&&other| other != absent);
            others.flat_map(|&other| self.errors(other, Some(absent), false)).fold(0.0, f64::max)
        };
        let mut best = (k, disagreement(&k));
        for &candidate in &candidates[1..] {
            let rest = disagreement(&candidate);
            if rest < best.1 {
                best = (candidate, rest);
            }
        }
        best.0
    }

    /// Distance of every frame in its place from its prediction in expected errors, which grow to what is typical of
    /// the part; 0 for outliers, and for frames that other evidence holds in their place.
    fn surprises(&self) -> Vec<f64> {
        let suspect = |k: usize| !self.judgements[k].outlier && !self.measured[k].held.place;
        let errors: Vec<Option<[f64; 2]>> =
            (0..self.measured.len()).map(|k| suspect(k).then(|| self.errors(k, None, true))).collect();
        let growth = [0, 1].map(|part| {
            let of_part: Vec<f64> = errors.iter().flatten().map(|both| both[part]).collect();
            (quantile(&of_part, 0.5).unwrap_or(0.0) / MEDIAN_NORM_3).max(1.0)
        });
        let surprise =
            |[translation, rotation]: [f64; 2]| (translation / growth[0]).max(rotation / growth[1]);
        errors.into_iter().map(|both| both.map_or(0.0, surprise)).collect()
    }

    /// Frames in their place before `k`, nearest first, without the absent one.
    fn before(&self, k: usize, absent: Option<usize>) -> impl Iterator<Item = usize> {
        (0..k).rev().filter(move |&l| !self.judgements[l].outlier && Some(l) != absent)
    }

    /// The same after `k`.
    fn after(&self, k: usize, absent: Option<usize>) -> impl Iterator<Item = usize> {
        (k + 1..self.measured.len()).filter(move |&l| !self.judgements[l].outlier && Some(l) != absent)
    }

    /// Distance of the middle of frame `k` from what the others, without the absent one, predict: per part, in standard
    /// deviations of noise or of noise and what an unsteady hand adds.
    fn errors(&self, k: usize, absent: Option<usize>, unsteady: bool) -> [f64; 2] {
        let before: Vec<usize> = self.before(k, absent).take(WITNESSES).collect();
        let after: Vec<usize> = self.after(k, absent).take(WITNESSES).collect();
        let conditions = self.conditions(k, &before, &after);
        let Some(weights) = interpolation_weights(&conditions) else { return [0.0; 2] };
        let weighted = || conditions.iter().zip(&weights);
        Part::BOTH.map(|part| {
            let error: Vector3<f64> = weighted().map(|(c, &w)| self.value(k, c, part) * w).sum();
            let variance: f64 = weighted().map(|(c, w)| (w * self.sigma(c, part)).powi(2)).sum();
            let noise = self.measured[k].noise_of(part).hypot(variance.sqrt());
            let motion = if unsteady { self.prediction_error(k, &before, &after, part) } else { 0.0 };
            error.norm() / noise.hypot(motion)
        })
    }

    /// What is known near frame `k`; time runs from it.
    fn conditions(&self, k: usize, before: &[usize], after: &[usize]) -> Vec<Condition> {
        let time = |frame: usize| self.measured[frame].timestamp - self.measured[k].timestamp;
        let mut conditions = Vec::with_capacity(2 * PREDICTORS + 2);
        for side in [before, after] {
            for (place, &frame) in side.iter().take(PREDICTORS).enumerate() {
                conditions.push(Condition { frame, time: time(frame), velocity: false });
                if place == 0 && self.measured[frame].has_velocity() {
                    conditions.push(Condition { frame, time: time(frame), velocity: true });
                }
            }
        }
        conditions
    }

    /// Position as seen from the middle of frame `k`, or velocity.
    fn value(&self, k: usize, condition: &Condition, part: Part) -> Vector3<f64> {
        let frame = &self.measured[condition.frame];
        if condition.velocity {
            frame.velocity(part, self.judgements[condition.frame].reversed)
        } else {
            part.step(&self.measured[k].exposure.mid(), &frame.exposure.mid())
        }
    }

    fn sigma(&self, condition: &Condition, part: Part) -> f64 {
        let frame = &self.measured[condition.frame];
        if condition.velocity { frame.velocity_sigma(part) } else { frame.noise_of(part) }
    }

    fn prediction_error(&self, k: usize, before: &[usize], after: &[usize], part: Part) -> f64 {
        let time = |frame: &usize| (self.measured[*frame].timestamp - self.measured[k].timestamp).abs();
        let nearest = [before.first(), after.first()].map(|frame| frame.map(time));
        let (seconds, error) = match nearest {
            [Some(before), Some(after)] => (before.max(after), BRIDGED_ERROR),
            [one, other] => (one.or(other).unwrap_or(0.0), CONTINUED_ERROR),
        };
        let around: Vec<Sample> =
            before.iter().rev().chain(after).map(|&frame| self.measured[frame].sample()).collect();
        let witnessed = around.windows(4).map(|window| derivative(window, part).norm() / MEDIAN_NORM_3);
        error * witnessed.fold(self.jerks[part as usize][k], f64::max) * seconds.powi(3)
    }
}

/// Position or velocity of a frame at a time.
struct Condition {
    frame: usize,
    time: f64,
    velocity: bool,
}

/// Weights of the conditions in the value at time 0 of the polynomial that meets all of them; `None` if too few.
fn interpolation_weights(conditions: &[Condition]) -> Option<Vec<f64>> {
    let count = conditions.len();
    if count < 3 {
        return None;
    }
    // Powers of times near 1 are well conditioned.
    let unit = conditions.iter().map(|c| c.time.abs()).fold(0.0, f64::max);
    let matrix = DMatrix::from_fn(count, count, |power, k| {
        let Condition { time, velocity, .. } = conditions[k];
        let time = time / unit;
        match (velocity, power) {
            (false, power) => time.powi(power as i32),
            (true, 0) => 0.0,
            (true, power) => power as f64 * time.powi(power as i32 - 1) / unit,
        }
    });
    let mut constant = DVector::zeros(count);
    constant[0] = 1.0;
    matrix.lu().solve(&constant).map(|weights| weights.as_slice().to_vec())
}

fn forgive_long_runs(judgements: &mut [Judgement]) {
    for run in judgements.chunk_by_mut(|a, b| a.outlier == b.outlier) {
        if run.len() > LONGEST_RUN {
            run.iter_mut().for_each(|judgement| judgement.outlier = false);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_predict_a_quintic_from_four_positions_and_two_velocities() {
        let position = |t: f64| 2.0 - t + 3.0 * t.powi(2) - 20.0 * t.powi(3) + 50.0 * t.powi(5);
        let velocity = |t: f64| -1.0 + 6.0 * t - 60.0 * t.powi(2) + 250.0 * t.powi(4);
        let at = |time, velocity| Condition { frame: 0, time, velocity };
        let conditions = [
            at(-0.2, false),
            at(-0.1, false),
            at(-0.1, true),
            at(0.15, true),
            at(0.15, false),
            at(0.23, false),
        ];
        let weights = interpolation_weights(&conditions).unwrap();
        let value = |c: &Condition| if c.velocity { velocity(c.time) } else { position(c.time) };
        let predicted: f64 = conditions.iter().zip(&weights).map(|(c, w)| w * value(c)).sum();
        assert!((predicted - 2.0).abs() < 1e-12, "{predicted}");
    }

    #[test]
    fn a_step_to_another_place_is_no_run_of_outliers() {
        let flags = [false, true, true, true, true, true, false, true, false];
        let mut judgements = flags.map(|outlier| Judgement { outlier, reversed: false });
        forgive_long_runs(&mut judgements);
        let outliers: Vec<usize> = (0..flags.len()).filter(|&k| judgements[k].outlier).collect();
        assert_eq!(outliers, [7]);
    }
}
