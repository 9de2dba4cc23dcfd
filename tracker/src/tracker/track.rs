//! The tracking loop.

use core::mem;

use arrayvec::ArrayVec;
use fearless_simd::Level;
use nalgebra::Vector6;

use super::config::{ReferenceMode, SCALE_SAMPLES, TrackerConfig};
use super::frame::Frame;
use super::history::Motion;
use super::result::{FrameResult, FrameStatus};
use crate::align::{
    AlignScratch, Alignment, Estimate, FrameData, LevelOutcome, MotionPrior, ReferenceData, StopReason,
    align_level, blur_length,
};
use crate::deblur::DeblurScratch;
use crate::error::{ConfigError, FrameError};
use crate::geometry::RigidTransform;
use crate::image::GreyPyramid;
use crate::keyframe::{Keyframe, MAX_KEYPOINTS};
use crate::photometric::LuminanceTable;
use crate::surface::InverseDepthMap;
use crate::trajectory::ExposureTrajectory;
use crate::transfer::BrightnessModel;
use crate::workspace::Arena;

/// Estimates camera poses at shutter opening and closing, frame by frame.
#[derive(Debug)]
pub struct Tracker<'m> {
    simd: Level,
    config: TrackerConfig,
    luminance: LuminanceTable,
    pyramid: GreyPyramid<'m>,
    depth: InverseDepthMap<'m>,
    keyframe: Keyframe<'m>,
    scratch: AlignScratch<'m>,
    deblur: DeblurScratch<'m>,
    motion: Option<Motion>,
    brightness: BrightnessModel,
    frames: usize,
}

impl<'m> Tracker<'m> {
    /// Builds a tracker that runs on instruction set `simd` in the caller's memory of at least [`super::workspace_len`] bytes.
    ///
    /// # Errors
    /// [`ConfigError`] when a setting is outside its range or the memory is too short.
    pub fn new(config: &TrackerConfig, simd: Level, memory: &'m mut [u8]) -> Result<Self, ConfigError> {
        config.validate()?;
        let mut arena = Arena::new(memory);
        Ok(Self {
            simd,
            luminance: LuminanceTable::new(&config.response),
            pyramid: GreyPyramid::carve(&mut arena, &config.camera, config.levels)?,
            depth: InverseDepthMap::carve(&mut arena, &config.camera, config.surface_level)?,
            keyframe: Keyframe::carve(&mut arena, &config.camera, config.levels, config.surface_level)?,
            scratch: AlignScratch {
                sites: arena.take(MAX_KEYPOINTS)?,
                costs: arena.take(MAX_KEYPOINTS)?,
                medians: arena.take(SCALE_SAMPLES)?,
            },
            deblur: DeblurScratch::carve(&mut arena, config.camera.width, config.camera.height)?,
            config: config.clone(),
            motion: None,
            brightness: BrightnessModel::default(),
            frames: 0,
        })
    }

    /// Tracks one frame.
    ///
    /// # Errors
    /// [`FrameError`] when the frame cannot be used at all; the tracker is then unchanged.
    pub fn track(&mut self, frame: &Frame) -> Result<FrameResult, FrameError> {
        self.check(frame)?;
        self.pyramid.fill(&frame.colour, &self.luminance);
        self.depth.fill(&frame.depth, self.config.metres_per_unit);
        let result = match self.motion {
            None => self.start(frame),
            Some(motion) => self.follow(frame, &motion),
        };
        self.frames += 1;
        Ok(result)
    }

    fn check(&self, frame: &Frame) -> Result<(), FrameError> {
        let expected = (self.config.camera.width, self.config.camera.height);
        for got in [frame.colour.size(), frame.depth.size()] {
            if got != expected {
                return Err(FrameError::Size { expected, got });
            }
        }
        if !(frame.exposure >= 0.0 && frame.exposure.is_finite()) {
            return Err(FrameError::Exposure { got: frame.exposure });
        }
        let previous = self.motion.map_or(f64::NEG_INFINITY, |motion| motion.timestamp);
        if !(frame.timestamp.is_finite() && frame.timestamp > previous) {
            return Err(FrameError::Timestamp { previous, got: frame.timestamp });
        }
        Ok(())
    }

    fn start(&mut self, frame: &Frame) -> FrameResult {
        let world_from_camera = ExposureTrajectory::still(RigidTransform::identity());
        self.motion = Some(Motion {
            timestamp: frame.timestamp,
            exposure: frame.exposure,
            world_from_camera,
            world_from_mid: RigidTransform::identity(),
            between_frames: Vector6::zeros(),
            within_exposure: None,
        });
        self.promote(&RigidTransform::identity(), None, f32::MAX);
        FrameResult {
            index: self.frames,
            timestamp: frame.timestamp,
            status: FrameStatus::Ok,
            world_from_camera,
            information: nalgebra::SMatrix::zeros(),
            brightness: self.brightness,
            blur: 0.0,
            virtual_views: 1,
            iterations: 0,
            residual: 0.0,
            inliers: 1.0,
            depth_residual: 0.0,
            stop: StopReason::SmallStep,
            is_keyframe: true,
            reference_index: self.frames,
        }
    }

    fn follow(&mut self, frame: &Frame, motion: &Motion) -> FrameResult {
        let dt = frame.timestamp - motion.timestamp;
        let keyframe_from_world = self.keyframe.world_from_keyframe.inverse();
        let local = Motion {
            world_from_camera: motion.world_from_camera.seen_from(&keyframe_from_world),
            world_from_mid: keyframe_from_world.compose(&motion.world_from_mid),
            between_frames: rotate_translation(&keyframe_from_world, &motion.between_frames),
            within_exposure: motion.within_exposure.map(|w| rotate_translation(&keyframe_from_world, &w)),
            ..*motion
        };
        let (outcome, iterations) = self.align(frame, &local, dt);
        self.conclude(frame, motion, &local, dt, outcome, iterations)
    }

    /// Aligns the current frame with the keyframe, coarse to fine.
    fn align(&mut self, frame: &Frame, local: &Motion, dt: f64) -> (LevelOutcome, usize) {
        let config = &self.config;
        let keypoints = self.keyframe.keypoints();
        let reference = ReferenceData {
            pyramid: &self.keyframe.pyramid,
            keypoints: &keypoints,
            depth: &self.keyframe.depth,
            planes: &self.keyframe.planes,
        };
        let data = FrameData { pyramid: &self.pyramid, depth: &self.depth };
        let inverse_depth = typical_inverse_depth(&self.keyframe);
        let alignment = Alignment {
            simd: self.simd,
            camera: config.camera,
            reference,
            frame: data,
            expected_brightness: BrightnessModel::default(),
            settings: &config.align,
        };
        let coarsest = config.levels - 1;
        let mut iterations = 0;
        let mut best: Option<LevelOutcome> = None;
        let mut best_score = f64::MAX;
        for mid in candidates(local, frame, dt, config.hypotheses) {
            let prior = local.expected_motion(&mid, dt, frame.exposure, &config.camera, inverse_depth);
            let mut estimate = Estimate {
                keyframe_from_camera: ExposureTrajectory::from_mid_and_motion(&mid, &prior.expected),
                brightness: self.brightness,
            };
            let mut outcome = None;
            for level in [coarsest, coarsest - 1] {
                let mid = estimate.keyframe_from_camera.mid();
                let prior = local.expected_motion(&mid, dt, frame.exposure, &config.camera, inverse_depth);
                estimate.keyframe_from_camera =
                    ExposureTrajectory::from_mid_and_motion(&mid, &prior.expected);
                let result = align_level(&alignment, level, estimate, &prior, 4, &mut self.scratch);
                iterations += result.iterations;
                estimate = result.estimate;
                outcome = Some(result);
            }
            if let Some(outcome) = outcome {
                let score = hypothesis_score(&outcome);
                if score < best_score {
                    best_score = score;
                    best = Some(outcome);
                }
            }
        }
        let mut outcome = best.unwrap_or_else(|| unreachable_outcome(local));
        for level in (0..coarsest - 1).rev() {
            let mid = outcome.estimate.keyframe_from_camera.mid();
            let prior = local.expected_motion(&mid, dt, frame.exposure, &config.camera, inverse_depth);
            let estimate = oriented(outcome.estimate, &prior);
            outcome = align_level(&alignment, level, estimate, &prior, 2, &mut self.scratch);
            iterations += outcome.iterations;
        }
        (outcome, iterations)
    }

    fn conclude(
        &mut self,
        frame: &Frame,
        motion: &Motion,
        local: &Motion,
        dt: f64,
        outcome: LevelOutcome,
        iterations: usize,
    ) -> FrameResult {
        let inverse_depth = typical_inverse_depth(&self.keyframe);
        let mid = outcome.estimate.keyframe_from_camera.mid();
        let prior = local.expected_motion(&mid, dt, frame.exposure, &self.config.camera, inverse_depth);
        let estimate = oriented(outcome.estimate, &prior);
        let blur =
            blur_length(&estimate.keyframe_from_camera, self.keyframe.keypoints()[0], &self.config.camera);
        let total = self.keyframe.keypoints()[0].len().max(1) as f32;
        let world_from_camera = estimate.keyframe_from_camera.seen_from(&self.keyframe.world_from_keyframe);
        let world_from_mid = world_from_camera.mid();
        let in_view = outcome.patches_in_view as f32 / total;
        let inliers = outcome.patches as f32 / total;
        let flow = flow_length(&self.keyframe, &mid, &self.config);
        let reference_index = self.keyframe.frame_index;
        self.motion = Some(Motion {
            timestamp: frame.timestamp,
            exposure: frame.exposure,
            world_from_camera,
            world_from_mid,
            between_frames: motion.world_from_mid.tangent_to(&world_from_mid) / dt,
            within_exposure: (frame.exposure > 0.0).then(|| world_from_camera.motion() / frame.exposure),
        });
        self.brightness = estimate.brightness;
        let far = in_view < 0.6 || flow > 0.2 * self.config.camera.width as f32;
        let sharper = blur + 1.0 < 0.6 * self.keyframe.blur;
        let is_keyframe = far || sharper;
        if is_keyframe {
            self.promote(&world_from_mid, Some(world_from_camera.seen_from(&world_from_mid.inverse())), blur);
            self.brightness = BrightnessModel::default();
        }
        FrameResult {
            index: self.frames,
            timestamp: frame.timestamp,
            status: FrameStatus::Ok,
            world_from_camera,
            information: outcome.information,
            brightness: estimate.brightness,
            blur,
            virtual_views: outcome.views,
            iterations,
            residual: outcome.photometric_scale,
            inliers,
            depth_residual: outcome.depth_scale,
            stop: outcome.stop,
            is_keyframe,
            reference_index,
        }
    }

    /// Makes the current frame the keyframe.
    fn promote(
        &mut self,
        world_from_keyframe: &RigidTransform,
        keyframe_from_camera: Option<ExposureTrajectory>,
        blur: f32,
    ) {
        mem::swap(&mut self.pyramid, &mut self.keyframe.pyramid);
        mem::swap(&mut self.depth, &mut self.keyframe.depth);
        self.keyframe.world_from_keyframe = *world_from_keyframe;
        self.keyframe.keyframe_from_camera = keyframe_from_camera;
        self.keyframe.blur = blur;
        self.keyframe.frame_index = self.frames;
        self.keyframe.prepare(MIN_STRENGTH, self.config.align.dark_intensity);
        if self.config.reference == ReferenceMode::Deblurred && blur > 1.0 {
            self.sharpen_keyframe();
        }
    }

    fn sharpen_keyframe(&mut self) {
        let Some(exposure) = self.keyframe.keyframe_from_camera else { return };
        let keyframe = &mut self.keyframe;
        let typical = typical_inverse_depth(keyframe) as f32;
        let longest = self.deblur.flow.fill(
            &exposure,
            &self.config.camera,
            &keyframe.planes,
            self.config.surface_level,
            typical,
        );
        let sharp = &mut keyframe.pyramid.levels[0];
        keyframe.captured.copy_from_slice(sharp.pixels);
        self.deblur.deblur(
            self.simd,
            longest,
            self.config.deblur_iterations,
            keyframe.captured,
            sharp.pixels,
        );
        keyframe.pyramid.reduce();
        keyframe.select(MIN_STRENGTH, self.config.align.dark_intensity);
        if let Some(sink) = self.config.debug {
            sink(keyframe.frame_index, keyframe.captured, keyframe.pyramid.levels[0].pixels);
        }
    }
}

/// Least whitened gradient of a keypoint: about twice the noise of a well-lit sensor.
const MIN_STRENGTH: f32 = 0.02;

fn rotate_translation(a_from_b: &RigidTransform, rate: &Vector6<f64>) -> Vector6<f64> {
    let mut rotated = *rate;
    let translation = a_from_b.rotation * rate.fixed_rows::<3>(0).into_owned();
    rotated.fixed_rows_mut::<3>(0).copy_from(&translation);
    rotated
}

/// First guesses of the mid pose, most likely first.
fn candidates(local: &Motion, frame: &Frame, dt: f64, several: bool) -> ArrayVec<RigidTransform, 6> {
    let mut list = ArrayVec::new();
    if let Some(gyro) = frame.angular_velocity {
        list.push(local.extrapolate_with_gyro(&local.between_frames, &gyro, dt));
    }
    list.push(local.extrapolate(&local.between_frames, dt));
    if several {
        if let Some(rate) = local.within_exposure {
            list.push(local.extrapolate(&rate, dt));
        }
        list.push(local.world_from_mid);
        list.push(local.extrapolate(&-local.between_frames, dt));
    }
    list
}

fn hypothesis_score(outcome: &LevelOutcome) -> f64 {
    let lost = 1.0 - outcome.patches as f64 / outcome.patches_in_view.max(1) as f64;
    f64::from(outcome.photometric_scale) * (1.0 + lost) * (1.0 + 100.0 * f64::from(outcome.depth_scale))
}

fn oriented(estimate: Estimate, prior: &MotionPrior) -> Estimate {
    let whitened = prior.information.component_mul(&prior.expected);
    if estimate.keyframe_from_camera.motion().dot(&whitened) < 0.0 {
        Estimate { keyframe_from_camera: estimate.keyframe_from_camera.reversed(), ..estimate }
    } else {
        estimate
    }
}

fn typical_inverse_depth(keyframe: &Keyframe) -> f64 {
    let keypoints = keyframe.keypoints();
    keypoints[0].get(keypoints[0].len() / 2).map_or(0.5, |keypoint| f64::from(keypoint.inverse_depth))
}

fn flow_length(keyframe: &Keyframe, keyframe_from_mid: &RigidTransform, config: &TrackerConfig) -> f32 {
    let path = ExposureTrajectory { start: RigidTransform::identity(), end: *keyframe_from_mid };
    blur_length(&path, keyframe.keypoints()[0], &config.camera)
}

fn unreachable_outcome(local: &Motion) -> LevelOutcome {
    LevelOutcome {
        estimate: Estimate {
            keyframe_from_camera: local.world_from_camera,
            brightness: BrightnessModel::default(),
        },
        stop: StopReason::NoData,
        iterations: 0,
        views: 1,
        photometric_scale: 0.0,
        depth_scale: 0.0,
        patches: 0,
        patches_in_view: 0,
        depth_points: 0,
        information: nalgebra::SMatrix::zeros(),
        cost: 0.0,
    }
}
