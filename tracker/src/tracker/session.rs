//! Saving what a tracker knows, and going on from it.

use nalgebra::Vector3;

use super::frame::GyroReading;
use super::history::Motion;
use super::policy::Typical;
use super::result::Revision;
use super::track::Tracker;
use crate::geometry::RigidTransform;
use crate::session::{SessionError, Walk};
use crate::trajectory::ExposureTrajectory;
use crate::transfer::BrightnessModel;
use crate::work::Work;

impl Tracker<'_> {
    /// Gives all that this tracker knows to `write`, in parts of any length. A tracker with the same configuration that is
    /// given these bytes by [`Self::restore`] goes on with the same results, bit for bit, and so does this one. What is left to
    /// do for a new keyframe is done before.
    ///
    /// The bytes are in the order of this machine, and about as many as [`crate::TrackerConfig::workspace_len`] without what
    /// only serves within a frame: 4 MB for images of 640x480.
    pub fn save(&mut self, write: &mut dyn FnMut(&[u8])) {
        self.finish_keyframe_ahead();
        self.walk(&mut Walk::save(write));
    }

    /// Goes on from a session that was saved by a tracker with the same configuration.
    ///
    /// # Errors
    /// [`SessionError`] when the bytes are no such session. The tracker then has forgotten everything, as after
    /// [`Self::reset`].
    pub fn restore(&mut self, session: &[u8]) -> Result<(), SessionError> {
        self.is_unfinished = false;
        let restored = Walk::restore(session).and_then(|mut walk| {
            self.walk(&mut walk);
            walk.end()?;
            if self.is_sound() { Ok(()) } else { Err(SessionError::Unsound) }
        });
        if restored.is_err() {
            self.reset();
        }
        restored
    }

    /// Visits everything that outlives a frame. Whoever adds a field has to decide here whether it does.
    fn walk(&mut self, walk: &mut Walk<'_>) {
        let Self {
            keyframe,
            recent,
            deblur,
            deblurred_with,
            rectify,
            keyframe_span,
            keyframe_gyro,
            gyro_bias,
            last_index,
            late_revision,
            established,
            lost_at_start,
            path_error,
            motion,
            brightness,
            typical,
            last_timestamp,
            frames,
            // Follow from the configuration and the processor.
            simd: _,
            config: _,
            luminance: _,
            // Are made anew from every frame before anything reads them.
            pyramid: _,
            depth: _,
            depth_share: _,
            timing: _,
            span: _,
            gyro: _,
            work: _,
            first_alignment: _,
            // Nothing is left to do when a session is saved.
            is_unfinished: _,
            work_ahead,
            // Serves within an alignment.
            scratch: _,
        } = self;
        keyframe.walk(walk);
        recent.walk(walk);
        deblur.walk(walk);
        walk.vector(deblurred_with);
        rectify.walk(walk);
        walk.value(keyframe_span);
        walk.option(keyframe_gyro, NO_TURNING, visit_gyro);
        walk.vector(gyro_bias);
        walk.count(last_index);
        walk.option(late_revision, no_revision(), visit_revision);
        walk.flag(established);
        walk.count(lost_at_start);
        path_error.walk(walk);
        walk.option(motion, Motion::still(0.0, RigidTransform::identity()), visit_motion);
        let BrightnessModel { gain, offset } = brightness;
        let Typical { residual, depth_residual } = typical;
        [gain, offset, residual, depth_residual].into_iter().for_each(|number| walk.value(number));
        visit_work(walk, work_ahead);
        walk.value(last_timestamp);
        walk.count(frames);
    }

    /// Whether what was restored can be worked with: counts and places that lie within their bounds, poses that are poses,
    /// images without values that are none. It need not be what any frames lead to.
    fn is_sound(&self) -> bool {
        let motion_is_sound = self.motion.is_none_or(|motion| motion.reference_from_mid.is_valid());
        let revision_is_sound = self.late_revision.is_none_or(|revision| {
            let ExposureTrajectory { start, end } = revision.world_from_camera;
            [start, end, revision.world_from_mid].iter().all(RigidTransform::is_valid)
        });
        let counts = [self.frames, self.last_index, self.lost_at_start];
        motion_is_sound
            && revision_is_sound
            // Counts go on without an overflow.
            && counts.iter().all(|count| *count < usize::MAX / 2)
            && self.work_ahead.is_within(&self.config.work_bound())
            && self.keyframe.is_sound()
            && self.recent.is_sound()
            && self.deblur.is_sound()
            && self.rectify.is_sound()
            && self.path_error.is_sound()
    }
}

const NO_TURNING: GyroReading = GyroReading {
    angular_velocity: Vector3::new(0.0, 0.0, 0.0),
    angular_acceleration: Vector3::new(0.0, 0.0, 0.0),
};

fn visit_gyro(walk: &mut Walk<'_>, GyroReading { angular_velocity, angular_acceleration }: &mut GyroReading) {
    walk.vector(angular_velocity);
    walk.vector(angular_acceleration);
}

fn visit_work(walk: &mut Walk<'_>, work: &mut Work) {
    let Work { linearisations, patches, view_pixels, depth_points, blur_taps, image_pixels } = work;
    let counts = [linearisations, patches, view_pixels, depth_points, blur_taps, image_pixels];
    counts.into_iter().for_each(|count| walk.value(count));
}

fn no_revision() -> Revision {
    let pose = RigidTransform::identity();
    Revision { index: 0, world_from_camera: ExposureTrajectory::still(pose), world_from_mid: pose, blur: 0.0 }
}

fn visit_revision(walk: &mut Walk<'_>, revision: &mut Revision) {
    let Revision { index, world_from_camera, world_from_mid, blur } = revision;
    walk.count(index);
    walk.pose(&mut world_from_camera.start);
    walk.pose(&mut world_from_camera.end);
    walk.pose(world_from_mid);
    walk.value(blur);
}

fn visit_motion(walk: &mut Walk<'_>, motion: &mut Motion) {
    let Motion {
        timestamp,
        reference_from_mid,
        between_frames,
        interval,
        exposure,
        within_exposure,
        acceleration,
    } = motion;
    [timestamp, interval, exposure].into_iter().for_each(|number| walk.value(number));
    walk.pose(reference_from_mid);
    walk.vector(between_frames);
    walk.option(within_exposure, nalgebra::Vector6::zeros(), Walk::vector);
    walk.vector(acceleration);
}
