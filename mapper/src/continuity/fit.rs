//! The smooth path through a part of the sequence, and what it says about every exposure on it.

use mba_tracker::geometry::RigidTransform;
use mba_tracker::geometry::so3;
use mba_tracker::trajectory::ExposureTrajectory;
use nalgebra::Vector3;

use super::ContinuitySettings;
use super::direction::reversed_exposures;
use super::frame::PoseNoise;
use super::problem::{Observation, Problem};
use super::scales::{Sample, typical_derivatives};
use super::spline::{Knots, Part, Path};
use crate::evaluation::quantile;

/// Frames from which a path tells which of them is wrong.
pub(super) const FEWEST_FRAMES: usize = 5;

/// Median length of a vector of six standard normal numbers.
const MEDIAN_NORM_6: f64 = 2.313;

/// Error of a prediction from both sides, and from one, in units of jerk × (frame interval)³.
const BRIDGED_ERROR: f64 = 0.05;
const CONTINUED_ERROR: f64 = 0.5;

/// Increments below this many metres or radians do not matter.
const SETTLED: f64 = 1e-5;

/// A tracked frame of the part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    /// Mid exposure, seconds.
    pub(super) timestamp: f64,
    /// Opening and closing, seconds.
    pub(super) shutter: [f64; 2],
    pub(super) exposure: ExposureTrajectory,
    pub(super) noise: PoseNoise,
}

impl Measured {
    pub(super) fn seconds(&self) -> f64 {
        self.shutter[1] - self.shutter[0]
    }

    pub(super) fn noise_of(&self, part: Part) -> f64 {
        match part {
            Part::Translation => self.noise.translation,
            Part::Rotation => self.noise.rotation,
        }
    }

    pub(super) fn sample(&self) -> Sample {
        Sample { timestamp: self.timestamp, world_from_camera: self.exposure.mid() }
    }
}

/// What the path says about one exposure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Judgement {
    /// It was measured against time.
    pub(super) reversed: bool,
    /// It lies elsewhere.
    pub(super) outlier: bool,
}

impl Judgement {
    fn directed(self, exposure: &ExposureTrajectory) -> ExposureTrajectory {
        if self.reversed { exposure.reversed() } else { *exposure }
    }
}

/// A path and its judgements, one per measured frame.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub(super) path: Path,
    pub(super) judgements: Vec<Judgement>,
    /// Huber cost of the exposures as they were measured.
    pub(super) mismatch: f64,
    /// Huber cost of those that agree, in their direction.
    pub(super) mismatch_of_kept: f64,
    /// Cost of the path's jerk.
    pub(super) bending: f64,
}

/// Fits a path to at least [`FEWEST_FRAMES`] frames of increasing time; `interval` is the usual time between frames.
pub(super) fn fit(
    measured: &[Measured],
    interval: f64,
    settings: &ContinuitySettings,
) -> Result<Fit, String> {
    let mut state = State::new(measured, interval, settings);
    for round in 0..settings.rounds {
        let largest = state.solve()?;
        let judgements = state.judge();
        let settled = judgements == state.judgements && largest < SETTLED;
        state.judgements = judgements;
        if settled && round > 0 {
            break;
        }
    }
    Ok(state.into_fit())
}

struct State<'a> {
    measured: &'a [Measured],
    settings: &'a ContinuitySettings,
    path: Path,
    judgements: Vec<Judgement>,
    /// Usual jerk near each frame, translation and rotation.
    jerks: [Vec<f64>; 2],
}

impl<'a> State<'a> {
    fn new(measured: &'a [Measured], interval: f64, settings: &'a ContinuitySettings) -> Self {
        let reversed = reversed_exposures(measured, settings.swap_evidence);
        let judgements = reversed.into_iter().map(|reversed| Judgement { reversed, outlier: false });
        let jerks = Part::BOTH.map(|part| usual_jerk(measured, part, interval, settings));
        let path = first_path(measured, interval / settings.control_points_per_frame);
        Self { measured, settings, path, judgements: judgements.collect(), jerks }
    }

    /// Solves for both halves of the poses and returns the largest increment.
    fn solve(&mut self) -> Result<f64, String> {
        let problems = Part::BOTH.map(|part| self.problem(part));
        let (translation, rotation) = rayon::join(|| problems[0].solve(), || problems[1].solve());
        let mut largest = 0.0_f64;
        for (part, increments) in [(Part::Translation, translation?), (Part::Rotation, rotation?)] {
            largest = increments.iter().map(Vector3::norm).fold(largest, f64::max);
            self.path.advance(part, &increments);
        }
        Ok(largest)
    }

    fn problem(&self, part: Part) -> Problem {
        let limits = match part {
            Part::Translation => self.settings.translation,
            Part::Rotation => self.settings.rotation,
        };
        let step = self.path.knots.step;
        Problem {
            observations: self.observations(part),
            steps: self.path.steps(part),
            bending: self.bending_scales(part),
            max_second: limits.acceleration * step.powi(2),
            max_third: limits.jerk * step.powi(3),
            huber: self.settings.huber,
        }
    }

    fn observations(&self, part: Part) -> Vec<Observation> {
        let agreeing = self.measured.iter().zip(&self.judgements).filter(|(_, judgement)| !judgement.outlier);
        agreeing
            .map(|(frame, judgement)| Observation {
                supports: frame.shutter.map(|time| self.path.knots.support(time)),
                residuals: self.residuals(frame, *judgement, part),
                sigma: frame.noise_of(part),
            })
            .collect()
    }

    /// From the path to the ends of an exposure.
    fn residuals(&self, frame: &Measured, judgement: Judgement, part: Part) -> [Vector3<f64>; 2] {
        let expected = self.path.exposure(frame.shutter);
        let found = judgement.directed(&frame.exposure);
        [part.step(&expected.start, &found.start), part.step(&expected.end, &found.end)]
    }

    /// Standard deviation of every third difference of control points.
    fn bending_scales(&self, part: Part) -> Vec<f64> {
        let knots = &self.path.knots;
        let jerks = &self.jerks[part as usize];
        (0..knots.count - 3)
            .map(|k| {
                let middle = 0.5 * (knots.time(k + 1) + knots.time(k + 2));
                let after = self.measured.partition_point(|frame| frame.timestamp < middle);
                let near = after.min(jerks.len() - 1);
                jerks[near].max(jerks[near.saturating_sub(1)]) * knots.step.powi(3)
            })
            .collect()
    }

    /// Judges every frame by the current path.
    fn judge(&self) -> Vec<Judgement> {
        let tolerances = self.tolerances();
        let norms = |k: usize, judgement: Judgement| {
            Part::BOTH.map(|part| {
                let tolerance = tolerances[part as usize][k];
                norm(&self.residuals(&self.measured[k], judgement, part)) / tolerance
            })
        };
        (0..self.measured.len())
            .map(|k| {
                let here = Judgement { outlier: false, ..self.judgements[k] };
                let other = Judgement { reversed: !here.reversed, outlier: false };
                let [norms_here, norms_other] = [here, other].map(|judgement| norms(k, judgement));
                let gain = 0.5 * (sum_of_squares(&norms_here) - sum_of_squares(&norms_other));
                let swap = gain > self.settings.swap_evidence;
                let (best, norms) = if swap { (other, norms_other) } else { (here, norms_here) };
                Judgement { outlier: norms.iter().any(|&norm| norm > self.settings.outlier), ..best }
            })
            .collect()
    }

    /// Standard deviation of the residual of every frame: its noise and the error of predicting it, grown to what is
    /// typical of the sequence.
    fn tolerances(&self) -> [Vec<f64>; 2] {
        Part::BOTH.map(|part| {
            let mut tolerances: Vec<f64> =
                (0..self.measured.len()).map(|k| self.expected_residual(k, part)).collect();
            let norms: Vec<f64> = self
                .measured
                .iter()
                .zip(&self.judgements)
                .zip(&tolerances)
                .map(|((frame, &judgement), tolerance)| {
                    norm(&self.residuals(frame, judgement, part)) / tolerance
                })
                .collect();
            let typical = quantile(&norms, 0.5).unwrap_or(0.0) / MEDIAN_NORM_6;
            tolerances.iter_mut().for_each(|tolerance| *tolerance *= typical.max(1.0));
            tolerances
        })
    }

    fn expected_residual(&self, k: usize, part: Part) -> f64 {
        let usable = |k: &usize| !self.judgements[*k].outlier;
        let before =
            (0..k).rev().find(usable).map(|l| self.measured[k].timestamp - self.measured[l].timestamp);
        let after = (k + 1..self.measured.len())
            .find(usable)
            .map(|l| self.measured[l].timestamp - self.measured[k].timestamp);
        let (seconds, error) = match (before, after) {
            (Some(before), Some(after)) => (before.max(after), BRIDGED_ERROR),
            (Some(one), None) | (None, Some(one)) => (one, CONTINUED_ERROR),
            (None, None) => (0.0, 0.0),
        };
        let predicted = error * self.jerks[part as usize][k] * seconds.powi(3);
        self.measured[k].noise_of(part).hypot(predicted)
    }

    fn into_fit(self) -> Fit {
        let huber = |frame: &Measured, judgement: Judgement| -> f64 {
            let cost = |part: Part| {
                huber_cost(
                    norm(&self.residuals(frame, judgement, part)) / frame.noise_of(part),
                    self.settings.huber,
                )
            };
            Part::BOTH.into_iter().map(cost).sum()
        };
        let frames = || self.measured.iter().zip(&self.judgements);
        let mismatch = self.measured.iter().map(|frame| huber(frame, Judgement::default())).sum();
        let mismatch_of_kept =
            frames().filter(|(_, j)| !j.outlier).map(|(frame, &judgement)| huber(frame, judgement)).sum();
        let bending = Part::BOTH.iter().map(|&part| self.bending_cost(part)).sum();
        Fit { mismatch, mismatch_of_kept, bending, path: self.path, judgements: self.judgements }
    }

    fn bending_cost(&self, part: Part) -> f64 {
        let steps = self.path.steps(part);
        let thirds = steps.windows(3).map(|w| w[2] - w[1] * 2.0 + w[0]);
        thirds.zip(self.bending_scales(part)).map(|(third, sigma)| 0.5 * (third / sigma).norm_squared()).sum()
    }
}

fn norm(residuals: &[Vector3<f64>; 2]) -> f64 {
    residuals[0].norm().hypot(residuals[1].norm())
}

fn sum_of_squares(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum()
}

fn huber_cost(norm: f64, width: f64) -> f64 {
    if norm <= width { 0.5 * norm * norm } else { width * (norm - 0.5 * width) }
}

/// The jerk that costs nothing unusual near each frame.
fn usual_jerk(measured: &[Measured], part: Part, interval: f64, settings: &ContinuitySettings) -> Vec<f64> {
    let samples: Vec<Sample> = measured.iter().map(Measured::sample).collect();
    let noises: Vec<f64> = measured.iter().map(|frame| frame.noise_of(part)).collect();
    // Less cannot be told from noise.
    let floor = quantile(&noises, 0.5).unwrap_or(0.0) / interval.powi(3);
    let typical = typical_derivatives(&samples, part, 3);
    typical.iter().map(|jerk| (settings.jerk_tolerance * jerk).max(floor)).collect()
}

/// Straight lines between the middles of the exposures.
fn first_path(measured: &[Measured], step: f64) -> Path {
    let ends = measured.iter().flat_map(|frame| frame.shutter);
    let (start, end) =
        ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), time| (low.min(time), high.max(time)));
    let knots = Knots::over([start, end], step);
    let controls = (0..knots.count).map(|k| between_middles(measured, knots.time(k))).collect();
    Path { knots, controls }
}

fn between_middles(measured: &[Measured], time: f64) -> RigidTransform {
    let after = measured.partition_point(|frame| frame.timestamp <= time).clamp(1, measured.len() - 1);
    let [a, b] = [&measured[after - 1], &measured[after]];
    let share = ((time - a.timestamp) / (b.timestamp - a.timestamp)).clamp(0.0, 1.0);
    let [from, to] = [a, b].map(|frame| frame.exposure.mid());
    let turn = so3::exp(&(Part::Rotation.step(&from, &to) * share));
    RigidTransform {
        rotation: so3::renormalised(&(turn * from.rotation)),
        translation: from.translation + Part::Translation.step(&from, &to) * share,
    }
}
