//! A synthetic sequence in memory.

use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::trajectory::ExposureTrajectory;

use super::blur::{self, BlurFigure, ExposurePoses};
use super::develop::Developer;
use super::heldout;
use super::motion::{CameraPath, Steady};
use super::render::{self, DepthSample, Size, SubFrame, TURNED_GRID};
use super::scene::Scene;
use super::surface;
use super::view::View;
use super::{CameraMotion, SynthConfig, SynthError};
use crate::dataset::RgbdFrame;
use crate::trajectory_file::TimedPose;

/// Mid exposure of the first frame, seconds.
const FIRST_TIMESTAMP: f64 = 0.1;

/// Fewest sub-frames of a blurred image.
const MIN_SUB_FRAMES: usize = 16;

/// Sub-frames per pixel of the longest blur: neighbouring ones are less than a pixel apart.
const SUB_FRAMES_PER_PIXEL: f64 = 1.2;

/// Step of the numerical differentiation of orientation, seconds: truncation and rounding errors are both near
/// 1e-9 of the rate.
const RATE_STEP: f64 = 1e-4;

/// A camera on a continuous path through a scene. Frames are rendered when asked for, in parallel, and do not
/// depend on the number of threads.
pub struct SynthSequence {
    config: SynthConfig,
    camera: PinholeCamera,
    scene: Scene,
    path: CameraPath,
}

/// One frame of a synthetic sequence with its ground truth.
#[derive(Clone, Debug)]
pub struct SynthFrame {
    /// Mid exposure, seconds.
    pub timestamp: f64,
    /// Time the shutter was open, seconds.
    pub exposure_seconds: f64,
    /// Image width in pixels.
    pub width: usize,
    /// Image height in pixels.
    pub height: usize,
    /// Blurred image: bytes R, G, B per pixel, row by row.
    pub rgb: Vec<u8>,
    /// Depth along the optical axis at mid exposure, 5000 units per metre, 0 is missing, row by row.
    pub depth: Vec<u16>,
    /// Pose at mid exposure.
    pub world_from_camera: RigidTransform,
    /// Poses at shutter opening and closing; the motion between is not exactly linear.
    pub exposure: ExposureTrajectory,
    /// How far the image moved.
    pub blur: BlurFigure,
    /// Number of sub-frames that were averaged.
    pub sub_frames: usize,
}

impl SynthFrame {
    /// What a camera delivers of it, as frame `index` of a data set.
    #[must_use]
    pub fn into_captured(self, index: usize) -> RgbdFrame {
        let Self { timestamp, exposure_seconds, width, height, rgb, depth, .. } = self;
        let depth_timestamp = timestamp;
        RgbdFrame { index, timestamp, depth_timestamp, exposure_seconds, width, height, rgb, depth }
    }
}

impl SynthSequence {
    /// Prepares scene and camera path; scales the hand shake to the blur asked for.
    ///
    /// # Errors
    ///
    /// [`SynthError::Setting`] for a number out of range, [`SynthError::BlurOutOfReach`].
    pub fn new(config: SynthConfig) -> Result<Self, SynthError> {
        config.check()?;
        let scene = Scene::new(config.scene, config.motion);
        let camera = config.camera();
        let path = CameraPath::new(steady(&config, &scene), config.seed);
        let exposures: Vec<_> = (0..config.frames).map(|index| exposure_times(&config, index)).collect();
        let path = blur::scale_to_blur(&path, &scene, &camera, &exposures, config.mean_blur_px)?;
        Ok(Self { config, camera, scene, path })
    }

    /// The settings.
    #[must_use]
    pub fn config(&self) -> &SynthConfig {
        &self.config
    }

    /// Number of frames, at least 1.
    #[must_use]
    pub fn len(&self) -> usize {
        self.config.frames
    }

    /// Whether there are no frames; never the case.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.config.frames == 0
    }

    /// Intrinsics of colour and depth; there is no distortion.
    #[must_use]
    pub fn camera(&self) -> PinholeCamera {
        self.camera
    }

    /// Mid exposure of frame `index`, seconds, a whole number of microseconds.
    #[must_use]
    pub fn timestamp(&self, index: usize) -> f64 {
        exposure_times(&self.config, index)[1]
    }

    /// The camera's exact pose at `time`, seconds; any time is valid.
    #[must_use]
    pub fn world_from_camera(&self, time: f64) -> RigidTransform {
        self.path.pose(time)
    }

    /// The camera's angular velocity at `time` in its own axes, radians per second: what a gyroscope measures.
    #[must_use]
    pub fn angular_velocity(&self, time: f64) -> nalgebra::Vector3<f64> {
        let [before, after] = [-RATE_STEP, RATE_STEP].map(|step| self.path.pose(time + step));
        before.tangent_to(&after).fixed_rows::<3>(3) / (2.0 * RATE_STEP)
    }

    /// True poses at shutter opening and closing of frame `index`, `world_from_camera`. Between them the camera
    /// does not move exactly as [`ExposureTrajectory`] says.
    #[must_use]
    pub fn exposure(&self, index: usize) -> ExposureTrajectory {
        let [start, _, end] = self.exposure_poses(index);
        ExposureTrajectory { start, end }
    }

    /// How far the image moves during the exposure of frame `index`.
    #[must_use]
    pub fn blur(&self, index: usize) -> BlurFigure {
        blur::of_exposure(&self.scene, &self.camera, &self.exposure_poses(index))
    }

    /// Renders frame `index`: the blurred image with noise, the depth, the truth.
    #[must_use]
    pub fn render_frame(&self, index: usize) -> SynthFrame {
        let blur = self.blur(index);
        let sub_frames = MIN_SUB_FRAMES.max((SUB_FRAMES_PER_PIXEL * blur.longest_path_px).ceil() as usize);
        let radiance = render::radiance(&self.scene, self.size(), &self.sub_frames(index, sub_frames));
        let timestamp = self.timestamp(index);
        SynthFrame {
            timestamp,
            exposure_seconds: self.config.exposure_seconds,
            width: self.camera.width,
            height: self.camera.height,
            rgb: self.developer().develop(&radiance, self.camera.width, index),
            depth: self.render_depth(index),
            world_from_camera: self.world_from_camera(timestamp),
            exposure: self.exposure(index),
            blur,
            sub_frames,
        }
    }

    /// Renders the scene at mid exposure of frame `index` without blur or noise: bytes R, G, B per pixel, row by
    /// row, with the gain and response of the sequence.
    #[must_use]
    pub fn render_sharp(&self, index: usize) -> Vec<u8> {
        self.render_view(&self.world_from_camera(self.timestamp(index)))
    }

    /// As [`Self::render_sharp`] from any pose.
    #[must_use]
    pub fn render_view(&self, world_from_camera: &RigidTransform) -> Vec<u8> {
        let view = View::new(&self.camera, world_from_camera);
        let rays = TURNED_GRID.map(|offset| SubFrame { view, offset });
        let radiance = render::radiance(&self.scene, self.size(), &rays);
        Developer { noise: None, ..self.developer() }.develop(&radiance, self.camera.width, 0)
    }

    /// Poses near the camera's path, between frames and a little beside it, in order of time; with
    /// [`Self::render_view`] they test whether a map shows more than its own images.
    #[must_use]
    pub fn heldout_poses(&self) -> Vec<TimedPose> {
        heldout::poses(self)
    }

    /// Points of the true surface that frames see at mid exposure: world, metres, about a centimetre apart where pixels
    /// are that dense; meshes can be judged by them.
    #[must_use]
    pub fn surface_points(&self) -> Vec<[f32; 3]> {
        surface::points(self)
    }

    /// The points of the world that the pixels of frame `index` see at mid exposure, without noise.
    pub(super) fn seen_points(&self, index: usize) -> Vec<[f32; 3]> {
        let world_from_camera = self.world_from_camera(self.timestamp(index));
        let samples = render::depth(&self.scene, self.size(), &View::new(&self.camera, &world_from_camera));
        let point = |(pixel, sample): (usize, &DepthSample)| {
            let [u, v] = [pixel % self.camera.width, pixel / self.camera.width];
            let ray = self.camera.ray(u as f64, v as f64);
            world_from_camera.transform_point(&(ray * f64::from(sample.depth))).map(|x| x as f32).into()
        };
        samples.iter().enumerate().map(point).collect()
    }

    fn render_depth(&self, index: usize) -> Vec<u16> {
        let view = View::new(&self.camera, &self.world_from_camera(self.timestamp(index)));
        let samples = render::depth(&self.scene, self.size(), &view);
        self.config.depth.measure(&samples, self.camera.width, self.config.seed, index)
    }

    /// Views at the middle of `count` equal parts of the exposure.
    fn sub_frames(&self, index: usize, count: usize) -> Vec<SubFrame> {
        let [start, _, end] = exposure_times(&self.config, index);
        let at = |k: usize| start + (end - start) * (k as f64 + 0.5) / count as f64;
        let view = |k: usize| View::new(&self.camera, &self.path.pose(at(k)));
        (0..count).zip(render::jitter(count)).map(|(k, offset)| SubFrame { view: view(k), offset }).collect()
    }

    fn exposure_poses(&self, index: usize) -> ExposurePoses {
        exposure_times(&self.config, index).map(|time| self.path.pose(time))
    }

    fn developer(&self) -> Developer {
        let SynthConfig { gain, noise, response, seed, .. } = self.config;
        Developer { gain, noise, response, seed }
    }

    fn size(&self) -> Size {
        Size { width: self.camera.width, height: self.camera.height }
    }
}

/// The way without shake; a round lasts from the first frame to the last.
fn steady(config: &SynthConfig, scene: &Scene) -> Steady {
    match config.motion {
        CameraMotion::Sweep => Steady::Sweep(scene.sweep),
        CameraMotion::Loop => Steady::Round {
            round: scene.round,
            begin: FIRST_TIMESTAMP,
            duration: (config.frames - 1).max(1) as f64 / config.frame_rate,
        },
    }
}

/// Shutter opening, mid exposure and closing of frame `index`, seconds. Mid exposure is rounded to what the files
/// store, so that file and truth agree.
fn exposure_times(config: &SynthConfig, index: usize) -> [f64; 3] {
    let mid = ((FIRST_TIMESTAMP + index as f64 / config.frame_rate) * 1e6).round() / 1e6;
    let half = 0.5 * config.exposure_seconds;
    [mid - half, mid, mid + half]
}
