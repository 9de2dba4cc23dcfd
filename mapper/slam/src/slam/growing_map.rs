//! The map while frames come in.

use mba_adjust::bundle::{
    BundleAdjustment, BundleState, DepthSource, FrameState, MapKeyframe, MapModel, MappedFrame, NOTICEABLE,
    PathPrior, Placed, Schedule, log_brightness,
};
use mba_io::dataset::RgbdFrame;
use mba_io::trajectory_file::TimedExposure;
use mba_raster::exposure::{ExposurePath, motion_of};
use mba_raster::sensor::{ObservationPyramid, Sensor};
use mba_tracker::SimdLevel;
use mba_tracker::geometry::RigidTransform;
use mba_tracker::trajectory::ExposureTrajectory;
use rand_core::Rng;
use rand_pcg::Pcg32;

use super::keyframe_choice::{NEW_AREA, Neighbour, is_worth_it, most_dispensable, neighbours};
use super::saved::{Growth, SavedKeyframe};
use super::settings::SlamSettings;

/// Resolutions of an observation: full and half.
pub(super) const LEVELS: usize = 2;

/// The coarser resolution.
const COARSE: usize = 1;

/// Work per frame, in virtual views of the coarser resolution.
const EFFORT: f64 = 36.0;

/// What a step costs besides its views, in views: comparing pictures and moving Gaussians.
const STEP_COST: f64 = 3.0;

/// Pixels that show something new per Gaussian.
const PIXELS_PER_GAUSSIAN: usize = 9;

/// Keyframes around the newest that are visited most.
const WINDOW: usize = 8;

/// A map is young for so many steps.
const YOUNG_STEPS: usize = 60;

/// Movement of the picture, as a fraction of its width, beyond which a keyframe says nothing about a view: the map between
/// it and there was fitted to no picture that is still known.
const NEARBY: f64 = 0.08;

/// Steps between two changes of density.
const DENSITY_EVERY: usize = 48;

/// A map, its keyframes, and how work is spread over them.
pub(super) struct GrowingMap {
    pub(super) bundle: BundleAdjustment,
    pub(super) sensor: Sensor,
    pub(super) simd: SimdLevel,
    settings: SlamSettings,
    random: Pcg32,
    /// Effort that is left over, or was taken in advance.
    effort: f64,
    steps: usize,
    /// Pixels that showed something new, in pictures.
    seen: f64,
    /// Keyframes that were given up.
    pub(super) retired: usize,
}

impl GrowingMap {
    pub(super) fn new(simd: SimdLevel, sensor: Sensor, settings: &SlamSettings) -> Self {
        let bundle_settings = settings.mapping().bundle();
        let bundle = BundleAdjustment::new(simd, sensor.clone(), bundle_settings, Vec::new());
        let random = Pcg32::new(settings.seed, 0);
        Self {
            bundle,
            sensor,
            simd,
            settings: *settings,
            random,
            effort: 0.0,
            steps: 0,
            seen: 0.0,
            retired: 0,
        }
    }

    /// The map of a run that was stopped, with its keyframes.
    pub(super) fn restored(
        (simd, sensor): (SimdLevel, Sensor),
        settings: &SlamSettings,
        (keyframes, state): (Vec<MapKeyframe>, BundleState),
        (max_gaussians, growth): (usize, Growth),
    ) -> Self {
        let mut map = Self::new(simd, sensor, settings);
        for (keyframe, frame) in keyframes.into_iter().zip(&state.frames) {
            map.bundle.frames.push(MappedFrame { keyframe, state: frame.clone() });
        }
        map.bundle.restore(state);
        map.bundle.set_max_gaussians(max_gaussians);
        // Every second step draws a number.
        map.random.advance(growth.steps as u64 / 2);
        let Growth { effort, steps, seen, retired } = growth;
        Self { effort, steps, seen, retired, ..map }
    }

    /// How far the map has grown.
    pub(super) fn growth(&self) -> Growth {
        Growth { effort: self.effort, steps: self.steps, seen: self.seen, retired: self.retired }
    }

    /// The keyframes, as a checkpoint keeps them.
    pub(super) fn saved_keyframes(&self) -> Vec<SavedKeyframe> {
        self.bundle.frames.iter().map(|frame| SavedKeyframe::from(&frame.keyframe)).collect()
    }

    /// Takes a tracked frame in, as a keyframe if it shows something new; returns whether it does.
    pub(super) fn insert_frame(&mut self, exposure: &TimedExposure, blur_px: f64, image: &RgbdFrame) -> bool {
        let camera = self.sensor.camera;
        let near = neighbours(&self.bundle, &exposure.mid, &camera);
        let blur_px = if blur_px.is_finite() { blur_px } else { 0.0 };
        // A new view, a much sharper one, or an area that the map does not have yet.
        let wanted = is_worth_it(&self.bundle, near.first(), blur_px, camera.width)
            || self.bundle.uncovered_fraction(&exposure.mid, COARSE) > NEW_AREA;
        if !wanted {
            return false;
        }
        let Some(observation) = ObservationPyramid::new(&self.sensor, image, LEVELS) else { return false };
        let path = self.path_over(exposure, image.exposure_seconds, image.depth_timestamp - image.timestamp);
        let path = if self.settings.blur { path } else { ExposurePath::still(path.mid()) };
        let prior = PathPrior { middle: path.ends.mid(), is_measured: true, motion: None };
        let mut state = FrameState::new(path);
        // The gain of the keyframe next to it, but for what exposure control changed.
        state.log_gain = near.first().map_or(0.0, |near| self.log_gain(near.keyframe, &observation, &state));
        let keyframe = MapKeyframe::new(image.index, observation, prior);
        self.bundle.frames.push(MappedFrame { keyframe, state });
        self.seed();
        // One in, one out, when there is no more room.
        if self.bundle.frames.len() > self.settings.max_keyframes.max(2)
            && let Some(k) = most_dispensable(&self.bundle, &camera)
        {
            // What the map learnt from it stays.
            self.bundle.frames.remove(k);
            self.retired += 1;
        }
        true
    }

    /// Logarithm of the gain of a new frame, told from keyframe `k` near it.
    fn log_gain(&self, k: usize, observation: &ObservationPyramid, frame: &FrameState) -> f64 {
        let known = &self.bundle.frames[k];
        let here = Placed { seen: observation.level(COARSE), world_from_camera: frame.path.mid() };
        // What the adjustment finds itself is left to it.
        let ratio = log_brightness(&self.sensor.inverse_response, known.placed(COARSE), here).unwrap_or(0.0);
        known.state.log_gain + if ratio.abs() > NOTICEABLE { ratio } else { 0.0 }
    }

    /// The path over all the time in which anything of a frame was measured.
    fn path_over(&self, exposure: &TimedExposure, seconds: f64, depth_offset: f64) -> ExposurePath {
        let (_, stretch) = self.sensor.times(seconds, depth_offset);
        long_path(exposure, stretch)
    }

    /// Takes a better estimate of a frame that may be a keyframe.
    pub(super) fn revise(&mut self, index: usize, exposure: &TimedExposure) {
        let known = self.bundle.frames.iter_mut().find(|frame| frame.keyframe.index == index);
        if let Some(MappedFrame { keyframe, state }) = known.filter(|_| self.settings.blur) {
            let exposure_share = keyframe.observation.level(0).times.exposure;
            state.path = long_path(exposure, 1.0 / exposure_share);
        }
    }

    /// Whether the map has had enough steps to be worth a look.
    pub(super) fn is_mature(&self) -> bool {
        self.steps >= YOUNG_STEPS
    }

    /// The keyframe with the view nearest to a pose, other than frame `index` itself; none where all are far, because those
    /// nearby were given up or the camera has just come.
    pub(super) fn nearest_other(&self, world_from_camera: &RigidTransform, index: usize) -> Option<usize> {
        let near = neighbours(&self.bundle, world_from_camera, &self.sensor.camera);
        let nearest = near.iter().find(|near| self.bundle.frames[near.keyframe].keyframe.index != index)?;
        let is_near = nearest.pixels <= NEARBY * self.sensor.camera.width as f64;
        is_near.then_some(nearest.keyframe)
    }

    /// Adds what the newest keyframe shows, and allows the map to grow accordingly.
    fn seed(&mut self) {
        let newest = self.bundle.frames.len() - 1;
        let pixels = (self.sensor.camera.width * self.sensor.camera.height) as f64;
        let most = self.settings.max_gaussians.unwrap_or(usize::MAX);
        let pose = self.bundle.frames[newest].state.path.mid();
        self.seen += if newest == 0 { 1.0 } else { self.bundle.uncovered_fraction(&pose, COARSE) };
        let by_area = (self.seen * pixels) as usize / PIXELS_PER_GAUSSIAN;
        self.bundle.set_max_gaussians(by_area.max(2000).min(most));
        self.bundle.seed_from(newest, DepthSource::Measured);
    }

    /// A frame's share of the work, around a pose: steps as long as `goes_on` with the effort that is left.
    pub(super) fn work(&mut self, world_from_camera: &RigidTransform, mut goes_on: impl FnMut(f64) -> bool) {
        if self.bundle.map.is_empty() {
            return;
        }
        let near = neighbours(&self.bundle, world_from_camera, &self.sensor.camera);
        // Effort that was not made when there was no time is not made up for.
        self.effort = self.effort.min(0.0) + EFFORT;
        while goes_on(self.effort) {
            let k = self.next_keyframe(&near);
            let plan = Schedule::growing(self.bundle.frames[k].state.visits);
            let report = self.bundle.visit(k, &plan);
            self.effort -= report.views as f64 + STEP_COST;
            self.steps += 1;
            if self.steps.is_multiple_of(DENSITY_EVERY) {
                self.bundle.change_density();
            }
        }
    }

    /// In turn the least visited of the window around the camera, and any one: what was learnt before must not be
    /// forgotten.
    fn next_keyframe(&mut self, near: &[Neighbour]) -> usize {
        let visits = |near: &&Neighbour| self.bundle.frames[near.keyframe].state.visits;
        let local = near.iter().take(WINDOW).min_by_key(visits).map_or(0, |near| near.keyframe);
        if self.steps.is_multiple_of(2) {
            return local;
        }
        let any = (u64::from(self.random.next_u32()) * near.len() as u64) >> 32;
        near.get(any as usize).map_or(local, |near| near.keyframe)
    }
}

/// The path over `stretch` times the exposure. Over a longer time than the exposure it is straight: what a bow adds grows
/// with the square of time.
fn long_path(exposure: &TimedExposure, stretch: f64) -> ExposurePath {
    if stretch == 1.0 {
        return ExposurePath::through(exposure);
    }
    let motion = motion_of(exposure).motion() * stretch;
    ExposurePath::linear(ExposureTrajectory::from_mid_and_motion(&exposure.mid, &motion))
}
