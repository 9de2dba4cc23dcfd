//! The smooth path through a part of the sequence, and what it says about every exposure on it.

use mba_io::statistics::quantile;
use mba_tracker::geometry::RigidTransform;
use mba_tracker::geometry::so3;
use nalgebra::Vector3;

use super::ContinuitySettings;
use super::direction::USUAL_ENERGY;
use super::measured::{Judgement, Measured};
use super::problem::{Observation, Problem};
use super::scales::{Sample, typical_derivatives};
use super::screening::judge;
use super::spline::{Knots, MEETING_POINTS, Part, Path, meeting_times};

/// Frames from which a path tells which of them is wrong.
pub(super) const FEWEST_FRAMES: usize = 5;

/// Median length of a vector of six standard normal numbers.
const MEDIAN_NORM_6: f64 = 2.313;

/// Rotation increments in radians below which the next ones would not matter: each is some percent of the one before.
const SETTLED: f64 = 3e-3;

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

/// Fits a path to the frames in their place, of at least [`FEWEST_FRAMES`] frames of increasing time; `interval` is the
/// usual time between frames.
pub(super) fn fit(
    measured: &[Measured],
    interval: f64,
    settings: &ContinuitySettings,
) -> Result<Fit, String> {
    let mut state = State::new(measured, interval, settings);
    let mut largest_turn = state.solve()?;
    for _ in 1..settings.rounds {
        if state.review_directions() {
            largest_turn = state.solve()?;
        } else if largest_turn > SETTLED {
            // Only rotations depend on where they were linearised.
            largest_turn = state.solve_part(Part::Rotation)?;
        } else {
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
        let judgements = judge(measured, settings);
        let jerks = Part::BOTH.map(|part| usual_jerk(measured, part, interval, settings));
        let path = first_path(measured, &judgements, interval / settings.control_points_per_frame);
        Self { measured, settings, path, judgements, jerks }
    }

    /// Solves for both halves of the poses and returns the largest rotation increment.
    fn solve(&mut self) -> Result<f64, String> {
        let problems = Part::BOTH.map(|part| self.problem(part));
        // The two halves share nothing within a round.
        let (translation, rotation) = rayon::join(|| problems[0].solve(), || problems[1].solve());
        self.path.advance(Part::Translation, &translation?);
        Ok(self.path.advance(Part::Rotation, &rotation?))
    }

    fn solve_part(&mut self, part: Part) -> Result<f64, String> {
        let increments = self.problem(part).solve()?;
        Ok(self.path.advance(part, &increments))
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
        // Outliers have no say in the path.
        let agreeing = self.measured.iter().zip(&self.judgements).filter(|(_, judgement)| !judgement.outlier);
        agreeing
            .map(|(frame, judgement)| Observation {
                supports: meeting_times(frame.shutter).map(|time| self.path.knots.support(time)),
                residuals: self.residuals(frame, *judgement, part),
                sigma: frame.noise_of(part),
            })
            .collect()
    }

    /// From the path to an exposure at its two meeting points.
    fn residuals(&self, frame: &Measured, judgement: Judgement, part: Part) -> [Vector3<f64>; 2] {
        let found = judgement.directed(&frame.exposure);
        let times = meeting_times(frame.shutter);
        [0, 1].map(|k| part.step(&self.path.at(times[k]), &found.at(MEETING_POINTS[k])))
    }

    /// Standard deviation of every third difference of control points.
    fn bending_scales(&self, part: Part) -> Vec<f64> {
        let knots = &self.path.knots;
        let jerks = &self.jerks[part as usize];
        (0..knots.count - 3)
            .map(|k| {
                // A third difference spans four control points; in the middle of them it stands for the jerk.
                let middle = 0.5 * (knots.time(k + 1) + knots.time(k + 2));
                let after = self.measured.partition_point(|frame| frame.timestamp < middle);
                let near = after.min(jerks.len() - 1);
                // Of the frames before and after, the rougher one decides: a jolt may have been between them.
                jerks[near].max(jerks[near.saturating_sub(1)]) * knots.step.powi(3)
            })
            .collect()
    }

    /// Turns the frames in their place that the current path shows the other way round; whether there are any.
    fn review_directions(&mut self) -> bool {
        let tolerances = Part::BOTH.map(|part| self.tolerance_factor(part));
        // 1. What each frame costs in its direction and in the other one, in units of what residuals are like here.
        let cost = |frame: &Measured, judgement: Judgement| -> f64 {
            let squared = |part: Part| {
                let tolerance = tolerances[part as usize] * frame.noise_of(part);
                0.5 * (norm(&self.residuals(frame, judgement, part)) / tolerance).powi(2)
            };
            Part::BOTH.into_iter().map(squared).sum()
        };
        let wrong = |(frame, here): (&Measured, &Judgement)| {
            let other = Judgement { reversed: !here.reversed, ..*here };
            if here.outlier || frame.held.direction {
                return false;
            }
            // A path that fits neither direction tells them apart by what exceeds its misfit.
            let (cost_here, cost_there) = (cost(frame, *here), cost(frame, other));
            let unusual = (cost_there / USUAL_ENERGY).max(1.0);
            (cost_here - cost_there) / unusual > self.settings.swap_evidence
        };
        // 2. All are turned at once: the path is that of before, whichever of them is wrong.
        let wrong: Vec<bool> = self.measured.iter().zip(&self.judgements).map(wrong).collect();
        for (judgement, &wrong) in self.judgements.iter_mut().zip(&wrong) {
            judgement.reversed ^= wrong;
        }
        wrong.contains(&true)
    }

    /// How much larger the residuals are than their noise, at least 1.
    fn tolerance_factor(&self, part: Part) -> f64 {
        let frames = self.measured.iter().zip(&self.judgements);
        let norms: Vec<f64> = frames
            .map(|(frame, &judgement)| norm(&self.residuals(frame, judgement, part)) / frame.noise_of(part))
            .collect();
        (quantile(&norms, 0.5).unwrap_or(0.0) / MEDIAN_NORM_6).max(1.0)
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
        // Third differences of the control points are the jerk, up to a factor of the interval.
        let thirds = steps.windows(3).map(|w| w[2] - w[1] * 2.0 + w[0]);
        let huber = self.settings.huber;
        thirds
            .zip(self.bending_scales(part))
            .map(|(third, sigma)| huber_cost((third / sigma).norm(), huber))
            .sum()
    }
}

fn norm(residuals: &[Vector3<f64>; 2]) -> f64 {
    residuals[0].norm().hypot(residuals[1].norm())
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

/// Straight lines between the middles of the exposures in their place.
fn first_path(measured: &[Measured], judgements: &[Judgement], step: f64) -> Path {
    let ends = measured.iter().flat_map(|frame| frame.shutter);
    let (start, end) =
        ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), time| (low.min(time), high.max(time)));
    let knots = Knots::over([start, end], step);
    let in_place = measured.iter().zip(judgements).filter(|(_, judgement)| !judgement.outlier);
    let samples: Vec<Sample> = in_place.map(|(frame, _)| frame.sample()).collect();
    let controls = (0..knots.count).map(|k| between(&samples, knots.time(k))).collect();
    Path { knots, controls }
}

fn between(samples: &[Sample], time: f64) -> RigidTransform {
    let after = samples.partition_point(|sample| sample.timestamp <= time).clamp(1, samples.len() - 1);
    let [a, b] = [&samples[after - 1], &samples[after]];
    let share = ((time - a.timestamp) / (b.timestamp - a.timestamp)).clamp(0.0, 1.0);
    let [from, to] = [&a.world_from_camera, &b.world_from_camera];
    let turn = so3::exp(&(Part::Rotation.step(from, to) * share));
    RigidTransform {
        rotation: so3::renormalised(&(turn * from.rotation)),
        translation: from.translation + Part::Translation.step(from, to) * share,
    }
}
