//! A synthetic sequence in memory.

use glam::Vec3;
use mba_io::dataset::RgbdFrame;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::trajectory::ExposureTrajectory;
use nalgebra::Vector3;

use super::blur::{self, BlurFigure, ExposurePoses};
use super::develop::Developer;
use super::motion::{CameraPath, Steady};
use super::render::{self, DepthSample, Size, SubFrame, TURNED_GRID};
use super::scene::Scene;
use super::view::View;
use super::walk::Walk;
use super::{CameraMotion, SynthConfig, SynthError, auto_exposure, timing};

/// Fewest sub-frames of a blurred image.
const MIN_SUB_FRAMES: usize = 16;

/// Sub-frames per pixel of the longest blur: neighbouring ones are less than a pixel apart.
const SUB_FRAMES_PER_PIXEL: f64 = 1.2;

/// Step of the numerical differentiation of the path, seconds. For orientation, truncation and rounding errors are
/// both near 1e-9 of the rate; for the second derivative of position, both are below 1e-5 m/s^2.
const RATE_STEP: f64 = 1e-4;

/// A camera on a continuous path through a scene. Frames are rendered when asked for, in parallel, and do not
/// depend on the number of threads.
pub struct SynthSequence {
    config: SynthConfig,
    camera: PinholeCamera,
    scene: Scene,
    path: CameraPath,
    /// Exposure time of each frame, seconds.
    exposures: Vec<f64>,
}

/// One frame of a synthetic sequence with its ground truth.
#[derive(Clone, Debug)]
pub struct SynthFrame {
    /// Mid exposure of the middle of the image, seconds.
    pub timestamp: f64,
    /// When depth was measured, seconds.
    pub depth_timestamp: f64,
    /// Time the shutter was open, seconds.
    pub exposure_seconds: f64,
    /// Image width in pixels.
    pub width: usize,
    /// Image height in pixels.
    pub height: usize,
    /// Blurred image: bytes R, G, B per pixel, row by row.
    pub rgb: Vec<u8>,
    /// Depth along the optical axis at its own time, 5000 units per metre, 0 is missing, row by row.
    pub depth: Vec<u16>,
    /// Pose at mid exposure of the middle of the image.
    pub world_from_camera: RigidTransform,
    /// Poses at opening and closing of the shutter for the middle of the image; the motion between is not exactly
    /// linear.
    pub exposure: ExposureTrajectory,
    /// How far the middle of the image moved.
    pub blur: BlurFigure,
    /// Number of sub-frames that were averaged.
    pub sub_frames: usize,
}

impl SynthFrame {
    /// What a camera delivers of it, as frame `index` of a data set.
    #[must_use]
    pub fn into_captured(self, index: usize) -> RgbdFrame {
        let Self { timestamp, depth_timestamp, exposure_seconds, width, height, rgb, depth, .. } = self;
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
        let scene = match config.motion {
            CameraMotion::Walk => Scene::rooms(Walk::rooms(config.frames as f64 / config.frame_rate)),
            motion => Scene::new(config.scene, motion),
        };
        let camera = config.camera();
        let path = CameraPath::new(steady(&config, &scene), config.seed);
        // Exposures follow from what the path shows, and the blur from both: the path is scaled until all of it fits.
        let exposures_along = |path: &CameraPath| auto_exposure::exposures(&config, &scene, &camera, path);
        let poses_along = |path: &CameraPath| {
            let of_frame = |(index, exposure)| timing::exposure_poses(&config, path, index, exposure, 0.0);
            exposures_along(path).into_iter().enumerate().map(of_frame).collect()
        };
        let (blur, exposure) = (config.mean_blur_px, config.exposure_seconds);
        let path = blur::scale_to_blur(&path, &scene, &camera, poses_along, blur, exposure)?;
        let exposures = exposures_along(&path);
        Ok(Self { config, camera, scene, path, exposures })
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

    /// Mid exposure of the middle of frame `index`, seconds, a whole number of microseconds.
    #[must_use]
    pub fn timestamp(&self, index: usize) -> f64 {
        timing::timestamp(&self.config, index)
    }

    /// When the depth of frame `index` is measured, seconds, a whole number of microseconds.
    #[must_use]
    pub fn depth_timestamp(&self, index: usize) -> f64 {
        timing::depth_timestamp(&self.config, index)
    }

    /// Time the shutter is open for frame `index`, seconds.
    ///
    /// # Panics
    ///
    /// If `index` is not below [`Self::len`].
    #[must_use]
    pub fn exposure_seconds(&self, index: usize) -> f64 {
        self.exposures[index]
    }

    /// The camera's exact pose at `time`, seconds; any time is valid.
    #[must_use]
    pub fn world_from_camera(&self, time: f64) -> RigidTransform {
        self.path.pose(timing::on_path_at(&self.config, time))
    }

    /// The camera's angular velocity at `time` in its own axes, radians per second: what a gyroscope measures.
    #[must_use]
    pub fn angular_velocity(&self, time: f64) -> Vector3<f64> {
        let [before, _, after] = self.around(time);
        before.tangent_to(&after).fixed_rows::<3>(3) / (2.0 * RATE_STEP)
    }

    /// The camera's acceleration at `time` in the world, metres per second squared.
    #[must_use]
    pub fn acceleration(&self, time: f64) -> Vector3<f64> {
        let [before, now, after] = self.around(time).map(|pose| pose.translation);
        (before - now * 2.0 + after) / (RATE_STEP * RATE_STEP)
    }

    /// Poses on the path shortly before, at and shortly after `time`, on one side of a jump.
    fn around(&self, time: f64) -> [RigidTransform; 3] {
        let time = timing::on_path_at(&self.config, time);
        [-RATE_STEP, 0.0, RATE_STEP].map(|step| self.path.pose(time + step))
    }

    /// True poses at opening and closing of the shutter for the middle of frame `index`, `world_from_camera`. Between them the camera
    /// does not move exactly as [`ExposureTrajectory`] says.
    #[must_use]
    pub fn exposure(&self, index: usize) -> ExposureTrajectory {
        let [start, _, end] = self.exposure_poses(index, 0.0);
        ExposureTrajectory { start, end }
    }

    /// How far the image moves during the exposure of the middle of frame `index`.
    #[must_use]
    pub fn blur(&self, index: usize) -> BlurFigure {
        blur::of_exposure(&self.scene, &self.camera, &self.exposure_poses(index, 0.0))
    }

    /// Renders frame `index`: the blurred image with noise, the depth, the truth.
    #[must_use]
    pub fn render_frame(&self, index: usize) -> SynthFrame {
        let blur = self.blur(index);
        let sub_frames = self.sub_frame_count(index, &blur);
        // A covered or flooded frame has one value everywhere, and no depth.
        let flood = self.config.events.flood(index);
        let rgb = match flood {
            Some(value) => vec![value; 3 * self.camera.width * self.camera.height],
            None => self.develop(&self.radiance(index, sub_frames), index),
        };
        let depth = match flood {
            Some(_) => vec![0; self.camera.width * self.camera.height],
            None => self.render_depth(index),
        };
        let [start, mid, end] = self.exposure_poses(index, 0.0);
        SynthFrame {
            timestamp: self.timestamp(index),
            depth_timestamp: self.depth_timestamp(index),
            exposure_seconds: self.exposures[index],
            width: self.camera.width,
            height: self.camera.height,
            rgb,
            depth,
            world_from_camera: mid,
            exposure: ExposureTrajectory { start, end },
            blur,
            sub_frames,
        }
    }

    /// Renders the scene at the timestamp of frame `index` without blur or noise, all rows together: bytes R, G, B per
    /// pixel, row by row, with the exposure time of the frame, and fall-off, gain and response of the sequence.
    #[must_use]
    pub fn render_sharp(&self, index: usize) -> Vec<u8> {
        let [_, mid, _] = self.exposure_poses(index, 0.0);
        self.render_clean(&mid, self.exposures[index])
    }

    /// As [`Self::render_sharp`] from any pose, with the exposure time of the settings.
    #[must_use]
    pub fn render_view(&self, world_from_camera: &RigidTransform) -> Vec<u8> {
        self.render_clean(world_from_camera, self.config.exposure_seconds)
    }

    /// The points of the world that the pixels of frame `index` see at mid exposure, without noise; none if it is covered
    /// or flooded.
    pub(super) fn seen_points(&self, index: usize) -> Vec<[f32; 3]> {
        if self.config.events.flood(index).is_some() {
            return Vec::new();
        }
        let [_, world_from_camera, _] = self.exposure_poses(index, 0.0);
        let samples = render::depth(&self.scene, self.size(), &View::new(&self.camera, &world_from_camera));
        let point = |(pixel, sample): (usize, &DepthSample)| {
            let [u, v] = [pixel % self.camera.width, pixel / self.camera.width];
            let ray = self.camera.ray(u as f64, v as f64);
            world_from_camera.transform_point(&(ray * f64::from(sample.depth))).map(|x| x as f32).into()
        };
        samples.iter().enumerate().map(point).collect()
    }

    fn render_depth(&self, index: usize) -> Vec<u16> {
        let mid = self.depth_timestamp(index);
        let samples = if self.config.sensor.depth_readout_seconds == 0.0 {
            render::depth(&self.scene, self.size(), &self.view(index, mid))
        } else {
            let view_of_row = |row: usize| self.view(index, mid + timing::depth_row_delay(&self.config, row));
            render::rolling_depth(&self.scene, self.size(), view_of_row)
        };
        self.config.depth.measure(&samples, self.camera.width, self.config.seed, index)
    }

    fn render_clean(&self, world_from_camera: &RigidTransform, exposure: f64) -> Vec<u8> {
        let view = View::new(&self.camera, world_from_camera);
        let rays = TURNED_GRID.map(|offset| SubFrame { view, offset });
        let radiance = render::radiance(&self.scene, self.size(), &rays);
        Developer { noise: None, ..self.developer(exposure) }.develop(&radiance, self.camera.width, 0)
    }

    /// Mean light of `count` sub-frames, which are the views at the middle of as many equal parts of the exposure of each
    /// row.
    fn radiance(&self, index: usize, count: usize) -> Vec<Vec3> {
        let (mid, exposure) = (self.timestamp(index), self.exposures[index]);
        let offsets = render::jitter(count);
        let view_at = |delay: f64, k: usize| {
            let [start, end] = [mid + delay - 0.5 * exposure, mid + delay + 0.5 * exposure];
            self.view(index, start + (end - start) * (k as f64 + 0.5) / count as f64)
        };
        if self.config.sensor.readout_seconds == 0.0 {
            let sub_frame = |(k, offset)| SubFrame { view: view_at(0.0, k), offset };
            let sub_frames: Vec<_> = offsets.into_iter().enumerate().map(sub_frame).collect();
            return render::radiance(&self.scene, self.size(), &sub_frames);
        }
        let view_of_row = |row: usize, k: usize| view_at(timing::row_delay(&self.config, row), k);
        render::rolling_radiance(&self.scene, self.size(), &offsets, view_of_row)
    }

    /// So many that neighbouring ones are less than a pixel apart, in the middle and in the rows that are exposed first and
    /// last.
    fn sub_frame_count(&self, index: usize, blur: &BlurFigure) -> usize {
        let path_of_row = |row: usize| {
            let poses = self.exposure_poses(index, timing::row_delay(&self.config, row));
            blur::of_exposure(&self.scene, &self.camera, &poses).longest_path_px
        };
        let mut longest = blur.longest_path_px;
        if self.config.sensor.readout_seconds != 0.0 {
            longest = longest.max(path_of_row(0)).max(path_of_row(self.camera.height - 1));
        }
        MIN_SUB_FRAMES.max((SUB_FRAMES_PER_PIXEL * longest).ceil() as usize)
    }

    /// What the camera sees at `time` of frame `index`.
    fn view(&self, index: usize, time: f64) -> View {
        View::new(&self.camera, &self.path.pose(timing::on_path(&self.config, index, time)))
    }

    /// Poses at opening, middle and closing of the shutter for rows that are exposed `delay` seconds after the middle.
    pub(super) fn exposure_poses(&self, index: usize, delay: f64) -> ExposurePoses {
        timing::exposure_poses(&self.config, &self.path, index, self.exposures[index], delay)
    }

    fn develop(&self, radiance: &[Vec3], index: usize) -> Vec<u8> {
        self.developer(self.exposures[index]).develop(radiance, self.camera.width, index)
    }

    /// The camera with a shutter that is open for `exposure` seconds.
    fn developer(&self, exposure: f64) -> Developer<'_> {
        let SynthConfig { gain, noise, response, seed, sensor, exposure_seconds, .. } = &self.config;
        Developer {
            gain: gain * (exposure / exposure_seconds),
            vignetting: sensor.vignetting,
            noise: *noise,
            response,
            seed: *seed,
        }
    }

    fn size(&self) -> Size {
        Size { width: self.camera.width, height: self.camera.height }
    }
}

/// The way without shake; a round lasts from the first frame to the last, a walk goes on for as long as there are frames.
fn steady(config: &SynthConfig, scene: &Scene) -> Steady {
    match config.motion {
        CameraMotion::Sweep => Steady::Sweep(scene.sweep),
        CameraMotion::Loop => Steady::Round {
            round: scene.round,
            begin: timing::FIRST_TIMESTAMP,
            duration: (config.frames - 1).max(1) as f64 / config.frame_rate,
        },
        CameraMotion::Walk => Steady::Walk(Walk { begin: timing::FIRST_TIMESTAMP }),
    }
}
