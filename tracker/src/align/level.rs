//! Alignment on one pyramid level.

use fearless_simd::Level;
use nalgebra::{Matrix6, SMatrix, SVector, Vector6};

use super::damping::Damping;
use super::measure::{
    NOMINAL_PHOTON_VARIANCE, measure_contrast, measure_depth, measure_photometric, nominal_model,
};
use super::objective::Linearised;
use super::placement::{blur_length, place_sites};
use super::prior::MotionPrior;
use super::problem::{AlignScratch, FrameData, Objective, ReferenceData};
use super::{AlignSettings, BOWED_UNKNOWNS, Estimate, UNKNOWNS};
use crate::geometry::PinholeCamera;
use crate::keyframe::typical_inverse_depth;
use crate::math::sqrt_f32;
use crate::trajectory::{ExposureTrajectory, FrameTiming};
use crate::transfer::BrightnessModel;
use crate::work::Work;

/// Why iterations on a level ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// The last step moved the image by less than the limit.
    SmallStep,
    /// The iteration limit was reached.
    IterationLimit,
    /// No step lowered the cost.
    NoDecrease,
    /// The normal equations could not be solved.
    Singular,
    /// Neither enough patches nor depth points are in view.
    NoData,
}

/// Result of a level.
#[derive(Clone, Debug)]
pub struct LevelOutcome {
    /// Best estimate.
    pub estimate: Estimate,
    /// Why it ended.
    pub stop: StopReason,
    /// Linearisations spent.
    pub iterations: usize,
    /// Work spent.
    pub work: Work,
    /// Virtual views used last.
    pub views: usize,
    /// Robust standard deviation of the photometric residual relative to the nominal noise model.
    pub photometric_scale: f32,
    /// Median contrast of the frame within the patches that took part, in the same unit; 0 on other levels than the finest.
    pub contrast: f32,
    /// Robust standard deviation of the depth residual, 1/m; 0 without depth term.
    pub depth_scale: f32,
    /// Patches that took part.
    pub patches: usize,
    /// Patches in view before the outlier test.
    pub patches_in_view: usize,
    /// Depth points that took part.
    pub depth_points: usize,
    /// How far picture and depth are apart about the pose: the square of their difference over what their noise explains,
    /// 1 on average where only noise sets them apart; 0 without depth term and on other levels than the finest.
    pub disagreement: f64,
    /// Gauss-Newton matrix at the estimate in (centre, motion, gain, offset) coordinates; where the bow is an unknown
    /// too, for any bow.
    pub information: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
}

impl LevelOutcome {
    /// The outcome of doing nothing.
    #[must_use]
    pub fn unchanged(estimate: Estimate) -> Self {
        Self {
            estimate,
            stop: StopReason::NoData,
            iterations: 0,
            work: Work::default(),
            views: 1,
            photometric_scale: 0.0,
            contrast: 0.0,
            depth_scale: 0.0,
            patches: 0,
            patches_in_view: 0,
            depth_points: 0,
            disagreement: 0.0,
            information: SMatrix::zeros(),
        }
    }
}

/// What all levels of one alignment share.
#[derive(Clone, Copy, Debug)]
pub struct Alignment<'a> {
    /// Instruction set of the kernels.
    pub simd: Level,
    /// Intrinsics of the finest level.
    pub camera: PinholeCamera,
    /// What the frame is aligned with.
    pub reference: ReferenceData<'a>,
    /// The frame.
    pub frame: FrameData<'a>,
    /// Expected gain and offset.
    pub expected_brightness: BrightnessModel,
    /// Settings.
    pub settings: &'a AlignSettings,
}

/// What may differ from level to level.
#[derive(Clone, Copy, Debug)]
pub struct LevelPlan {
    /// Pyramid level.
    pub level: usize,
    /// The depth term takes every n-th row and column.
    pub depth_stride: usize,
    /// Linearisations at the most.
    pub max_iterations: usize,
    /// Iterations stop when a step moves the image by less than this many pixels of the level.
    pub min_step: f64,
    /// Whether the motion during the exposure is sampled; otherwise one view at mid exposure.
    pub blur: bool,
}

/// Fewest patches for an alignment without depth.
const MIN_PATCHES: usize = 8;

/// Patches are placed anew after the image moved by this many pixels of the level.
const REPLACE_AFTER: f64 = 0.7;

/// Least ratio of actual to predicted decrease for a step to count.
const MIN_GAIN_RATIO: f64 = 1e-3;

impl Alignment<'_> {
    /// Aligns the frame on one level, starting from `initial`.
    pub fn align_level(
        &self,
        plan: &LevelPlan,
        initial: Estimate,
        prior: &MotionPrior,
        scratch: &mut AlignScratch,
    ) -> LevelOutcome {
        let mut outcome = LevelOutcome::unchanged(initial);
        let mut damping = Damping::default();
        loop {
            let (objective, kept) = self.place(plan, prior, &mut outcome, scratch);
            if kept < MIN_PATCHES && objective.depth.is_none() {
                outcome.stop = StopReason::NoData;
                return outcome;
            }
            let objective = Objective { sites: &scratch.sites[..kept], ..objective };
            let costs = &mut scratch.costs[..kept];
            match descend(&objective, plan, &mut damping, &mut outcome, costs) {
                Descent::Stopped(stop) => {
                    outcome.stop = stop;
                    return outcome;
                }
                Descent::Moved => {}
            }
        }
    }

    /// Places the patches at the current estimate and measures noise and outliers; returns the objective without
    /// its sites and their number. Not inlined: its stack must be free again when steps are tried out.
    #[inline(never)]
    fn place(
        &self,
        plan: &LevelPlan,
        prior: &MotionPrior,
        outcome: &mut LevelOutcome,
        scratch: &mut AlignScratch,
    ) -> (Objective<'_>, usize) {
        let estimate = outcome.estimate;
        let camera = self.camera.at_level(plan.level);
        let keypoints = self.reference.keypoints[plan.level];
        let timing = self.frame.timing;
        // Patches lie where the keypoints are seen at the current estimate, and stay until the image has moved.
        let in_view = place_sites(
            &estimate.path(),
            &timing,
            keypoints,
            &camera,
            plan.level,
            &self.frame,
            scratch.sites,
        );
        // As many views as the blur has parts of a given length.
        let blur = blur_length(&exposure_of(&estimate, &timing), keypoints, &camera);
        let mut objective = Objective {
            simd: self.simd,
            camera,
            depth_camera: self.camera.at_level(self.frame.depth_level),
            level: plan.level,
            reference: self.reference,
            frame: self.frame,
            sites: &[],
            views: if plan.blur { view_count(blur, self.settings) } else { 1 },
            model: nominal_model(self.settings),
            depth: None,
            prior: *prior,
            expected_brightness: self.expected_brightness,
            inverse_depth: typical_inverse_depth(keypoints),
            settings: self.settings,
        };
        // Noise and outliers from the residuals here: no step may change what counts.
        let kept = measure_photometric(&mut objective, &estimate, in_view, scratch);
        if self.settings.depth_term {
            objective.depth = measure_depth(&objective, &estimate, plan.depth_stride, scratch.medians);
        }
        outcome.work += Work::of_patches(in_view, objective.views);
        if self.settings.depth_term {
            let map = self.frame.depth;
            outcome.work += Work::of_depth(map.width, map.height, 2 * plan.depth_stride);
        }
        outcome.views = objective.views;
        outcome.patches = kept;
        outcome.patches_in_view = in_view;
        // Both scales are over the noise of a good image.
        outcome.photometric_scale = sqrt_f32(objective.model.photon_variance / NOMINAL_PHOTON_VARIANCE);
        outcome.depth_scale = objective.depth.as_ref().map_or(0.0, |depth| depth.sigma);
        if plan.level == 0 {
            outcome.contrast = measure_contrast(&objective, &scratch.sites[..kept], scratch.medians);
        }
        (objective, kept)
    }
}

/// How a run of steps with fixed patches ended.
enum Descent {
    /// For good.
    Stopped(StopReason),
    /// The image moved so far that the patches should be placed anew.
    Moved,
}

/// Ends a descent for good, and tells how well picture and depth agree there.
fn stopped(
    at: &Linearised,
    objective: &Objective,
    outcome: &mut LevelOutcome,
    reason: StopReason,
) -> Descent {
    outcome.information = without_bow(&at.hessian);
    if objective.level == 0 {
        outcome.disagreement = disagreement(at, &outcome.estimate, objective.frame.timing.depth_time);
    }
    Descent::Stopped(reason)
}

/// Share of what is known about a pose that the picture knows at the least.
const LEAST_SHARE: f64 = 0.1;

/// See [`LevelOutcome::disagreement`]; `depth_time` is the normalised time from the middle of the path.
///
/// At the best pose the gradients of picture and depth cancel. Each alone would move the pose by its own covariance times
/// its gradient, so that `g (P_picture + P_depth) g / 6` is their difference in units of its own covariance. Both are
/// about the pose when depth was measured; that of the picture follows from that of all, less what depth adds.
#[inline(never)]
fn disagreement(at: &Linearised, estimate: &Estimate, depth_time: f64) -> f64 {
    let mut to_camera = Matrix6::identity();
    // Rotations are of the camera, as in the other unknowns.
    let turn = estimate.keyframe_from_camera.mid().rotation_matrix().transpose();
    to_camera.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
    let by_depth = to_camera * at.depth_pose.0 * to_camera.transpose();
    let gradient = to_camera * at.depth_pose.1;
    let Some(covariance) = at.hessian.try_inverse() else { return 0.0 };
    // Unknowns that move the pose when depth was measured: centre, motion and bow, with their shares.
    let shares = [(0, 1.0), (6, depth_time), (UNKNOWNS, depth_time * depth_time)];
    let mut of_all = Matrix6::zeros();
    for (i, a) in shares {
        for (j, b) in shares {
            of_all += covariance.fixed_view::<6, 6>(i, j) * (a * b);
        }
    }
    let Some(by_all) = of_all.try_inverse() else { return 0.0 };
    let step = |information: Matrix6<f64>| information.cholesky().map(|factor| factor.solve(&gradient));
    // Where the picture says next to nothing about that pose, rounding decides what is left of it.
    let of_picture = step(by_all - by_depth).or_else(|| step(by_all * LEAST_SHARE));
    match (of_picture, step(by_depth)) {
        (Some(of_picture), Some(of_depth)) => gradient.dot(&(of_picture + of_depth)).max(0.0) / 6.0,
        _ => 0.0,
    }
}

/// Steps downhill with fixed patches. Every candidate is linearised at once: most are accepted, and then the next
/// step needs no further evaluation.
fn descend(
    objective: &Objective,
    plan: &LevelPlan,
    damping: &mut Damping,
    outcome: &mut LevelOutcome,
    costs: &mut [crate::transfer::PatchCost],
) -> Descent {
    let mut at = objective.linearise(&outcome.estimate, None, costs);
    outcome.iterations += 1;
    outcome.work += objective.work();
    let mut moved = 0.0;
    loop {
        outcome.depth_points = at.depth_points as usize;
        let Some(step) = damping.step(&at.hessian, &at.gradient) else {
            return stopped(&at, objective, outcome, StopReason::Singular);
        };
        // A step that cannot be seen ends the descent.
        let pixels = step_in_pixels(&step, &objective.camera, objective.inverse_depth);
        if pixels < plan.min_step {
            outcome.estimate = outcome.estimate.stepped(&step);
            return stopped(&at, objective, outcome, StopReason::SmallStep);
        }
        if outcome.iterations >= plan.max_iterations {
            return stopped(&at, objective, outcome, StopReason::IterationLimit);
        }
        let candidate = outcome.estimate.stepped(&step);
        let next = objective.linearise(&candidate, Some((at.pixels, at.depth_compared)), costs);
        outcome.iterations += 1;
        outcome.work += objective.work();
        // Levenberg-Marquardt: a step is kept when the cost falls by a fair share of what the model promised.
        let ratio = gain_ratio(&at, &next, &step);
        if next.cost < at.cost && ratio > MIN_GAIN_RATIO {
            damping.accept(ratio);
            outcome.estimate = candidate;
            at = next;
            moved += pixels;
            if moved > REPLACE_AFTER && outcome.iterations < plan.max_iterations {
                outcome.information = without_bow(&at.hessian);
                return Descent::Moved;
            }
        } else if !damping.reject() {
            return stopped(&at, objective, outcome, StopReason::NoDecrease);
        }
    }
}

/// Actual over predicted decrease; NaN when the candidate has no finite cost.
fn gain_ratio(at: &Linearised, next: &Linearised, step: &SVector<f64, BOWED_UNKNOWNS>) -> f64 {
    let predicted = -at.gradient.dot(step) - 0.5 * step.dot(&(at.hessian * step));
    (at.cost - next.cost) / predicted.max(f64::MIN_POSITIVE)
}

/// Virtual views for a blur of `blur` pixels.
fn view_count(blur: f32, settings: &AlignSettings) -> usize {
    if blur < MIN_SAMPLED_BLUR {
        return 1;
    }
    // A blur without end is a very long one.
    let wanted = ((blur / settings.view_spacing) as usize).saturating_add(1);
    wanted.clamp(3, settings.max_views.max(3))
}

/// Blur in pixels below which one view serves: the motion is not observable there.
const MIN_SAMPLED_BLUR: f32 = 0.5;

/// Largest image motion in pixels that a step causes at the scene's typical depth.
fn step_in_pixels(step: &SVector<f64, BOWED_UNKNOWNS>, camera: &PinholeCamera, inverse_depth: f64) -> f64 {
    let pixels = |tangent: Vector6<f64>| {
        // A translation is seen over the depth of the scene, a rotation at any depth.
        let translation = tangent.fixed_rows::<3>(0).norm() * inverse_depth;
        camera.fx * translation.max(tangent.fixed_rows::<3>(3).norm())
    };
    let centre = pixels(step.fixed_rows::<6>(0).into_owned());
    let motion = pixels(step.fixed_rows::<6>(6).into_owned());
    let bow = pixels(step.fixed_rows::<6>(UNKNOWNS).into_owned());
    // Where the path begins and ends, half a unit of normalised time from its middle.
    centre.max(0.5 * motion).max(0.25 * bow)
}

/// The motion during the exposure of the middle row.
fn exposure_of(estimate: &Estimate, timing: &FrameTiming) -> ExposureTrajectory {
    if timing.reaches_outside() {
        estimate.path().between(0.5 - 0.5 * timing.exposure, 0.5 + 0.5 * timing.exposure)
    } else {
        estimate.keyframe_from_camera
    }
}

/// The Gauss-Newton matrix of the other unknowns when the bow may take any value: the Schur complement of its block. Not
/// inlined, for the sake of the stack.
#[inline(never)]
fn without_bow(hessian: &SMatrix<f64, BOWED_UNKNOWNS, BOWED_UNKNOWNS>) -> SMatrix<f64, UNKNOWNS, UNKNOWNS> {
    const BOW: usize = BOWED_UNKNOWNS - UNKNOWNS;
    let others = hessian.fixed_view::<UNKNOWNS, UNKNOWNS>(0, 0).into_owned();
    let cross = hessian.fixed_view::<UNKNOWNS, BOW>(0, UNKNOWNS).into_owned();
    if cross.iter().all(|entry| *entry == 0.0) {
        return others;
    }
    let bow = hessian.fixed_view::<BOW, BOW>(UNKNOWNS, UNKNOWNS).into_owned();
    bow.cholesky().map_or(others, |bow| others - cross * bow.solve(&cross.transpose()))
}
