//! Short sequences of a shaking camera in a [`PlaneScene`], and tracking them.

use mba_tracker::error::FrameError;
use mba_tracker::geometry::{PinholeCamera, RigidTransform, so3};
use mba_tracker::image::{ColourView, DepthView, PixelFormat};
use mba_tracker::photometric::InverseResponse;
use mba_tracker::trajectory::ExposureTrajectory;
use mba_tracker::{Frame, FrameResult, SimdLevel, Tracker, TrackerConfig};
use nalgebra::Vector3;

use crate::plane_scene::{DEPTH_SCALE, PlaneScene, bytes_of, raw_depth_of};
use crate::transfer_scene::Uniform;

/// Camera with a horizontal field of view of about 60 degrees.
#[must_use]
pub fn camera_of_width(width: usize) -> PinholeCamera {
    let height = width * 3 / 4;
    let f = 0.86 * width as f64;
    let centre = |size: usize| 0.5 * (size as f64 - 1.0);
    PinholeCamera { width, height, fx: f, fy: f, cx: centre(width), cy: centre(height) }
}

/// Tracker defaults for the rendered images.
#[must_use]
pub fn tracker_config(camera: PinholeCamera) -> TrackerConfig {
    TrackerConfig::new(camera, (1.0 / DEPTH_SCALE) as f32, InverseResponse::linear())
}

/// Memory for a tracker of `config`.
#[must_use]
pub fn workspace(config: &TrackerConfig) -> Vec<u8> {
    vec![0; config.workspace_len()]
}

/// A smooth path of the camera that starts at rest at the world's origin at time 0.
#[derive(Clone, Copy, Debug)]
pub struct Shake {
    /// Amplitude in metres.
    pub metres: f64,
    /// Amplitude in radians.
    pub radians: f64,
    /// Cycles per second.
    pub hertz: f64,
}

impl Shake {
    /// `world_from_camera` at time `t` in seconds.
    #[must_use]
    pub fn pose(&self, t: f64) -> RigidTransform {
        let wave = |frequency: f64| 1.0 - (core::f64::consts::TAU * self.hertz * frequency * t).cos();
        let rotation = Vector3::new(-0.5 * wave(1.1), wave(0.9), 0.4 * wave(1.3));
        let translation = Vector3::new(wave(1.0), -0.6 * wave(0.8), 0.7 * wave(0.7));
        RigidTransform::new(so3::exp(&(rotation * self.radians)), translation * self.metres)
    }

    /// The linear exposure around time `t`.
    #[must_use]
    pub fn exposure(&self, t: f64, seconds: f64) -> ExposureTrajectory {
        ExposureTrajectory { start: self.pose(t - 0.5 * seconds), end: self.pose(t + 0.5 * seconds) }
    }
}

/// A rendered frame with its true exposure.
#[derive(Clone, Debug)]
pub struct RenderedFrame {
    /// Mid exposure, seconds.
    pub timestamp: f64,
    /// Seconds.
    pub exposure: f64,
    /// Grey bytes, linear response.
    pub grey: Vec<u8>,
    /// Raw depth.
    pub depth: Vec<u16>,
    /// `world_from_camera` of the truth.
    pub truth: ExposureTrajectory,
    /// Columns and rows.
    pub size: (usize, usize),
}

impl RenderedFrame {
    /// Renders an exposure; the depth is that of its middle.
    #[must_use]
    pub fn new(
        scene: &PlaneScene,
        camera: &PinholeCamera,
        timestamp: f64,
        exposure: f64,
        truth: ExposureTrajectory,
    ) -> Self {
        let sharp = scene.sharp(camera, &truth.mid());
        let views = if truth.start == truth.end { 1 } else { 13 };
        let mut light = scene.blurred(camera, &truth, views);
        add_noise(&mut light, timestamp);
        Self {
            timestamp,
            exposure,
            grey: bytes_of(&light),
            depth: raw_depth_of(&sharp.depth),
            truth,
            size: (camera.width, camera.height),
        }
    }

    /// The frame as the tracker takes it.
    ///
    /// # Panics
    /// If the images do not have the size that they say.
    #[must_use]
    pub fn view(&self) -> Frame<'_> {
        let (width, height) = self.size;
        Frame {
            timestamp: self.timestamp,
            exposure: self.exposure,
            depth_timestamp: self.timestamp,
            colour: ColourView::new(&self.grey, width, height, width, PixelFormat::Grey8)
                .expect("grey image"),
            depth: DepthView::new(&self.depth, width, height, width).expect("depth image"),
            angular_velocity: None,
            gyro: None,
            expected_path: None,
        }
    }

    /// Replaces both images, as a camera fault would.
    #[must_use]
    pub fn replaced(&self, grey: impl Fn(u8) -> u8, depth: impl Fn(usize, u16) -> u16) -> Self {
        Self {
            grey: self.grey.iter().map(|&value| grey(value)).collect(),
            depth: self.depth.iter().enumerate().map(|(k, &value)| depth(k, value)).collect(),
            ..self.clone()
        }
    }
}

/// Noise of a well-lit sensor: uniform with a standard deviation of 1.5 bytes, drawn anew for every frame.
fn add_noise(light: &mut [f32], timestamp: f64) {
    const BOUND: f64 = 1.5 * 1.732 / 255.0;
    let mut draw = Uniform::new(timestamp.to_bits());
    for light in light {
        *light = (*light + draw.within(-BOUND, BOUND) as f32).clamp(0.0, 1.0);
    }
}

/// Frames at 30 Hz with an exposure of 20 ms.
#[must_use]
pub fn sequence(
    scene: &PlaneScene,
    camera: &PinholeCamera,
    shake: &Shake,
    count: usize,
) -> Vec<RenderedFrame> {
    const EXPOSURE: f64 = 0.02;
    (0..count)
        .map(|k| {
            let t = k as f64 / 30.0;
            RenderedFrame::new(scene, camera, t, EXPOSURE, shake.exposure(t, EXPOSURE))
        })
        .collect()
}

/// Tracks frames one after the other.
///
/// # Errors
/// The first frame that the tracker refuses.
pub fn track_all(
    tracker: &mut Tracker<'_>,
    frames: &[RenderedFrame],
) -> Result<Vec<FrameResult>, FrameError> {
    frames.iter().map(|frame| tracker.track(&frame.view())).collect()
}

/// Tracks frames with a new tracker.
///
/// # Panics
/// If the tracker refuses the configuration or a frame.
#[must_use]
pub fn track_anew(config: &TrackerConfig, frames: &[RenderedFrame]) -> Vec<FrameResult> {
    let mut memory = workspace(config);
    let mut tracker = Tracker::new(config, SimdLevel::new(), &mut memory).expect("a valid configuration");
    track_all(&mut tracker, frames).expect("valid frames")
}

/// Position error in metres and rotation error in radians of a result at mid exposure; the true world is that of
/// `origin`'s camera at mid exposure.
#[must_use]
pub fn pose_error(result: &FrameResult, frame: &RenderedFrame, origin: &RenderedFrame) -> (f64, f64) {
    let truth = origin.truth.mid().inverse().compose(&frame.truth.mid());
    let difference = truth.tangent_to(&result.world_from_camera.mid());
    (difference.fixed_rows::<3>(0).norm(), difference.fixed_rows::<3>(3).norm())
}

/// Root mean square position error in metres, without any alignment afterwards.
#[must_use]
pub fn trajectory_error(results: &[FrameResult], frames: &[RenderedFrame]) -> f64 {
    let squares =
        results.iter().zip(frames).map(|(result, frame)| pose_error(result, frame, &frames[0]).0.powi(2));
    (squares.sum::<f64>() / results.len() as f64).sqrt()
}

/// Root mean square distance in pixels between where two cameras see the points that the first one sees 2.2 to 3 m
/// away, over the image.
#[must_use]
pub fn pixels_between(
    camera: &PinholeCamera,
    world_from_a: &RigidTransform,
    world_from_b: &RigidTransform,
) -> f64 {
    let b_from_a = world_from_b.inverse().compose(world_from_a);
    let (mut sum, mut count) = (0.0, 0.0);
    for v in (0..camera.height).step_by(20) {
        for u in (0..camera.width).step_by(20) {
            let (u, v) = (u as f64, v as f64);
            let point = camera.ray(u, v) * (2.2 + 0.8 * u / camera.width as f64);
            let seen = camera.project(&b_from_a.transform_point(&point));
            sum += (seen.x - u).powi(2) + (seen.y - v).powi(2);
            count += 1.0;
        }
    }
    f64::sqrt(sum / count)
}

/// Errors in pixels of the mid pose and of the motion from opening to closing, both poses in the same world.
#[must_use]
pub fn exposure_errors(
    camera: &PinholeCamera,
    found: &ExposureTrajectory,
    truth: &ExposureTrajectory,
) -> (f64, f64) {
    let mid = pixels_between(camera, &truth.mid(), &found.mid());
    // Both motions as seen from their own middle, which need not agree.
    let end = |path: &ExposureTrajectory| path.mid().inverse().compose(&path.end);
    (mid, 2.0 * pixels_between(camera, &end(truth), &end(found)))
}
