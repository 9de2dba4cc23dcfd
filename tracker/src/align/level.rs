//! Levenberg-Marquardt on one pyramid level.

use fearless_simd::Level;
use nalgebra::{SMatrix, SVector, Vector6};

use super::depth_term::{DepthProblem, gate_for};
use super::objective::{AlignScratch, FrameData, Linearised, Objective, ReferenceData};
use super::placement::{blur_length, place_sites};
use super::prior::MotionPrior;
use super::scale::median;
use super::{AlignSettings, Estimate, UNKNOWNS};
use crate::geometry::PinholeCamera;
use crate::math::sqrt_f32;
use crate::trajectory::SampleRule;
use crate::transfer::{self, BrightnessModel, PatchCost, ResidualModel, virtual_views};

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
    /// Virtual views used last.
    pub views: usize,
    /// Robust standard deviation of the photometric residual relative to the nominal noise model.
    pub photometric_scale: f32,
    /// Robust standard deviation of the depth residual, 1/m; 0 without depth term.
    pub depth_scale: f32,
    /// Patches that took part.
    pub patches: usize,
    /// Patches in view before the outlier test.
    pub patches_in_view: usize,
    /// Depth points that took part.
    pub depth_points: usize,
    /// Gauss-Newton matrix at the estimate in (centre, motion, gain, offset) coordinates.
    pub information: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    /// Objective at the estimate.
    pub cost: f64,
}

/// Fewest patches or depth points for an alignment.
const MIN_PATCHES: usize = 8;
const MIN_DEPTH_POINTS: usize = 60;

/// Nominal variance per unit of light; the measured scale multiplies it.
const NOMINAL_PHOTON_VARIANCE: f32 = 1e-4;

/// What all levels of one alignment share.
#[derive(Clone, Copy, Debug)]
pub struct Alignment<'a> {
    /// Instruction set of the kernels.
    pub simd: Level,
    /// Intrinsics of the full-resolution images.
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

/// Aligns a frame on pyramid level `level`, starting from `initial`; the depth term takes every `depth_stride`-th
/// row and column.
pub fn align_level(
    alignment: &Alignment,
    level: usize,
    initial: Estimate,
    prior: &MotionPrior,
    depth_stride: usize,
    scratch: &mut AlignScratch,
) -> LevelOutcome {
    let Alignment { camera, reference, frame, settings, .. } = *alignment;
    let level_camera = camera.at_level(level);
    let mut outcome = LevelOutcome {
        estimate: initial,
        stop: StopReason::NoData,
        iterations: 0,
        views: 1,
        photometric_scale: 0.0,
        depth_scale: 0.0,
        patches: 0,
        patches_in_view: 0,
        depth_points: 0,
        information: SMatrix::zeros(),
        cost: 0.0,
    };
    let mut damping = 1e-4;
    let mut growth = 2.0;
    let keypoints = reference.keypoints[level];
    'placements: while outcome.iterations < settings.max_iterations {
        let estimate = outcome.estimate;
        let in_view = place_sites(
            &estimate.keyframe_from_camera,
            keypoints,
            &level_camera,
            level,
            frame.depth,
            scratch.sites,
        );
        let blur = blur_length(&estimate.keyframe_from_camera, keypoints, &level_camera);
        let views = if settings.blur { view_count(blur, settings) } else { 1 };
        let mut objective = Objective {
            camera: level_camera,
            level,
            simd: alignment.simd,
            reference,
            frame,
            sites: &[],
            views,
            model: nominal_model(settings),
            photometric_weight: 0.0,
            depth: None,
            prior: *prior,
            expected_brightness: alignment.expected_brightness,
            settings,
        };
        let kept = measure_photometric(&mut objective, &estimate, in_view, scratch);
        if settings.depth_term {
            measure_depth(&mut objective, &camera, &estimate, depth_stride, scratch.medians);
        }
        objective.sites = &scratch.sites[..kept];
        outcome.views = views;
        outcome.patches = kept;
        outcome.patches_in_view = in_view;
        outcome.photometric_scale = sqrt_f32(objective.model.photon_variance / NOMINAL_PHOTON_VARIANCE);
        outcome.depth_scale = objective.depth.as_ref().map_or(0.0, |depth| depth.1);
        if kept < MIN_PATCHES && objective.depth.is_none() {
            outcome.stop = StopReason::NoData;
            return outcome;
        }
        let mut at = objective.linearise(&estimate, None, &mut scratch.costs[..kept]);
        outcome.iterations += 1;
        let mut moved = 0.0;
        loop {
            outcome.information = at.hessian;
            outcome.cost = at.cost;
            outcome.depth_points = at.depth_points as usize;
            let Some(step) = damped_step(&at, damping) else {
                outcome.stop = StopReason::Singular;
                return outcome;
            };
            let pixels = step_in_pixels(&step, &level_camera, median_inverse_depth(keypoints));
            if pixels < settings.min_step {
                outcome.estimate = outcome.estimate.stepped(&step);
                outcome.stop = StopReason::SmallStep;
                return outcome;
            }
            if outcome.iterations >= settings.max_iterations {
                outcome.stop = StopReason::IterationLimit;
                return outcome;
            }
            let candidate = outcome.estimate.stepped(&step);
            let next = objective.linearise(
                &candidate,
                Some((at.pixels, at.depth_points)),
                &mut scratch.costs[..kept],
            );
            outcome.iterations += 1;
            let predicted = -at.gradient.dot(&step) - 0.5 * step.dot(&(at.hessian * step));
            let ratio = (at.cost - next.cost) / predicted.max(f64::MIN_POSITIVE);
            if next.cost.is_finite() && next.cost < at.cost && ratio > 1e-3 {
                let shrink = 1.0 - (2.0 * ratio - 1.0) * (2.0 * ratio - 1.0) * (2.0 * ratio - 1.0);
                damping = (damping * shrink.max(1.0 / 3.0)).max(1e-9);
                growth = 2.0;
                outcome.estimate = candidate;
                moved += pixels;
                at = next;
                if moved > 0.7 {
                    continue 'placements;
                }
            } else {
                damping *= growth;
                growth *= 2.0;
                if damping > 1e4 {
                    outcome.stop = StopReason::NoDecrease;
                    return outcome;
                }
            }
        }
    }
    outcome.stop = StopReason::IterationLimit;
    outcome
}

fn nominal_model(settings: &AlignSettings) -> ResidualModel {
    ResidualModel {
        read_variance: NOMINAL_PHOTON_VARIANCE * settings.dark_intensity,
        photon_variance: NOMINAL_PHOTON_VARIANCE,
        huber: settings.huber,
    }
}

/// Virtual views for a blur of `blur` pixels.
fn view_count(blur: f32, settings: &AlignSettings) -> usize {
    if blur < 0.5 {
        return 1;
    }
    let wanted = (blur / settings.view_spacing) as usize + 1;
    wanted.clamp(3, settings.max_views.max(1))
}

/// Measures the photometric noise scale at `estimate`, drops outlier patches and sets the term's weight; returns
/// the number of patches kept, which are moved to the front of the scratch.
fn measure_photometric(
    objective: &mut Objective,
    estimate: &Estimate,
    in_view: usize,
    scratch: &mut AlignScratch,
) -> usize {
    let views = virtual_views(
        &estimate.keyframe_from_camera,
        objective.views,
        SampleRule::Midpoint,
        &objective.camera,
    );
    // Without a threshold the mean cost of a patch is half its mean square.
    let square_model = ResidualModel { huber: f32::MAX, ..objective.model };
    let problem = objective.transfer_problem(estimate, &views);
    transfer::evaluate_cost(
        objective.simd,
        &problem,
        &scratch.sites[..in_view],
        &square_model,
        &mut scratch.costs[..in_view],
    );
    let mean_cost = |c: &PatchCost| if c.pixels > 0.0 { c.cost / c.pixels } else { f32::MAX };
    let mut count = 0;
    for cost in &scratch.costs[..in_view] {
        if cost.pixels > 0.0 {
            scratch.medians[count] = mean_cost(cost);
            count += 1;
        }
    }
    let typical = median(&mut scratch.medians[..count]).max(1e-3);
    let mut kept = 0;
    for k in 0..in_view {
        if mean_cost(&scratch.costs[k]) < objective.settings.outlier_factor * typical {
            scratch.sites[kept] = scratch.sites[k];
            kept += 1;
        }
    }
    // Half the mean square is half the variance.
    let variance_scale = 2.0 * typical;
    objective.model.read_variance *= variance_scale;
    objective.model.photon_variance *= variance_scale;
    objective.photometric_weight = 1.0 / objective.settings.photometric_correlation;
    kept
}

/// Measures the depth noise scale at `estimate` and sets up the depth term where enough points overlap.
fn measure_depth<'a>(
    objective: &mut Objective<'a>,
    camera: &PinholeCamera,
    estimate: &Estimate,
    stride: usize,
    medians: &mut [f32],
) {
    let mut problem = DepthProblem {
        current: objective.frame.depth,
        keyframe: objective.reference.depth,
        planes: objective.reference.planes,
        camera: camera.at_level(objective.reference.depth.level),
        stride: stride * 2,
        gate: gate_for(f32::MAX),
    };
    let (sigma, count) = problem.noise_scale(&estimate.keyframe_from_camera.mid(), medians);
    if count * 4 < MIN_DEPTH_POINTS * 4 / (stride * stride) {
        return;
    }
    let sigma = sigma.max(objective.settings.min_depth_sigma);
    problem.stride = stride;
    problem.gate = gate_for(sigma);
    let weight =
        (stride * stride) as f64 / objective.settings.depth_correlation.max((stride * stride) as f64);
    objective.depth = Some((problem, sigma, weight));
}

/// Solves the damped normal equations: `(H + mu D) step = -g`.
fn damped_step(at: &Linearised, damping: f64) -> Option<SVector<f64, UNKNOWNS>> {
    let mut damped = at.hessian;
    let floor = 1e-9 * at.hessian.trace() / UNKNOWNS as f64;
    for i in 0..UNKNOWNS {
        damped[(i, i)] += damping * at.hessian[(i, i)] + floor;
    }
    let step = damped.cholesky()?.solve(&-at.gradient);
    step.iter().all(|x| x.is_finite()).then_some(step)
}

/// Largest image motion in pixels that a step causes at the scene's typical depth.
fn step_in_pixels(step: &SVector<f64, UNKNOWNS>, camera: &PinholeCamera, inverse_depth: f64) -> f64 {
    let centre = pixels_of(&step.fixed_rows::<6>(0).into_owned(), camera, inverse_depth);
    let motion = pixels_of(&step.fixed_rows::<6>(6).into_owned(), camera, inverse_depth);
    centre.max(0.5 * motion)
}

fn pixels_of(tangent: &Vector6<f64>, camera: &PinholeCamera, inverse_depth: f64) -> f64 {
    camera.fx * (tangent.fixed_rows::<3>(0).norm() * inverse_depth).max(tangent.fixed_rows::<3>(3).norm())
}

fn median_inverse_depth(keypoints: &[crate::keyframe::Keypoint]) -> f64 {
    keypoints.get(keypoints.len() / 2).map_or(0.5, |keypoint| f64::from(keypoint.inverse_depth))
}
