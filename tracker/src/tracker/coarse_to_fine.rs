//! The order in which levels and first guesses are tried.

use arrayvec::ArrayVec;
use nalgebra::{Vector3, Vector6};

use super::frame::{ExpectedPath, GyroReading};
use super::history::Motion;
use crate::align::{AlignScratch, Alignment, Estimate, LevelOutcome, LevelPlan, MotionPrior};
use crate::geometry::RigidTransform;
use crate::trajectory::ExposureTrajectory;
use crate::transfer::BrightnessModel;
use crate::work::Work;

/// Levels on which several first guesses compete.
pub(super) const COMPETING_LEVELS: usize = 2;

/// Guesses that go on from the coarsest level to the next. Its few pixels rank the rest well enough, but not the best:
/// with half as many, the way back from a lost frame is missed.
pub(super) const FINALISTS: usize = 8;

/// A guess with fewer of the reference's patches in view and in agreement has looked past the scene.
const MIN_AGREEING: f64 = 0.05;

/// Steps below this many pixels of a level are left to the finer ones.
const COARSE_MIN_STEP: f64 = 0.05;

/// Guesses that ended within this many pixels of a level of each other go on as one: less than the last step of any. Farther
/// apart, one may find the way out of a long blur and its neighbour not.
const SAME_PLACE: f64 = 0.03;

/// Step between the rows and columns of the depth map that take part on the competing levels and on the others.
pub(super) const COMPETING_STRIDE: usize = 4;
pub(super) const FINE_STRIDE: usize = 2;

/// Upper bound of first guesses: gyroscope, steady motion, the eight turns, rest and the way back.
pub(super) const MAX_GUESSES: usize = 12;

/// When the motion is unknown, turns by this many pixels of the coarsest level are tried in eight directions.
const SEARCH_PIXELS: f64 = 3.0;

/// One frame to be aligned with one reference.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrameTask<'a> {
    pub(super) alignment: Alignment<'a>,
    /// Last motion, in the frame of the reference.
    pub(super) motion: Motion,
    pub(super) timestamp: f64,
    /// Seconds that the path of the frame spans.
    pub(super) span: f64,
    /// Angular velocity since the last frame, camera frame, rad/s.
    pub(super) gyro: Option<Vector3<f64>>,
    /// Turning around mid exposure, without bias.
    pub(super) turning: Option<GyroReading>,
    /// The motion around mid exposure as something else knows it.
    pub(super) expected_path: Option<ExpectedPath>,
    pub(super) brightness: BrightnessModel,
    /// Whether the motion during the exposure is sampled.
    pub(super) blur: bool,
    /// Typical inverse depth of the scene, 1/m.
    pub(super) inverse_depth: f64,
}

/// A finished alignment.
#[derive(Clone, Debug)]
pub(super) struct Aligned {
    /// Outcome of the finest level, with the direction of time settled.
    pub(super) outcome: LevelOutcome,
    /// Work on all levels.
    pub(super) work: Work,
}

/// Where the guesses ended on one level.
struct Round {
    /// Scores and estimates, best first.
    finalists: ArrayVec<(f64, Estimate), FINALISTS>,
    /// Outcome of the best.
    winner: Option<LevelOutcome>,
    /// Work of all guesses.
    work: Work,
}

impl FrameTask<'_> {
    /// First guesses of the mid pose, most likely first.
    pub(super) fn guesses(&self) -> ArrayVec<RigidTransform, MAX_GUESSES> {
        let dt = self.timestamp - self.motion.timestamp;
        let steady = self.motion.between_frames;
        let mut guesses = ArrayVec::new();
        if let Some(gyro) = self.gyro {
            let mut rate = steady;
            rate.fixed_rows_mut::<3>(3).copy_from(&gyro);
            guesses.push(self.motion.extrapolate(&rate, dt));
        }
        guesses.push(self.motion.extrapolate(&steady, dt));
        match self.motion.within_exposure {
            Some(rate) => {
                guesses.push(self.motion.extrapolate(&rate, dt));
                if self.alignment.frame.timing.is_rolling() {
                    let bent = rate + self.motion.acceleration * (0.5 * dt);
                    guesses.push(self.motion.extrapolate(&bent, dt));
                }
            }
            None => guesses.extend(self.turns()),
        }
        guesses.push(self.motion.reference_from_mid);
        guesses.push(self.motion.extrapolate(&-steady, dt));
        guesses
    }

    /// The last pose turned up, down, sideways and diagonally.
    fn turns(&self) -> impl Iterator<Item = RigidTransform> {
        let coarsest = self.alignment.reference.levels.len().saturating_sub(1);
        let angle = SEARCH_PIXELS / self.alignment.camera.at_level(coarsest).fx;
        let last = self.motion.reference_from_mid;
        let directions = (0..9).filter(|k| *k != 4).map(|k| (f64::from(k % 3) - 1.0, f64::from(k / 3) - 1.0));
        directions.map(move |(x, y)| last.perturbed(&Vector6::new(0.0, 0.0, 0.0, x * angle, y * angle, 0.0)))
    }

    /// Aligns coarse to fine. All guesses compete on the coarsest level, where an iteration costs next to nothing,
    /// the [`FINALISTS`] on the next; the best goes on alone.
    pub(super) fn run(&self, guesses: &[RigidTransform], scratch: &mut AlignScratch) -> Aligned {
        let coarsest = self.alignment.reference.levels.len().saturating_sub(1);
        let last_competing = (coarsest + 1).saturating_sub(COMPETING_LEVELS);
        let mut work = Work::none();
        let mut outcome = LevelOutcome::unchanged(self.estimate_at(&self.motion.reference_from_mid));
        let mut starts: ArrayVec<Estimate, MAX_GUESSES> =
            guesses.iter().map(|guess| self.estimate_at(guess)).take(MAX_GUESSES).collect();
        for level in (last_competing..=coarsest).rev() {
            let round = self.compete(level, &starts, scratch);
            work += round.work;
            starts.clear();
            for (_, estimate) in &round.finalists {
                let mid = estimate.keyframe_from_camera.mid();
                self.add_start(level, &mid, estimate.brightness, &mut starts);
            }
            outcome = round.winner.unwrap_or(outcome);
        }
        for level in (0..last_competing).rev() {
            let start = self.oriented(outcome.estimate);
            outcome = self.level(level, start, scratch);
            work += outcome.work;
        }
        outcome.estimate = self.oriented(outcome.estimate);
        Aligned { outcome, work }
    }

    /// Adds a start with the motion that is expected around a mid pose, unless there is one at the same place of the level.
    fn add_start(
        &self,
        level: usize,
        reference_from_mid: &RigidTransform,
        brightness: BrightnessModel,
        starts: &mut ArrayVec<Estimate, MAX_GUESSES>,
    ) {
        let focal = self.alignment.camera.at_level(level).fx;
        let is_same = |start: &Estimate| {
            let apart = start.keyframe_from_camera.mid().tangent_to(reference_from_mid);
            let (translation, rotation) = (apart.fixed_rows::<3>(0).norm(), apart.fixed_rows::<3>(3).norm());
            focal * (translation * self.inverse_depth).max(rotation) < SAME_PLACE
        };
        if !starts.iter().any(is_same) {
            starts.push(Estimate { brightness, ..self.estimate_at(reference_from_mid) });
        }
    }

    /// Aligns from every start on one level and ranks where they ended.
    fn compete(&self, level: usize, starts: &[Estimate], scratch: &mut AlignScratch) -> Round {
        let mut round = Round { finalists: ArrayVec::new(), winner: None, work: Work::none() };
        for start in starts {
            let outcome = self.level(level, *start, scratch);
            round.work += outcome.work;
            let score = score(&outcome, self.alignment.reference.keypoints[level].len());
            let rank = round.finalists.iter().take_while(|(other, _)| *other <= score).count();
            if rank < FINALISTS {
                round.finalists.truncate(FINALISTS - usize::from(round.finalists.len() == FINALISTS));
                round.finalists.insert(rank, (score, outcome.estimate));
            }
            if rank == 0 {
                round.winner = Some(outcome);
            }
        }
        round
    }

    fn level(&self, level: usize, start: Estimate, scratch: &mut AlignScratch) -> LevelOutcome {
        let competing = level + COMPETING_LEVELS >= self.alignment.reference.levels.len();
        let plan = LevelPlan {
            level,
            depth_stride: if competing { COMPETING_STRIDE } else { FINE_STRIDE },
            min_step: if level > 0 { COARSE_MIN_STEP } else { self.alignment.settings.min_step },
            max_iterations: self.alignment.settings.max_iterations,
            blur: self.blur,
        };
        let mut prior = self.prior(&start);
        if competing {
            // A guess far from the truth must be able to leave the motion that follows from it.
            prior.follows = None;
        }
        self.alignment.align_level(&plan, start, &prior, scratch)
    }

    /// The estimate or its reverse, whichever moves in the expected direction: a blurred image alone cannot tell. Rows
    /// that are exposed one after the other can.
    fn oriented(&self, estimate: Estimate) -> Estimate {
        if self.alignment.frame.timing.is_rolling() {
            return estimate;
        }
        let prior = self.prior(&estimate);
        let towards = prior.information.component_mul(&prior.expected);
        if estimate.keyframe_from_camera.motion().dot(&towards) < 0.0 {
            Estimate { keyframe_from_camera: estimate.keyframe_from_camera.reversed(), ..estimate }
        } else {
            estimate
        }
    }

    fn prior(&self, estimate: &Estimate) -> MotionPrior {
        self.prior_at(&estimate.keyframe_from_camera.mid())
    }

    fn prior_at(&self, reference_from_mid: &RigidTransform) -> MotionPrior {
        if let Some(expected) = &self.expected_path {
            return expected.prior(reference_from_mid, self.span, &self.alignment.camera, self.inverse_depth);
        }
        let prior = self.motion.expected_motion(
            reference_from_mid,
            self.timestamp,
            self.span,
            &self.alignment.camera,
            self.inverse_depth,
        );
        // Without rows or depth at other times the mid pose is measured by itself.
        let prior = match &self.turning {
            Some(turning) => Motion::with_gyro(prior, turning, self.span),
            None => prior,
        };
        let follows = prior.follows.filter(|_| self.alignment.frame.timing.reaches_outside());
        MotionPrior { follows, ..prior }
    }

    /// The estimate with the expected motion around a mid pose.
    fn estimate_at(&self, reference_from_mid: &RigidTransform) -> Estimate {
        let prior = self.prior_at(reference_from_mid);
        let bowed = self.alignment.frame.timing.reaches_outside();
        let expected = self.expected_path.filter(|_| bowed);
        Estimate {
            keyframe_from_camera: ExposureTrajectory::from_mid_and_motion(
                reference_from_mid,
                &prior.expected,
            ),
            bow: if bowed { prior.bow } else { Vector6::zeros() },
            jerk: expected.map_or_else(Vector6::zeros, |path| path.at(reference_from_mid, self.span).jerk),
            brightness: self.brightness,
        }
    }
}

/// How badly a guess ended, where the reference has `keypoints` on the level: photometric residual, raised by patches
/// that disagree or left the view and by depth that does not fit.
pub(super) fn score(outcome: &LevelOutcome, keypoints: usize) -> f64 {
    let agreeing = outcome.patches as f64 / keypoints.max(1) as f64;
    let depth = 1.0 + 100.0 * f64::from(outcome.depth_scale);
    if agreeing < MIN_AGREEING { f64::MAX } else { f64::from(outcome.photometric_scale) * depth / agreeing }
}
