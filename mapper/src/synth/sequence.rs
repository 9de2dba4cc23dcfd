//! A synthetic sequence in memory: poses at any time, frames one by one.

use glam::Vec3;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::trajectory::{ExposureTrajectory, SampleRule};
use nalgebra::Vector3;

use super::blur::{BlurStatistics, Streak, streak};
use super::calibrate::path_for;
use super::config::{DepthSensor, SynthConfig};
use super::noise::hash2;
use super::render::{SurfaceSample, depth_at, render_mean, render_surface};
use super::scene::Scene;
use super::sensor::{Encoder, expose};
use super::trajectory::HandheldPath;
use super::{SynthError, depth, scenes};

/// Time of the first frame, seconds: every exposure of a tenth of a second or less begins after zero.
pub(super) const FIRST_TIMESTAMP: f64 = 0.1;

/// Fewest sub-frames of an exposure.
const MIN_SUBFRAMES: usize = 16;

/// Sub-frames per pixel of the longest blur: neighbouring views are less than a pixel apart.
const SUBFRAMES_PER_PIXEL: f64 = 1.5;

/// Most sub-frames of an exposure.
const MAX_SUBFRAMES: usize = 512;

/// Rays per pixel of sharp images.
const SHARP_SAMPLES: usize = 16;

/// Blur statistics look at every this many pixels in both directions.
const STATISTICS_STEP: usize = 8;

/// A rendered frame with its ground truth.
#[derive(Clone, Debug, PartialEq)]
pub struct SynthFrame {
    /// Index in the sequence.
    pub index: usize,
    /// Mid exposure, seconds.
    pub timestamp: f64,
    /// Blurred image as the sensor delivers it: `3 * width * height` bytes, rows from the top, red green blue.
    pub rgb: Vec<u8>,
    /// Depth along the optical axis at mid exposure, 5000 units per metre, 0 = missing; `width * height`.
    pub depth: Vec<u16>,
    /// True `world_from_camera` at shutter opening and closing. In between, the motion is not exactly linear.
    pub exposure: ExposureTrajectory,
    /// True `world_from_camera` at mid exposure.
    pub mid: RigidTransform,
    /// True blur lengths.
    pub blur: BlurStatistics,
    /// Number of sub-frames that were averaged.
    pub subframes: usize,
}

/// Size and blur of one frame, without the images.
struct Exposure {
    views: Vec<RigidTransform>,
    surface: Vec<SurfaceSample>,
    blur: BlurStatistics,
}

/// A sequence of blurred RGB-D frames of an analytic scene with exact ground truth.
///
/// Frames are computed on request, in any order, on the current rayon pool; every number depends on the settings
/// alone, not on threads or order.
pub struct SynthSequence {
    config: SynthConfig,
    camera: PinholeCamera,
    path: HandheldPath,
    scene: Scene,
    encoder: Encoder,
}

impl SynthSequence {
    /// Builds the scene and adjusts the hand shake to the blur asked for.
    ///
    /// # Errors
    ///
    /// [`SynthError::Setting`] for a setting out of range, [`SynthError::BlurOutOfReach`] if only an absurd shake
    /// would blur that much.
    pub fn new(config: SynthConfig) -> Result<Self, SynthError> {
        config.check()?;
        let blueprint = scenes::blueprint(config.scene);
        let focal = 500.0 * config.width as f64 / 640.0;
        let camera = PinholeCamera {
            width: config.width,
            height: config.height,
            fx: focal,
            fy: focal,
            cx: 0.5 * (config.width as f64 - 1.0),
            cy: 0.5 * (config.height as f64 - 1.0),
        };
        let scene = Scene::bake(&blueprint, focal as f32 / blueprint.typical_depth);
        let path = path_for(&config, &camera, &scene, blueprint.sweep)?;
        let encoder = Encoder::new(config.response);
        Ok(Self { config, camera, path, scene, encoder })
    }

    /// The settings.
    #[must_use]
    pub fn config(&self) -> &SynthConfig {
        &self.config
    }

    /// Number of frames.
    #[must_use]
    pub fn len(&self) -> usize {
        self.config.frames
    }

    /// Never true: a sequence has at least one frame.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.config.frames == 0
    }

    /// The camera; images are free of distortion.
    #[must_use]
    pub fn camera(&self) -> &PinholeCamera {
        &self.camera
    }

    /// Mid exposure of frame `index` in seconds, a whole number of microseconds.
    #[must_use]
    pub fn timestamp(&self, index: usize) -> f64 {
        timestamp(&self.config, index)
    }

    /// True pose at any time in seconds. World frame: y up, metres, the floor at y = 0.
    #[must_use]
    pub fn world_from_camera(&self, t: f64) -> RigidTransform {
        self.path.world_from_camera(t)
    }

    /// True angular velocity in the camera frame at any time, rad/s.
    #[must_use]
    pub fn angular_velocity(&self, t: f64) -> Vector3<f64> {
        self.path.angular_velocity(t)
    }

    /// True poses at shutter opening and closing of frame `index`.
    #[must_use]
    pub fn exposure(&self, index: usize) -> ExposureTrajectory {
        let at = |s: f64| self.world_from_camera(self.time_within(index, s));
        ExposureTrajectory { start: at(0.0), end: at(1.0) }
    }

    /// The blurred frame `index`, as sensors see it.
    #[must_use]
    pub fn render_frame(&self, index: usize) -> SynthFrame {
        let exposure = self.expose(index);
        let light = render_mean(&self.scene, &self.camera, &exposure.views, 1, self.jitter_seed(index, 0));
        let noise = self.config.noise.map(|noise| (noise, self.config.seed, index));
        SynthFrame {
            index,
            timestamp: self.timestamp(index),
            rgb: expose(&light, self.camera.width, self.config.gain as f32, noise, &self.encoder),
            depth: self.measure_depth(&exposure.surface, index),
            exposure: self.exposure(index),
            mid: self.world_from_camera(self.timestamp(index)),
            blur: exposure.blur,
            subframes: exposure.views.len(),
        }
    }

    /// What a perfect camera with an infinitely short exposure sees in the middle of frame `index`: same gain and
    /// response, no noise. Interleaved RGB as in [`SynthFrame::rgb`].
    #[must_use]
    pub fn render_sharp(&self, index: usize) -> Vec<u8> {
        self.render_sharp_from(&self.world_from_camera(self.timestamp(index)), index)
    }

    /// As [`Self::render_sharp`] from any pose `world_from_camera`; `key` selects the jitter of the rays.
    #[must_use]
    pub fn render_sharp_from(&self, world_from_camera: &RigidTransform, key: usize) -> Vec<u8> {
        let light = self.sharp_light(world_from_camera, key);
        expose(&light, self.camera.width, self.config.gain as f32, None, &self.encoder)
    }

    /// Exact depth along the optical axis from any pose, metres, infinite where nothing is met; `width * height`
    /// values, rows from the top.
    #[must_use]
    pub fn render_depth_from(&self, world_from_camera: &RigidTransform) -> Vec<f32> {
        let surface = render_surface(&self.scene, &self.camera, world_from_camera);
        surface.into_iter().map(|sample| sample.z).collect()
    }

    /// Exact depth at mid exposure of frame `index` in raw units (5000 per metre), whatever the depth sensor.
    #[must_use]
    pub fn render_exact_depth(&self, index: usize) -> Vec<u16> {
        let mid = self.world_from_camera(self.timestamp(index));
        depth::exact(&render_surface(&self.scene, &self.camera, &mid))
    }

    /// True blur lengths of frame `index`, without rendering the image.
    #[must_use]
    pub fn blur(&self, index: usize) -> BlurStatistics {
        self.expose(index).blur
    }

    /// Linear light (before gain) of the sharp view from a pose.
    pub(super) fn sharp_light(&self, world_from_camera: &RigidTransform, key: usize) -> Vec<Vec3> {
        let views = [*world_from_camera];
        render_mean(&self.scene, &self.camera, &views, SHARP_SAMPLES, self.jitter_seed(key, 1))
    }

    /// Time in seconds at normalised time `s` of an exposure.
    fn time_within(&self, index: usize, s: f64) -> f64 {
        self.timestamp(index) + (s - 0.5) * self.config.exposure_seconds
    }

    fn jitter_seed(&self, index: usize, purpose: i32) -> u32 {
        hash2(index as i32, purpose, self.config.seed as u32)
    }

    /// Surface at mid exposure, blur, and the poses of the sub-frames.
    fn expose(&self, index: usize) -> Exposure {
        let mid = self.world_from_camera(self.timestamp(index));
        let surface = render_surface(&self.scene, &self.camera, &mid);
        let streaks = self.streaks(index, &mid, &surface);
        let longest = streaks.iter().map(|streak| streak.path).fold(0.0, f64::max);
        let wanted = (SUBFRAMES_PER_PIXEL * longest).ceil() as usize;
        let subframes = wanted.clamp(MIN_SUBFRAMES, MAX_SUBFRAMES);
        let time = |k: usize| self.time_within(index, SampleRule::Midpoint.time(k, subframes));
        let views = (0..subframes).map(|k| self.world_from_camera(time(k))).collect();
        Exposure { views, surface, blur: BlurStatistics::of(&streaks) }
    }

    fn streaks(&self, index: usize, mid: &RigidTransform, surface: &[SurfaceSample]) -> Vec<Streak> {
        // Nine poses follow a path of at most 8 Hz through any exposure.
        let poses: [RigidTransform; 9] = std::array::from_fn(|k| {
            self.world_from_camera(self.time_within(index, k as f64 / 8.0)).inverse()
        });
        let (width, height) = (self.camera.width, self.camera.height);
        let offset = STATISTICS_STEP / 2;
        (offset..height)
            .step_by(STATISTICS_STEP)
            .flat_map(|y| (offset..width).step_by(STATISTICS_STEP).map(move |x| (x, y)))
            .filter(|(x, y)| surface[y * width + x].z.is_finite())
            .filter_map(|(x, y)| {
                let z = f64::from(surface[y * width + x].z);
                streak(&self.camera, mid, &poses, (x as f64, y as f64), z)
            })
            .collect()
    }

    fn measure_depth(&self, surface: &[SurfaceSample], index: usize) -> Vec<u16> {
        match self.config.depth {
            DepthSensor::Exact => depth::exact(surface),
            DepthSensor::StructuredLight => {
                let focal = self.camera.fx as f32;
                depth::structured_light(surface, self.camera.width, focal, self.config.seed, index)
            }
        }
    }

    /// Depth at a pixel of a pose, for tests and statistics that need few of them.
    #[must_use]
    pub fn depth_at(&self, world_from_camera: &RigidTransform, pixel: (f64, f64)) -> Option<f64> {
        depth_at(&self.scene, &self.camera, world_from_camera, pixel)
    }
}

/// Mid exposure of a frame.
pub(super) fn timestamp(config: &SynthConfig, index: usize) -> f64 {
    let exact = FIRST_TIMESTAMP + index as f64 / config.frame_rate;
    (exact * 1e6).round() / 1e6
}
