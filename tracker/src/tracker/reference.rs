//! Making and mending the reference: frames become keyframes, with one time for all rows and without their blur.

use core::mem;

use super::config::ReferenceMode;
use super::frame::Frame;
use super::history::{Motion, rotated};
use super::keyframe_path::{PathError, PathRate};
use super::track::{Tracker, exposure_of};
use crate::deblur::DeblurScratch;
use crate::geometry::RigidTransform;
use crate::keyframe::typical_inverse_depth;
use crate::trajectory::{BowedTrajectory, ExposureTrajectory};
use crate::transfer::BrightnessModel;
use crate::work::Work;

/// Least whitened gradient of a keypoint: about twice the noise of a well-lit sensor.
const MIN_STRENGTH: f32 = 0.02;

/// Blur in pixels from which a keyframe is deblurred, and up to which it is worth the try.
const DEBLUR_RANGE: core::ops::Range<f32> = 1.0..40.0;

/// Blur in pixels by which a keyframe's motion has to change for it to be deblurred anew.
const DEBLUR_CHANGE: f32 = 0.8;

/// Standard deviation of a keyframe's velocity and of one between mid poses, as a shear in pixels over the path of a frame.
const KEYFRAME_SHEAR: f64 = 2.0;
const MID_POSE_SHEAR: f64 = 0.3;

/// What is done to a keyframe whose path is known.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Sharpness {
    /// It is given one time and deblurred, where either is worth it.
    Deblurred,
    /// It is only given one time: for paths that are soon replaced by better ones.
    AsCaptured,
}

impl<'m> Tracker<'m> {
    /// Makes the current frame the keyframe.
    pub(super) fn promote(
        &mut self,
        world_from_keyframe: &RigidTransform,
        keyframe_from_camera: Option<BowedTrajectory>,
        blur: f32,
    ) {
        mem::swap(&mut self.pyramid, &mut self.keyframe.pyramid);
        mem::swap(&mut self.depth, &mut self.keyframe.depth);
        self.keyframe.world_from_keyframe = *world_from_keyframe;
        self.keyframe.keyframe_from_camera = keyframe_from_camera;
        self.keyframe.timing = self.timing;
        self.keyframe_span = self.span;
        self.keyframe_gyro = self.gyro;
        self.path_error = PathError::unknown(&self.path_sigma(KEYFRAME_SHEAR, self.span));
        self.keyframe.blur = blur;
        self.keyframe.frame_index = self.frames;
        self.rectify.capture(self.keyframe.pyramid.levels[0].pixels, self.keyframe.depth.values);
        self.deblur.capture(self.keyframe.pyramid.levels[0].pixels);
        self.keyframe.restart_surface(self.simd);
        self.brightness = BrightnessModel::default();
        self.is_unfinished = keyframe_from_camera.is_some();
        if !self.is_unfinished {
            return self.select_keypoints();
        }
        self.begin_sharpening(Sharpness::Deblurred);
        let blurs = self.blurs_of_this_frame();
        self.deblur_by(blurs);
    }

    /// How many of a new keyframe's blurs this frame does, so that it and the next one, which needs the keyframe, take about
    /// as much work.
    fn blurs_of_this_frame(&self) -> usize {
        let (left, taps) = self.deblur.left();
        let units_of_blur = Work { blur_taps: taps, ..Work::none() }.units().max(1);
        // The next frame makes keypoints too, and is aligned as this one was at first.
        let whole_image = Work { image_pixels: self.pixels(), ..Work::none() }.units();
        let of_next = self.first_alignment.units() + 2 * whole_image;
        let both = self.work.units() + of_next + left as u64 * units_of_blur;
        let blurs = (both / 2).saturating_sub(self.work.units()) / units_of_blur;
        left.min(usize::try_from(blurs).unwrap_or(usize::MAX))
    }

    /// Does what is left to do for a new keyframe. Until then nothing may be compared with it.
    pub(super) fn finish_keyframe(&mut self) {
        if mem::take(&mut self.is_unfinished) {
            self.finish_sharpening();
            self.select_keypoints();
        }
    }

    /// The same between frames: the next one counts it as its own work.
    pub(super) fn finish_keyframe_ahead(&mut self) {
        self.work = self.work_ahead;
        self.finish_keyframe();
        self.work_ahead = self.work;
    }

    pub(super) fn set_keyframe_path(&mut self, path: BowedTrajectory, sharpness: Sharpness) {
        self.keyframe.keyframe_from_camera = Some(path);
        self.keyframe.blur = self.blur_length(&exposure_of(&path, &self.keyframe.timing));
        self.sharpen_keyframe(sharpness);
    }

    /// Deblurs the keyframe as it was captured, gives it one time, with its own motion, and selects its keypoints, if there is
    /// anything to do.
    fn sharpen_keyframe(&mut self, sharpness: Sharpness) {
        self.begin_sharpening(sharpness);
        if self.finish_sharpening() {
            self.select_keypoints();
        }
    }

    /// Finds out how the keyframe is blurred, and whether it is worth deblurring.
    fn begin_sharpening(&mut self, sharpness: Sharpness) {
        let path = self.keyframe.keyframe_from_camera;
        if let Some(path) = path.filter(|_| sharpness == Sharpness::Deblurred) {
            self.begin_deblurring(&path);
        }
    }

    /// Deblurs the keyframe as far as it is not yet, and gives it one time; `false` if that changed nothing.
    fn finish_sharpening(&mut self) -> bool {
        self.work.image_pixels += self.pixels();
        let Some(path) = self.keyframe.keyframe_from_camera else { return false };
        let timing = self.keyframe.timing;
        let deblurred = self.finish_deblurring();
        if timing.reaches_outside() {
            let keyframe = &mut self.keyframe;
            self.rectify.rectify(
                self.simd,
                &path,
                &timing,
                &self.config.camera,
                keyframe.pyramid.levels[0].pixels,
                &mut keyframe.depth,
            );
            keyframe.restart_surface(self.simd);
        } else if !deblurred {
            return false;
        }
        self.keyframe.pyramid.reduce();
        true
    }

    /// Begins to deblur the keyframe as it was captured with its path, if it is worth it; otherwise its picture is that which
    /// was captured. Its surface may have been moved to the middle of the path already: over a frame that changes the blur by
    /// a share of itself.
    fn begin_deblurring(&mut self, path: &BowedTrajectory) {
        let timing = self.keyframe.timing;
        self.deblurred_with = exposure_of(path, &timing).motion();
        let worth =
            self.config.reference == ReferenceMode::Deblurred && DEBLUR_RANGE.contains(&self.keyframe.blur);
        let Some(typical) = self.keyframe.depth.mean().filter(|_| worth) else {
            let (deblur, sharp) = self.deblurring();
            return deblur.restore(sharp);
        };
        let longest = self.deblur.flow.fill(
            path,
            &timing,
            &self.config.camera,
            &self.keyframe.planes,
            self.config.surface_level,
            typical,
        );
        let iterations = self.config.deblur_iterations;
        let (deblur, sharp) = self.deblurring();
        deblur.begin(longest, iterations, sharp);
    }

    /// Goes on by as many blurs of the whole image.
    fn deblur_by(&mut self, blurs: usize) {
        let simd = self.simd;
        let (deblur, sharp) = self.deblurring();
        let taps = deblur.advance(simd, blurs, sharp);
        self.work.blur_taps += taps;
    }

    /// Ends the deblurring that was begun; `false` if none was.
    fn finish_deblurring(&mut self) -> bool {
        self.deblur_by(usize::MAX);
        let (deblur, sharp) = self.deblurring();
        deblur.conclude(sharp).is_some()
    }

    /// What deblurs, and the picture that it works on: where rows were exposed one after the other, that which is given one
    /// time afterwards. Blur lies along the motion of each row, and another path shears the same sharp picture.
    fn deblurring(&mut self) -> (&mut DeblurScratch<'m>, &mut [f32]) {
        let sharp = if self.keyframe.timing.is_rolling() {
            self.rectify.image()
        } else {
            &mut *self.keyframe.pyramid.levels[0].pixels
        };
        (&mut self.deblur, sharp)
    }

    /// Compares the velocity of the last frame's path, if rows tell it, with that of the mid poses around it; returns a
    /// correction of the keyframe's velocity, per second in the keyframe, when it is time for one.
    pub(super) fn observe_path_error(
        &mut self,
        frame: &Frame,
        motion: &Motion,
        world_from_mid: &RigidTransform,
    ) -> Option<PathRate> {
        let path_rate = motion.within_exposure.filter(|_| self.keyframe.timing.is_rolling())?;
        let dt = frame.timestamp - motion.timestamp;
        let next = motion.reference_from_mid.tangent_to(world_from_mid) / dt;
        if !motion.interval.is_finite() {
            return None;
        }
        let slope = (next * motion.interval + motion.between_frames * dt) / (dt + motion.interval);
        let bend = next - motion.between_frames;
        let between = 0.5 * (dt + motion.interval);
        let mut sigma = self.path_sigma(MID_POSE_SHEAR, self.span);
        for i in 0..12 {
            let bend = bend.fixed_rows::<3>(i / 3 % 2 * 3).norm();
            sigma[i] += if i < 6 { 0.3 * bend } else { 0.3 * bend / between };
        }
        let keyframe_from_world = self.keyframe.world_from_keyframe.inverse();
        let mut difference = PathRate::zeros();
        let velocity = rotated(&keyframe_from_world, &(path_rate - slope));
        let acceleration = rotated(&keyframe_from_world, &(motion.acceleration - bend / between));
        difference.fixed_rows_mut::<6>(0).copy_from(&velocity);
        difference.fixed_rows_mut::<6>(6).copy_from(&acceleration);
        self.path_error.observe(&difference, &sigma)
    }

    /// Standard deviations of a velocity that moves the picture by `pixels` within `span` seconds, and of an acceleration
    /// that moves it by as much at both ends of them.
    pub(super) fn path_sigma(&self, pixels: f64, span: f64) -> PathRate {
        let span = span.max(1e-6);
        let angle = pixels / self.config.camera.fx / span;
        let shift = angle / typical_inverse_depth(self.keyframe.finest_keypoints()).max(0.02);
        PathRate::from_fn(|i, _| {
            let of_velocity = if i / 3 % 2 == 0 { shift } else { angle };
            if i < 6 { of_velocity } else { of_velocity * 8.0 / span }
        })
    }

    /// Changes the keyframe's velocity by `correction` and shears picture and depth anew.
    pub(super) fn correct_keyframe_path(&mut self, correction: &PathRate) {
        let Some(old) = self.keyframe.keyframe_from_camera else { return };
        let span = self.keyframe_span;
        let motion = old.linear.motion() + correction.fixed_rows::<6>(0) * span;
        let bow = old.bow + correction.fixed_rows::<6>(6) * (0.5 * span * span);
        let mid = RigidTransform::identity();
        let linear = ExposureTrajectory::from_mid_and_motion(&mid, &motion);
        let path = BowedTrajectory { linear, bow, jerk: old.jerk };
        let depth_time = 0.5 + self.keyframe.timing.depth_time;
        let moved = path.at(depth_time).compose(&old.at(depth_time).inverse());
        self.keyframe.keyframe_from_camera = Some(path);
        self.keyframe.blur = self.blur_length(&exposure_of(&path, &self.keyframe.timing));
        self.rectify.move_depth(self.simd, &moved, &self.config.camera, &mut self.keyframe.depth);
        self.keyframe.refit_surface(self.simd);
        let change = exposure_of(&path, &self.keyframe.timing).motion() - self.deblurred_with;
        if self.blur_length(&ExposureTrajectory::from_mid_and_motion(&mid, &change)) > DEBLUR_CHANGE {
            self.begin_deblurring(&path);
            self.finish_deblurring();
        }
        self.rectify.rectify_image(
            self.simd,
            &path,
            &self.keyframe.timing,
            &self.config.camera,
            self.keyframe.pyramid.levels[0].pixels,
            &self.keyframe.depth,
        );
        self.keyframe.pyramid.reduce();
        self.select_keypoints();
    }

    pub(super) fn select_keypoints(&mut self) {
        self.keyframe.select(self.simd, MIN_STRENGTH, self.config.align.dark_intensity, self.config.region);
    }

    /// Remembers the coarse part of the keyframe for recovery before it is replaced.
    pub(super) fn keep_keyframe(&mut self) {
        self.recent.remember(&self.keyframe, self.config.surface_level);
    }
}
