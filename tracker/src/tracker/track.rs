//! The tracking loop.

use fearless_simd::Level;
use nalgebra::{Vector3, Vector6};

use super::coarse_to_fine::{Aligned, FrameTask, score};
use super::config::{ReferenceMode, SCALE_SAMPLES, TrackerConfig};
use super::frame::{Frame, GyroReading};
use super::history::Motion;
use super::keyframe_path::PathError;
use super::policy::{Typical, fits_badly, is_blind, wants_keyframe};
use super::recovery::RecentKeyframes;
use super::result::{Doubt, FrameResult, FrameStatus, Revision};
use crate::align::{AlignScratch, Alignment, Estimate, FrameData, LevelOutcome, ReferenceData, blur_length};
use crate::deblur::DeblurScratch;
use crate::error::{ConfigError, FrameError};
use crate::geometry::{PinholeCamera, RigidTransform};
use crate::image::GreyPyramid;
use crate::keyframe::{Keyframe, MAX_KEYPOINTS, RectifyScratch, max_keypoints, typical_inverse_depth};
use crate::photometric::LuminanceTable;
use crate::surface::InverseDepthMap;
use crate::trajectory::{BowedTrajectory, ExposureTrajectory, FrameTiming};
use crate::transfer::BrightnessModel;
use crate::work::Work;
use crate::workspace::Arena;

/// Fewest keypoints on the finest level, and least share of measured depth, to start from.
const MIN_START_KEYPOINTS: usize = 24;
const MIN_START_DEPTH: f32 = 0.1;

/// Share of a frame in the running mean of the gyroscope's bias: it changes over minutes.
const GYRO_BIAS_SHARE: f64 = 0.05;

/// Inverse depth, 1/m, that a first frame can have on average: 5 cm to 100 m.
const START_INVERSE_DEPTH: core::ops::Range<f32> = 0.01..20.0;

/// Frames that may be lost right after a start until the next one starts anew: a start that nothing agrees with was one
/// with damaged depth.
const MAX_LOST_AT_START: usize = 2;

/// Largest time between a colour image and its depth image, seconds.
const MAX_DEPTH_OFFSET: f64 = 0.2;

/// The linear motion during the exposure of the middle row.
pub(super) fn exposure_of(path: &BowedTrajectory, timing: &FrameTiming) -> ExposureTrajectory {
    if timing.reaches_outside() {
        path.between(0.5 - 0.5 * timing.exposure, 0.5 + 0.5 * timing.exposure)
    } else {
        path.linear
    }
}

/// Estimates camera poses at shutter opening and closing, frame by frame.
#[derive(Debug)]
pub struct Tracker<'m> {
    pub(super) simd: Level,
    pub(super) config: TrackerConfig,
    pub(super) luminance: LuminanceTable,
    pub(super) pyramid: GreyPyramid<'m>,
    pub(super) depth: InverseDepthMap<'m>,
    pub(super) depth_share: f32,
    pub(super) keyframe: Keyframe<'m>,
    pub(super) recent: RecentKeyframes<'m>,
    pub(super) scratch: AlignScratch<'m>,
    pub(super) deblur: DeblurScratch<'m>,
    /// Motion during the exposure with which the keyframe was deblurred, or would have been.
    pub(super) deblurred_with: Vector6<f64>,
    pub(super) rectify: RectifyScratch<'m>,
    /// When the parts of the current frame were measured, along a path of `span` seconds.
    pub(super) timing: FrameTiming,
    pub(super) span: f64,
    /// Seconds that the path of the keyframe's frame spans.
    pub(super) keyframe_span: f64,
    /// What the gyroscope said while the keyframe was exposed.
    pub(super) keyframe_gyro: Option<GyroReading>,
    pub(super) gyro: Option<GyroReading>,
    /// What the gyroscope says of a camera at rest, rad/s: the running mean of its difference to the poses.
    pub(super) gyro_bias: Vector3<f64>,
    /// Running number of the last frame that was aligned, and what the next one taught about it.
    pub(super) last_index: usize,
    pub(super) late_revision: Option<Revision>,
    /// Whether any frame was aligned since the start, and how many were lost before.
    pub(super) established: bool,
    pub(super) lost_at_start: usize,
    /// What is known about the error of the keyframe's path.
    pub(super) path_error: PathError,
    /// Motion in the world; `None` before the first usable frame.
    pub(super) motion: Option<Motion>,
    pub(super) brightness: BrightnessModel,
    pub(super) typical: Typical,
    pub(super) last_timestamp: f64,
    pub(super) frames: usize,
    /// What the current frame took so far.
    pub(super) work: Work,
    /// What the first alignment of the current frame took: about what any takes whose motion is as expected.
    pub(super) first_alignment: Work,
    /// Whether something is left to do for a new keyframe, see [`Self::finish_keyframe`].
    pub(super) is_unfinished: bool,
    /// What was done for the next frame between this one and that.
    pub(super) work_ahead: Work,
}

impl<'m> Tracker<'m> {
    /// Builds a tracker that runs on instruction set `simd` in the caller's memory of at least
    /// [`TrackerConfig::workspace_len`] bytes. Nothing is allocated, now or later.
    ///
    /// # Errors
    /// [`ConfigError`] when a setting is outside its range or the memory is too short.
    pub fn new(config: &TrackerConfig, simd: Level, memory: &'m mut [u8]) -> Result<Self, ConfigError> {
        config.validate()?;
        let mut arena = Arena::new(memory);
        let (camera, levels, surface_level) = (&config.camera, config.levels, config.surface_level);
        Ok(Self {
            simd,
            luminance: LuminanceTable::new(&config.response),
            pyramid: GreyPyramid::carve(&mut arena, camera, levels)?,
            depth: InverseDepthMap::carve(&mut arena, camera, surface_level)?,
            depth_share: 0.0,
            keyframe: Keyframe::carve(&mut arena, camera, levels, surface_level)?,
            recent: RecentKeyframes::carve(
                &mut arena,
                camera,
                levels,
                surface_level,
                config.recent_keyframes,
            )?,
            scratch: AlignScratch {
                sites: arena.take(MAX_KEYPOINTS)?,
                costs: arena.take(MAX_KEYPOINTS)?,
                medians: arena.take(SCALE_SAMPLES)?,
            },
            deblur: match config.reference {
                ReferenceMode::Deblurred => DeblurScratch::carve(&mut arena, camera.width, camera.height)?,
                ReferenceMode::Raw => DeblurScratch::carve(&mut arena, 0, 0)?,
            },
            deblurred_with: Vector6::zeros(),
            rectify: RectifyScratch::carve(
                &mut arena,
                camera,
                surface_level,
                config.readout.colour_rolls(),
                config.readout.depth_is_apart(),
            )?,
            timing: FrameTiming::GLOBAL,
            span: 0.0,
            keyframe_span: 0.0,
            keyframe_gyro: None,
            gyro: None,
            gyro_bias: Vector3::zeros(),
            last_index: 0,
            late_revision: None,
            established: false,
            lost_at_start: 0,
            path_error: PathError::without_keyframe(),
            config: config.clone(),
            motion: None,
            brightness: BrightnessModel::default(),
            typical: Typical::default(),
            last_timestamp: f64::NEG_INFINITY,
            frames: 0,
            work: Work::none(),
            first_alignment: Work::none(),
            is_unfinished: false,
            work_ahead: Work::none(),
        })
    }

    /// Tracks one frame.
    ///
    /// # Errors
    /// [`FrameError`] when the frame cannot be used at all; the tracker is then unchanged.
    pub fn track(&mut self, frame: &Frame) -> Result<FrameResult, FrameError> {
        self.check(frame)?;
        self.work = core::mem::replace(&mut self.work_ahead, Work::none());
        self.work.image_pixels += self.pixels();
        self.finish_keyframe();
        self.pyramid.fill(&frame.colour, &self.luminance, &self.config.vignetting);
        self.depth_share = self.depth.fill(self.simd, &frame.depth, self.config.metres_per_unit);
        (self.timing, self.span) = self.config.readout.timing(frame);
        self.gyro = frame.gyro;
        let blind = self.pyramid.levels.last().is_some_and(|coarsest| is_blind(coarsest.pixels));
        let mut result = match self.motion {
            Some(motion) if blind => self.hold(frame, &motion, &self.nothing(&motion), Doubt::Blind),
            None if blind => self.unstarted(frame, Doubt::Blind),
            None => self.start(frame),
            Some(motion) => self.follow(frame, &motion),
        };
        self.last_timestamp = frame.timestamp;
        self.frames += 1;
        result.work = self.work;
        result.iterations = self.work.linearisations as usize;
        Ok(result)
    }

    pub(super) fn pixels(&self) -> u64 {
        (self.config.camera.width * self.config.camera.height) as u64
    }

    /// Forgets everything but the configuration: what follows is that of a new tracker, bit for bit, and so is the session
    /// that [`Self::save`] gives.
    pub fn reset(&mut self) {
        self.keyframe.forget();
        self.recent.clear();
        self.deblur.forget();
        self.rectify.forget();
        self.path_error = PathError::without_keyframe();
        self.keyframe_span = 0.0;
        self.motion = None;
        self.brightness = BrightnessModel::default();
        self.typical = Typical::default();
        self.last_timestamp = f64::NEG_INFINITY;
        self.frames = 0;
        self.last_index = 0;
        self.late_revision = None;
        self.established = false;
        self.lost_at_start = 0;
        self.gyro_bias = Vector3::zeros();
        self.keyframe_gyro = None;
        self.deblurred_with = Vector6::zeros();
        self.is_unfinished = false;
        self.work_ahead = Work::none();
    }

    fn check(&self, frame: &Frame) -> Result<(), FrameError> {
        self.check_size(&[frame.colour.size(), frame.depth.size()])?;
        if !(frame.exposure >= 0.0 && frame.exposure.is_finite()) {
            return Err(FrameError::Exposure { got: frame.exposure });
        }
        if !frame.expected_path.is_none_or(|path| path.is_sound()) {
            return Err(FrameError::ExpectedPath);
        }
        let apart = frame.depth_timestamp - frame.timestamp;
        let belongs = apart.abs() <= MAX_DEPTH_OFFSET;
        if self.config.readout.depth_apart && !belongs {
            return Err(FrameError::DepthTimestamp { frame: frame.timestamp, got: frame.depth_timestamp });
        }
        if !(frame.timestamp.is_finite() && frame.timestamp > self.last_timestamp) {
            return Err(FrameError::Timestamp { previous: self.last_timestamp, got: frame.timestamp });
        }
        Ok(())
    }

    pub(super) fn check_size(&self, sizes: &[(usize, usize)]) -> Result<(), FrameError> {
        let expected = (self.config.camera.width, self.config.camera.height);
        match sizes.iter().find(|&&got| got != expected) {
            Some(&got) => Err(FrameError::Size { expected, got }),
            None => Ok(()),
        }
    }

    /// Makes the first usable frame the keyframe and the origin of the world.
    fn start(&mut self, frame: &Frame) -> FrameResult {
        let origin = RigidTransform::identity();
        let still = ExposureTrajectory::still(origin);
        let nothing = LevelOutcome::unchanged(Estimate::linear(still));
        let mut result = FrameResult::of(self.frames, frame.timestamp, still, &nothing);
        self.promote(&origin, None, f32::MAX);
        let PinholeCamera { width, height, .. } = self.config.camera;
        // Small images have fewer cells than that; a sixth of them must show something.
        let needed = MIN_START_KEYPOINTS.min(max_keypoints(width, height, 0) / 6);
        let enough = self.keyframe.finest_keypoints().len() >= needed;
        let in_range = self.keyframe.depth.mean().is_some_and(|rho| START_INVERSE_DEPTH.contains(&rho));
        result.doubt = Some(Doubt::NoStart);
        if enough && in_range && self.depth_share >= MIN_START_DEPTH {
            self.motion = Some(Motion::still(frame.timestamp, origin));
            self.take_expected_path(frame, &mut result);
            self.established = false;
            self.lost_at_start = 0;
            result.status = FrameStatus::Ok;
            result.doubt = None;
            result.inliers = 1.0;
            result.is_keyframe = true;
        }
        result
    }

    /// The result of a frame that nothing can start from.
    fn unstarted(&self, frame: &Frame, doubt: Doubt) -> FrameResult {
        let still = ExposureTrajectory::still(RigidTransform::identity());
        let nothing = LevelOutcome::unchanged(Estimate::linear(still));
        FrameResult { doubt: Some(doubt), ..FrameResult::of(self.frames, frame.timestamp, still, &nothing) }
    }

    /// An alignment that was not tried.
    fn nothing(&self, motion: &Motion) -> Aligned {
        let still = ExposureTrajectory::still(motion.reference_from_mid);
        Aligned { outcome: LevelOutcome::unchanged(Estimate::linear(still)), work: Work::none() }
    }

    fn follow(&mut self, frame: &Frame, motion: &Motion) -> FrameResult {
        let mut aligned;
        let mut revision = None;
        if self.path_is_modelled() && self.keyframe.keyframe_from_camera.is_none() {
            (aligned, revision) = self.bootstrap(frame, motion);
            self.first_alignment = aligned.work;
        } else {
            aligned = self.align(frame, motion, self.config.align.blur, None);
            self.first_alignment = aligned.work;
            let is_reachable = self.is_reachable(&aligned.outcome, motion, frame);
            if !is_reachable || fits_badly(&aligned.outcome, &self.typical) {
                // As if nothing were known about the motion: all directions are tried.
                let anywhere = Motion { within_exposure: None, ..*motion };
                let other = self.align(frame, &anywhere, self.config.align.blur, None);
                let keypoints = self.keyframe.finest_keypoints().len();
                let fits_better = score(&other.outcome, keypoints) < score(&aligned.outcome, keypoints);
                let other_is_reachable = self.is_reachable(&other.outcome, motion, frame);
                if other_is_reachable && (fits_better || !is_reachable) {
                    aligned = other;
                }
            }
        }
        let (mut status, mut doubt) = self.judge(&aligned.outcome, motion, frame);
        if status == FrameStatus::Lost && self.recover(frame, motion) {
            let start = self.motion.unwrap_or(*motion);
            aligned = self.align(frame, &start, self.config.align.blur, None);
            if self.judge(&aligned.outcome, &start, frame).0 == FrameStatus::Lost {
                return self.resume(frame, &start.reference_from_mid);
            }
            (status, doubt) = (FrameStatus::Weak, Some(Doubt::FoundAgain));
        }
        if status == FrameStatus::Lost {
            return self.lose(frame, motion, &aligned, doubt.unwrap_or(Doubt::NoMatch));
        }
        self.established = true;
        let mut result = self.accept(frame, motion, &aligned, status);
        result.doubt = doubt;
        result.revision = revision.or(self.late_revision.take());
        result
    }

    /// Holds the last good pose; when the very first frames after a start all disagree with it, starts anew.
    fn lose(&mut self, frame: &Frame, motion: &Motion, aligned: &Aligned, doubt: Doubt) -> FrameResult {
        self.lost_at_start += 1;
        if !self.established && self.lost_at_start >= MAX_LOST_AT_START {
            return self.start(frame);
        }
        self.hold(frame, motion, aligned, doubt)
    }

    /// Goes on from a view that was found again near an older keyframe, out of sight of the current one: the frame
    /// becomes the keyframe, and like that of the very first one its motion is learnt from the next frame.
    fn resume(&mut self, frame: &Frame, world_from_mid: &RigidTransform) -> FrameResult {
        let still = ExposureTrajectory::still(*world_from_mid);
        let nothing = LevelOutcome::unchanged(Estimate::linear(still));
        let mut result = FrameResult::of(self.frames, frame.timestamp, still, &nothing);
        self.keep_keyframe();
        self.promote(world_from_mid, None, f32::MAX);
        self.motion = Some(Motion::still(frame.timestamp, *world_from_mid));
        self.take_expected_path(frame, &mut result);
        result.status = FrameStatus::Weak;
        result.doubt = Some(Doubt::FoundAgain);
        result.is_keyframe = true;
        result
    }

    /// Whether the motion of a frame around its middle matters: it blurs the frame, or its parts have different times.
    pub(super) fn path_is_modelled(&self) -> bool {
        (self.config.align.blur && self.timing.exposure * self.span > 0.0) || self.timing.reaches_outside()
    }

    /// Aligns the current frame with the keyframe; from `start` alone if it is given.
    pub(super) fn align(
        &mut self,
        frame: &Frame,
        world_motion: &Motion,
        blur: bool,
        start: Option<RigidTransform>,
    ) -> Aligned {
        let keypoints = self.keyframe.keypoints();
        let reference = ReferenceData {
            levels: &self.keyframe.pyramid.levels,
            keypoints: &keypoints,
            depth: &self.keyframe.depth,
            planes: &self.keyframe.planes,
        };
        let frame_data = FrameData {
            levels: &self.pyramid.levels,
            depth: &self.depth,
            depth_level: self.config.surface_level,
            region: self.config.region,
            timing: self.timing,
        };
        let task = FrameTask {
            alignment: Alignment {
                simd: self.simd,
                camera: self.config.camera,
                reference,
                frame: frame_data,
                expected_brightness: self.brightness,
                settings: &self.config.align,
            },
            motion: world_motion.seen_from(&self.keyframe.world_from_keyframe.inverse()),
            timestamp: frame.timestamp,
            span: self.span,
            gyro: frame.angular_velocity.map(|rate| rate - self.gyro_bias),
            turning: frame
                .gyro
                .map(|gyro| GyroReading { angular_velocity: gyro.angular_velocity - self.gyro_bias, ..gyro }),
            expected_path: frame.expected_path,
            brightness: self.brightness,
            blur,
            inverse_depth: typical_inverse_depth(self.keyframe.finest_keypoints()),
        };
        let aligned = match start {
            Some(mid) => task.run(&[mid], &mut self.scratch),
            None => task.run(&task.guesses(), &mut self.scratch),
        };
        self.work += aligned.work;
        aligned
    }

    /// Takes an alignment as the frame's poses.
    fn accept(
        &mut self,
        frame: &Frame,
        motion: &Motion,
        aligned: &Aligned,
        status: FrameStatus,
    ) -> FrameResult {
        let outcome = &aligned.outcome;
        let evidence = self.evidence(outcome, motion, frame);
        let world_path = outcome.estimate.path().seen_from(&self.keyframe.world_from_keyframe);
        let world_from_mid = world_path.linear.mid();
        let world_from_camera = exposure_of(&world_path, &self.timing);
        let mut result = FrameResult::of(self.frames, frame.timestamp, world_from_camera, outcome);
        result.world_from_mid = world_from_mid;
        result.status = status;
        result.blur = evidence.blur;
        result.inliers = evidence.inliers;
        result.reference_index = self.keyframe.frame_index;
        self.motion = Some(Motion {
            timestamp: frame.timestamp,
            reference_from_mid: world_from_mid,
            between_frames: motion.reference_from_mid.tangent_to(&world_from_mid)
                / (frame.timestamp - motion.timestamp),
            interval: frame.timestamp - motion.timestamp,
            exposure: frame.exposure,
            within_exposure: self.path_is_modelled().then(|| world_path.linear.motion() / self.span),
            acceleration: world_path.bow * (2.0 / (self.span * self.span).max(f64::MIN_POSITIVE)),
        });
        self.brightness = outcome.estimate.brightness;
        self.late_revision = self.revise_last(frame, motion, &world_from_mid);
        self.last_index = self.frames;
        if let Some(rate) = frame.angular_velocity
            && status == FrameStatus::Ok
        {
            let seen =
                motion.reference_from_mid.tangent_to(&world_from_mid) / (frame.timestamp - motion.timestamp);
            let difference = rate - Vector3::from(seen.fixed_rows::<3>(3));
            self.gyro_bias += (difference - self.gyro_bias) * GYRO_BIAS_SHARE;
        }
        let correction = self.observe_path_error(frame, motion, &world_from_mid);
        if status == FrameStatus::Ok {
            self.typical.learn(outcome);
        }
        let wanted =
            wants_keyframe(&evidence, self.keyframe.blur, self.config.camera.width, self.timing.is_rolling());
        if status == FrameStatus::Ok && wanted {
            self.keep_keyframe();
            let path = world_path.seen_from(&world_from_mid.inverse());
            self.promote(&world_from_mid, Some(path), evidence.blur);
            result.is_keyframe = true;
        } else if let Some(correction) = correction {
            self.correct_keyframe_path(&correction);
        } else if status == FrameStatus::Ok {
            let camera = self.config.camera.at_level(self.config.surface_level);
            self.keyframe.fuse_depth(self.simd, &self.depth, &outcome.estimate.path(), &self.timing, &camera);
        }
        result
    }

    /// Holds the last good pose.
    fn hold(&mut self, frame: &Frame, motion: &Motion, aligned: &Aligned, doubt: Doubt) -> FrameResult {
        let held = Motion { between_frames: motion.between_frames * 0.5, within_exposure: None, ..*motion };
        self.motion = Some(held);
        let world_from_camera = ExposureTrajectory::still(motion.reference_from_mid);
        let mut result = FrameResult::of(self.frames, frame.timestamp, world_from_camera, &aligned.outcome);
        result.doubt = Some(doubt);
        result.reference_index = self.keyframe.frame_index;
        result
    }

    pub(super) fn blur_length(&self, keyframe_from_camera: &ExposureTrajectory) -> f32 {
        blur_length(keyframe_from_camera, self.keyframe.finest_keypoints(), &self.config.camera)
    }
}
