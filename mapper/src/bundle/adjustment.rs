//! Joint optimisation of the map and of the paths of all exposures.

use mba_tracker::simd::Level;
use rand_core::Rng;
use rand_pcg::Pcg32;
use serde::{Deserialize, Serialize};

use super::adam::{self, Moments};
use super::density::{self, Pull};
use super::engine::{Engine, Exposure};
use super::frame_state::FrameState;
use super::loss::LossTerms;
use super::observation::{Observation, ObservationPyramid, Sensor};
use super::path_metric::PathMetric;
use super::path_step::{PathPrior, PathStep};
use super::schedule::{Schedule, StepPlan};
use super::seeding::{self, DepthSource};
use crate::gaussians::Gaussians;
use crate::raster::{RasterImage, RasterScratch, RasterView, Rasterizer};

/// How the bundle is adjusted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BundleSettings {
    /// Whether motion during the exposure is modelled.
    pub blur: bool,
    /// Upper bound of virtual views per exposure.
    pub max_views: usize,
    /// Upper bound of the number of Gaussians.
    pub max_gaussians: usize,
    /// Seed of the order in which keyframes are visited.
    pub seed: u64,
}

/// A frame that the map is fitted to.
#[derive(Clone, Debug)]
pub struct Keyframe {
    /// Index in the data set.
    pub index: usize,
    /// What was captured.
    pub observation: ObservationPyramid,
    /// What is known of its path besides.
    pub prior: PathPrior,
    /// Typical depth, metres.
    pub depth: f64,
    /// Coordinates of its path.
    pub metric: PathMetric,
}

impl Keyframe {
    /// Frame `index` of the data set.
    #[must_use]
    pub fn new(index: usize, observation: ObservationPyramid, prior: PathPrior) -> Self {
        let depth = typical_depth(observation.level(0));
        let metric = PathMetric::new(observation.level(1), depth);
        Self { index, observation, prior, depth, metric }
    }
}

/// All that changes from step to step: enough to go on after an interruption.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BundleState {
    /// The map.
    pub gaussians: Gaussians,
    /// Moments of its gradients.
    moments: Moments,
    /// Pulls since the last change of density.
    pull: Pull,
    /// One per keyframe.
    pub frames: Vec<FrameState>,
    /// Steps made.
    pub steps: usize,
    /// Where the schedule stands, 0 to 1.
    pub position: f64,
}

/// A map, keyframes, and what is needed to fit the one to the other.
#[derive(Debug)]
pub struct BundleAdjustment {
    /// What was estimated so far.
    pub state: BundleState,
    keyframes: Vec<Keyframe>,
    settings: BundleSettings,
    schedule: Schedule,
    sensor: Sensor,
    level: Level,
    engine: Engine,
    /// Order of the visits of the current round, and which round that is.
    round: (usize, Vec<usize>),
}

/// What a step did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// The keyframe, counted from 0.
    pub keyframe: usize,
    /// Loss before the step.
    pub terms: LossTerms,
}

/// Blur up to this length, pixels, is not seen in a picture: one view shows it.
const SHARP_PX: f64 = 1.0;

/// Longest growth of the map at one change of density, as a fraction of its size.
const GROWTH: f64 = 0.15;

impl BundleAdjustment {
    /// Keyframes of one sensor with first estimates of their states, and an empty map; [`Self::seed`] fills it.
    ///
    /// Keyframes without a state are left out.
    #[must_use]
    pub fn new(
        level: Level,
        sensor: Sensor,
        settings: BundleSettings,
        keyframes: Vec<Keyframe>,
        frames: Vec<FrameState>,
    ) -> Self {
        let engine = Engine::new(level, &sensor);
        let schedule = Schedule::new(keyframes.len());
        let state = BundleState {
            gaussians: Gaussians::default(),
            moments: Moments::default(),
            pull: Pull::default(),
            frames,
            steps: 0,
            position: 0.0,
        };
        Self { state, keyframes, settings, schedule, sensor, level, engine, round: (usize::MAX, Vec::new()) }
    }

    /// The keyframes.
    #[must_use]
    pub fn keyframes(&self) -> &[Keyframe] {
        &self.keyframes
    }

    /// The schedule.
    #[must_use]
    pub fn schedule(&self) -> &Schedule {
        &self.schedule
    }

    /// Fills the map with what the keyframes see, the sharpest first: each adds what those before it do not cover. Then,
    /// once more, surfaces that no keyframe has a depth of.
    pub fn seed(&mut self) {
        let camera = self.sensor.camera;
        let blur = |k: &usize| self.state.frames[*k].blur_px(&camera, self.keyframes[*k].depth);
        let mut order: Vec<usize> = (0..self.keyframes.len()).collect();
        order.sort_by(|a, b| blur(a).total_cmp(&blur(b)));
        let rasterizer = Rasterizer::new(self.level);
        let (mut scratch, mut image) = (RasterScratch::default(), RasterImage::default());
        for source in [DepthSource::Measured, DepthSource::Completed] {
            for &k in &order {
                let seen = self.keyframes[k].observation.level(0);
                let world_from_camera = self.state.frames[k].path.mid();
                let view = RasterView { camera: seen.camera, world_from_camera, background: [0.0; 3] };
                rasterizer.forward(&self.state.gaussians, &view, &mut scratch, &mut image);
                let room = self.settings.max_gaussians.saturating_sub(self.state.gaussians.len());
                let (map, response) = (&mut self.state.gaussians, &self.sensor.inverse_response);
                seeding::seed(map, seen, response, &world_from_camera, &image.alpha, source, room);
            }
        }
        density::resize(&mut self.state.moments, self.state.gaussians.len());
        self.reorder();
    }

    /// One step on the next keyframe, after which the schedule stands at `position_after`. `timed` says whether
    /// positions are shares of time.
    ///
    /// Returns `None` without keyframes.
    pub fn step(&mut self, timed: bool, position_after: impl FnOnce(&Schedule) -> f64) -> Option<StepReport> {
        let k = self.next_keyframe()?;
        let plan = self.schedule.plan(self.state.position, timed);
        let (keyframe, frame) = (&self.keyframes[k], &self.state.frames[k]);
        let seen = keyframe.observation.level(plan.level);
        let views = self.settings.views(frame.blur_px(&seen.camera, keyframe.depth), &plan);
        let exposure = Exposure { seen, path: &frame.path, gain: frame.log_gain.exp(), views };
        let loss = self.engine.evaluate(&self.state.gaussians, exposure, &plan);

        let state = &mut self.state;
        let (gradients, drawn) = (self.engine.gradients(), self.engine.drawn());
        adam::step(&mut state.gaussians, &gradients.parameters, drawn, &plan.lengths, &mut state.moments);
        state.pull.add(&gradients.screen, drawn);
        let frame = &mut state.frames[k];
        // The first keyframe says where the world is and how bright.
        let is_first = k == 0;
        if plan.path_pixels > 0.0 {
            // One view says nothing about the motion.
            let still = !self.settings.blur || views == 1;
            let step = PathStep { pixels: plan.path_pixels, hold_middle: is_first, still };
            frame.path_moments.step(&mut frame.path, &loss.by_path, &keyframe.prior, &keyframe.metric, step);
            if !is_first {
                frame.log_gain += frame.gain_moments.step(loss.by_log_gain, plan.log_gain);
            }
        }
        state.steps += 1;
        let before = core::mem::replace(&mut state.position, position_after(&self.schedule));
        if self.schedule.density_changes(before, self.state.position) {
            self.change_density();
        }
        Some(StepReport { keyframe: k, terms: loss.terms })
    }

    /// Fits path and gain of a frame that is no keyframe to the map as it is. `count` steps on the coarser resolution, of
    /// which the one with the least loss is kept: steps have a length of their own, and would lead away from a path
    /// that is right already.
    pub fn fit_frame(&mut self, unmapped: &Keyframe, frame: &mut FrameState, count: usize) {
        let plan = StepPlan { level: 1, spacing: 2.0, ..self.schedule.plan(0.1, false) };
        let seen = unmapped.observation.level(plan.level);
        let (mut best, mut least) = (frame.clone(), f64::INFINITY);
        for k in 0..count {
            let shrink = 0.05_f64.powf(k as f64 / count as f64);
            let views = self.settings.views(frame.blur_px(&seen.camera, unmapped.depth), &plan);
            let exposure = Exposure { seen, path: &frame.path, gain: frame.log_gain.exp(), views };
            let loss = self.engine.evaluate(&self.state.gaussians, exposure, &plan);
            if loss.terms.total() < least {
                (best, least) = (frame.clone(), loss.terms.total());
            }
            let step = PathStep { pixels: 0.3 * shrink, hold_middle: false, still: !self.settings.blur };
            frame.path_moments.step(&mut frame.path, &loss.by_path, &unmapped.prior, &unmapped.metric, step);
            frame.log_gain += frame.gain_moments.step(loss.by_log_gain, 0.01 * shrink);
        }
        *frame = best;
    }

    /// The next keyframe of a random order in which every keyframe comes once per round.
    fn next_keyframe(&mut self) -> Option<usize> {
        let count = self.keyframes.len().min(self.state.frames.len());
        let (round, place) = (self.state.steps.checked_div(count)?, self.state.steps % count);
        if self.round.0 != round {
            self.round = (round, shuffled(count, self.settings.seed, round));
        }
        self.round.1.get(place).copied()
    }

    fn change_density(&mut self) {
        let state = &mut self.state;
        let count = state.gaussians.len();
        let room = self.settings.max_gaussians.saturating_sub(count).min((GROWTH * count as f64) as usize);
        density::divide(&mut state.gaussians, &mut state.moments, &state.pull, room);
        density::prune(&mut state.gaussians, &mut state.moments);
        self.reorder();
    }

    /// Puts neighbours in space next to each other in memory.
    fn reorder(&mut self) {
        let state = &mut self.state;
        let order = density::morton_order(&state.gaussians);
        density::select(&mut state.gaussians, &mut state.moments, &order);
        state.pull = Pull::zeros(state.gaussians.len());
    }
}

impl BundleSettings {
    /// Number of virtual views for a blur length in pixels of the plan's resolution; odd.
    fn views(&self, blur_px: f64, plan: &StepPlan) -> usize {
        let most = if self.blur { plan.max_views.min(self.max_views) } else { 1 };
        // Casts saturate. An even bound gives the odd number below.
        let least = if blur_px > SHARP_PX { 3 } else { 1 };
        let wanted = ((blur_px / plan.spacing).ceil() as usize).max(least) | 1;
        wanted.min(most.saturating_sub(1) | 1)
    }
}

/// Typical depth of an observation, metres; 2 where nothing was measured.
fn typical_depth(seen: &Observation) -> f64 {
    let mut depths: Vec<f32> = seen.depth.iter().copied().filter(|depth| *depth > 0.0).step_by(7).collect();
    if depths.is_empty() {
        return 2.0;
    }
    let middle = depths.len() / 2;
    f64::from(*depths.select_nth_unstable_by(middle, f32::total_cmp).1)
}

/// The numbers below `count` in an order that depends on seed and round only (Fisher and Yates 1938).
fn shuffled(count: usize, seed: u64, round: usize) -> Vec<usize> {
    let mut random = Pcg32::new(seed, round as u64);
    let mut order: Vec<usize> = (0..count).collect();
    for k in (1..count).rev() {
        let other = (u64::from(random.next_u32()) * (k as u64 + 1)) >> 32;
        order.swap(k, other as usize);
    }
    order
}
