//! Joint optimisation of the map and of the paths of all exposures.

use mba_io::statistics::quantile;
use mba_map::map::{MapKind, Scene, SceneRenderer};
use mba_raster::losses::{Exposure, LossTerms};
use mba_raster::sensor::{Observation, Sensor};
use mba_tracker::geometry::RigidTransform;
use mba_tracker::simd::Level;
use rand_core::Rng;
use rand_pcg::Pcg32;
use serde::{Deserialize, Serialize};

use super::bundle_state::{BorrowedBundleState, BundleProgress, BundleState};
use super::capacity::SeenSurface;
use super::frame_state::FrameState;
use super::map_model::{FitContext, MapModel};
use super::mapped_frame::{MapKeyframe, MappedFrame};
use super::path_step::PathStep;
use super::rectified::seen_at_once;
use super::scene_map::SceneMap;
use super::schedule::{Schedule, StepPlan};
use super::seed_view::{DepthSource, SeedView};
use super::seeding;
use crate::deblurring::Reblurred;

/// How the bundle is adjusted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BundleSettings {
    /// What the map consists of.
    pub kind: MapKind,
    /// Whether motion during the exposure is modelled.
    pub blur: bool,
    /// Upper bound of virtual views per exposure.
    pub max_views: usize,
    /// Upper bound of the number of Gaussians.
    pub max_gaussians: usize,
    /// Seed of the order in which keyframes are visited, and of what is random in the map.
    pub seed: u64,
}

/// A map, keyframes, and what is needed to fit the one to the other.
#[derive(Debug)]
pub struct BundleAdjustment<M: MapModel = SceneMap> {
    /// The map.
    pub map: M,
    /// The keyframes in the order of time, with what was estimated of them so far.
    pub frames: Vec<MappedFrame>,
    progress: BundleProgress,
    settings: BundleSettings,
    schedule: Schedule,
    sensor: Sensor,
    renderer: SceneRenderer,
    context: M::Context,
    /// Order of the visits of the current round, and which round that is.
    round: (usize, Vec<usize>),
}

/// What a step did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// The keyframe, counted from 0.
    pub keyframe: usize,
    /// Virtual views of a pixel that were rendered.
    pub views: usize,
    /// Loss before the step.
    pub terms: LossTerms,
}

/// Blur up to this length, pixels, is not seen in a picture: one view shows it.
const SHARP_PX: f64 = 1.0;

/// Frames that are no keyframes are fitted with numbers of draws from here on, which no step has.
const FITS_FROM: u64 = 1 << 40;

impl BundleAdjustment {
    /// Keyframes of one sensor with first estimates of their states, and an empty map; [`Self::seed`] fills it.
    #[must_use]
    pub fn new(level: Level, sensor: Sensor, settings: BundleSettings, frames: Vec<MappedFrame>) -> Self {
        let map = SceneMap::new(settings.kind, settings.seed);
        let context = FitContext::new(level, sensor.clone());
        let schedule = Schedule::of(settings.kind, frames.len());
        Self::with_map((map, context), schedule, level, sensor, settings, frames)
    }
}

impl<M: MapModel> BundleAdjustment<M> {
    /// Keyframes of one sensor with first estimates of their states, and an empty map of any kind with what it works with;
    /// [`Self::seed`] fills it.
    #[must_use]
    pub fn with_map(
        (map, context): (M, M::Context),
        schedule: Schedule,
        level: Level,
        sensor: Sensor,
        settings: BundleSettings,
        frames: Vec<MappedFrame>,
    ) -> Self {
        let progress = BundleProgress::default();
        let (renderer, round) = (SceneRenderer::new(level), (usize::MAX, Vec::new()));
        Self { map, frames, progress, settings, schedule, sensor, renderer, context, round }
    }

    /// How far it is.
    #[must_use]
    pub fn progress(&self) -> BundleProgress {
        self.progress
    }

    /// All that changes from step to step, for a checkpoint.
    #[must_use]
    pub fn state(&self) -> BorrowedBundleState<'_, M> {
        let frames = self.frames.iter().map(|frame| &frame.state).collect();
        BorrowedBundleState { map: &self.map, frames, progress: self.progress }
    }

    /// Goes on from where an adjustment of the same keyframes was stopped. Keyframes of which nothing was kept stay as they
    /// are.
    pub fn restore(&mut self, state: BundleState<M>) {
        (self.map, self.progress) = (state.map, state.progress);
        for (frame, kept) in self.frames.iter_mut().zip(state.frames) {
            frame.state = kept;
        }
    }

    /// The sensor.
    #[must_use]
    pub fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// The schedule.
    #[must_use]
    pub fn schedule(&self) -> &Schedule {
        &self.schedule
    }

    /// Starts another schedule at its beginning.
    pub fn set_schedule(&mut self, schedule: Schedule) {
        self.schedule = schedule;
        (self.progress.scheduled_steps, self.progress.position) = (0, 0.0);
    }

    /// Allows up to so many Gaussians from now on.
    pub fn set_max_gaussians(&mut self, max_gaussians: usize) {
        self.settings.max_gaussians = max_gaussians;
    }

    /// Most Gaussians.
    #[must_use]
    pub fn max_gaussians(&self) -> usize {
        self.settings.max_gaussians
    }

    /// What the keyframes see together.
    #[must_use]
    pub fn seen_surface(&self) -> SeenSurface {
        let depths: Vec<f64> = self.frames.iter().map(|frame| frame.keyframe.depth).collect();
        let mut surface = SeenSurface::new(quantile(&depths, 0.5).unwrap_or(1.0));
        for MappedFrame { keyframe, state } in &self.frames {
            // Half of the pixels along each axis are enough to count by.
            let coarse = keyframe.observation.level(1);
            let shrink = keyframe.observation.level(0).camera.width / coarse.camera.width.max(1);
            surface.add(coarse, &state.path.mid(), shrink);
        }
        surface
    }

    /// Fills the map with what the keyframes see, the sharpest first: each adds what those before it do not cover. Then,
    /// once more, surfaces that no keyframe has a depth of.
    pub fn seed(&mut self) {
        let mut order: Vec<usize> = (0..self.frames.len()).collect();
        order.sort_by(|a, b| self.blur_px(*a).total_cmp(&self.blur_px(*b)));
        for source in [DepthSource::Measured, DepthSource::Completed] {
            for &k in &order {
                self.seed_from(k, source);
            }
        }
        self.map.reorder();
    }

    /// Adds what keyframe `k` sees and the map does not cover.
    pub fn seed_from(&mut self, k: usize, source: DepthSource) {
        let MappedFrame { keyframe, state } = &self.frames[k];
        let FrameState { path, log_gain, .. } = state;
        let (world_from_camera, gain) = (path.mid(), log_gain.exp() as f32);
        let MapKeyframe { index, observation, .. } = keyframe;
        let seen = seen_at_once(observation.level(0), path);
        let view = SeedView { index: *index, seen: &seen, world_from_camera, gain, source };
        self.map.seed(&mut self.context, &view, self.settings.max_gaussians);
    }

    /// Share (0 to 1) of the picture from a pose that the map does not show, at resolution `level`, where 0 is full.
    pub fn uncovered_fraction(&mut self, world_from_camera: &RigidTransform, level: usize) -> f64 {
        let Self { renderer, sensor, .. } = self;
        renderer.render(self.map.scene(), sensor.camera.at_level(level), world_from_camera);
        let alpha = &renderer.image.alpha;
        let open = alpha.iter().filter(|alpha| **alpha < seeding::COVERED).count();
        open as f64 / alpha.len().max(1) as f64
    }

    /// Number of virtual views of a pixel that a step with `plan` on keyframe `k` renders.
    #[must_use]
    pub fn views(&self, k: usize, plan: &StepPlan) -> usize {
        self.settings.view_count(&self.frames[k].keyframe, &self.frames[k].state, plan).per_pixel
    }

    /// One step on the next keyframe, after which the schedule stands at `position_after`. `timed` says whether
    /// positions are shares of time.
    ///
    /// Returns `None` without keyframes.
    pub fn step(&mut self, timed: bool, position_after: impl FnOnce(&Schedule) -> f64) -> Option<StepReport> {
        let k = self.next_keyframe()?;
        let plan = self.schedule.plan(self.progress.position, timed);
        let report = self.visit(k, &plan);
        self.progress.scheduled_steps += 1;
        let before = core::mem::replace(&mut self.progress.position, position_after(&self.schedule));
        if self.schedule.density_changes(before, self.progress.position) {
            self.change_density();
        }
        Some(report)
    }

    /// One step on keyframe `k`, which must be one.
    pub fn visit(&mut self, k: usize, plan: &StepPlan) -> StepReport {
        let MappedFrame { keyframe, state: frame } = &mut self.frames[k];
        let seen = keyframe.observation.level(plan.level);
        let count = self.settings.view_count(keyframe, frame, plan);
        let views = count.of_row;
        let exposure = Exposure { seen, path: &frame.path, gain: frame.log_gain.exp(), views };
        let draw = self.progress.steps as u64;
        let loss = self.map.evaluate(&mut self.context, exposure, plan, draw);

        self.map.step(&mut self.context, plan);
        // The first keyframe says where the world is and how bright.
        let is_first = k == 0;
        if plan.path_pixels > 0.0 {
            // One view says nothing about the motion.
            let still = !self.settings.blur || count.still;
            let hold = [is_first || plan.only_motions, still, still || plan.only_motions];
            let step = PathStep { pixels: plan.path_pixels, hold };
            frame.path_moments.step(
                &mut frame.path,
                &loss.grad_path,
                &keyframe.prior,
                &keyframe.metric,
                step,
            );
            if !is_first {
                frame.log_gain += frame.gain_moments.step(loss.grad_log_gain, plan.log_gain);
            }
        }
        frame.visits += 1;
        self.progress.steps += 1;
        StepReport { keyframe: k, views: count.per_pixel, terms: loss.terms }
    }

    /// Fits path and gain of a frame that is no keyframe to the map as it is. `count` steps on the coarser resolution, of
    /// which the one with the least loss is kept: steps have a length of their own, and would lead away from a path
    /// that is right already.
    pub fn fit_frame(&mut self, unmapped: &MapKeyframe, frame: &mut FrameState, count: usize) {
        let plan = StepPlan { level: 1, spacing: 2.0, path_pixels: 0.3, ..self.schedule.plan(0.1, false) };
        // The same pixels at every step: their losses can be compared.
        let draw = FITS_FROM + unmapped.index as u64;
        let seen = unmapped.observation.level(plan.level);
        let (mut best, mut least) = (frame.clone(), f64::INFINITY);
        for k in 0..count {
            let shrink = 0.05_f64.powf(k as f64 / count as f64);
            let views = self.settings.view_count(unmapped, frame, &plan).of_row;
            let exposure = Exposure { seen, path: &frame.path, gain: frame.log_gain.exp(), views };
            let loss = self.map.evaluate(&mut self.context, exposure, &plan, draw);
            if loss.terms.total() < least {
                (best, least) = (frame.clone(), loss.terms.total());
            }
            let still = !self.settings.blur;
            let step = PathStep { pixels: plan.path_pixels * shrink, hold: [false, still, still] };
            frame.path_moments.step(
                &mut frame.path,
                &loss.grad_path,
                &unmapped.prior,
                &unmapped.metric,
                step,
            );
            frame.log_gain += frame.gain_moments.step(loss.grad_log_gain, 0.01 * shrink);
        }
        *frame = best;
    }

    /// Mean squared difference of display values (0 to 1) between the captured picture of a frame and what the map as it is
    /// predicts of it: all virtual views of its path, its rows and its gain included, in full resolution.
    pub fn prediction_error(&mut self, unmapped: &MapKeyframe, frame: &FrameState) -> f64 {
        let plan = StepPlan { level: 0, ..self.schedule.plan(1.0, false) };
        let views = self.settings.view_count(unmapped, frame, &plan).of_row;
        let seen = unmapped.observation.level(plan.level);
        let exposure = Exposure { seen, path: &frame.path, gain: frame.log_gain.exp(), views };
        let draw = FITS_FROM + unmapped.index as u64;
        self.map.evaluate(&mut self.context, exposure, &plan, draw).terms.mean_square
    }

    /// The next keyframe of a random order in which every keyframe comes once per round.
    fn next_keyframe(&mut self) -> Option<usize> {
        let (count, steps) = (self.frames.len(), self.progress.steps);
        let (round, place) = (steps.checked_div(count)?, steps % count);
        if self.round.0 != round {
            self.round = (round, shuffled(count, self.settings.seed, round));
        }
        self.round.1.get(place).copied()
    }

    /// Puts detail where it is missing and removes what is useless.
    pub fn change_density(&mut self) {
        self.map.change_density(self.settings.max_gaussians);
    }

    /// Length of the blur of keyframe `k`, full-resolution pixels.
    #[must_use]
    pub fn blur_px(&self, k: usize) -> f64 {
        let MappedFrame { keyframe, state } = &self.frames[k];
        let exposure = keyframe.observation.level(0).times.exposure;
        state.blur_px(&self.sensor.camera, keyframe.depth, exposure)
    }
}

impl BundleAdjustment {
    /// The picture of keyframe `k` as the map explains it, with its blur and its rows, in light as bright as captured; none of
    /// a field, whose virtual views take half a second each.
    #[must_use]
    pub fn explained(&mut self, k: usize) -> Option<Reblurred> {
        let Scene::Gaussians(gaussians) = self.map.scene() else { return None };
        let MappedFrame { keyframe, state: frame } = &self.frames[k];
        let seen = keyframe.observation.level(0);
        let plan = StepPlan { level: 0, ..self.schedule.plan(1.0, false) };
        let views = self.settings.view_count(keyframe, frame, &plan).of_row;
        let gain = frame.log_gain.exp() as f32;
        let image = self
            .context
            .gaussian_loss
            .render(gaussians, Exposure { seen, path: &frame.path, gain: 1.0, views });
        // What the lens takes away, and the gain of the frame.
        let as_captured = |plane: &Vec<f32>| match &seen.falloff {
            Some(falloff) => {
                plane.iter().zip(&**falloff).map(|(light, share)| gain * light * share).collect()
            }
            None => plane.iter().map(|light| gain * light).collect(),
        };
        Some(Reblurred { light: image.colour.each_ref().map(as_captured), alpha: image.alpha.clone() })
    }
}

/// Virtual views of a picture.
struct ViewCount {
    /// Of the exposure of one row.
    of_row: usize,
    /// That a pixel is rendered in: neighbours in time have a part in a row, and depth may have its own.
    per_pixel: usize,
    /// Whether the picture says nothing about a motion.
    still: bool,
}

impl BundleSettings {
    /// Virtual views of a frame for a step with `plan`.
    fn view_count(&self, keyframe: &MapKeyframe, frame: &FrameState, plan: &StepPlan) -> ViewCount {
        let Observation { camera, times, .. } = keyframe.observation.level(plan.level);
        let blur_px = frame.blur_px(camera, keyframe.depth, times.exposure);
        let views = self.views(blur_px, plan);
        if times.is_global() {
            return ViewCount { of_row: views, per_pixel: views, still: views == 1 };
        }
        // What is sharp in every row may still lean.
        let sweep_px = frame.blur_px(camera, keyframe.depth, times.exposure + times.readout.abs());
        ViewCount { of_row: views, per_pixel: views + 2, still: views == 1 && sweep_px <= SHARP_PX }
    }

    /// Number of virtual views for a blur length in pixels of the plan's resolution; odd.
    fn views(&self, blur_px: f64, plan: &StepPlan) -> usize {
        let most = if self.blur { plan.max_views.min(self.max_views) } else { 1 };
        // Casts saturate. An even bound gives the odd number below.
        let least = if blur_px > SHARP_PX { 3 } else { 1 };
        let wanted = ((blur_px / plan.spacing).ceil() as usize).max(least) | 1;
        wanted.min(most.saturating_sub(1) | 1)
    }
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
