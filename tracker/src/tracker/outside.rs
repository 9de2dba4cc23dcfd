//! What a map or a loop closure tells the tracker: sharp views, where it is, which world it is in.

use super::frame::ReferenceView;
use super::history::Motion;
use super::track::Tracker;
use crate::error::FrameError;
use crate::geometry::RigidTransform;
use crate::photometric::Vignetting;
use crate::trajectory::{BowedTrajectory, ExposureTrajectory, FrameTiming};
use crate::transfer::BrightnessModel;

impl Tracker<'_> {
    /// Replaces the keyframe by a sharp view from outside, for example rendered from a map.
    ///
    /// Its pose must be in the tracker's world. Tracking starts from it if no frame was tracked yet.
    ///
    /// # Errors
    /// [`FrameError::Size`] when the images do not have the configured size, [`FrameError::Pose`] when the pose is
    /// not finite or not a rotation.
    pub fn set_reference(&mut self, view: &ReferenceView) -> Result<(), FrameError> {
        self.check_size(&[view.colour.size(), view.depth.size()])?;
        if !view.world_from_camera.is_valid() {
            return Err(FrameError::Pose);
        }
        self.finish_keyframe_ahead();
        self.keep_keyframe();
        self.keyframe.pyramid.fill(&view.colour, &self.luminance, &Vignetting::NONE);
        self.keyframe.depth.fill(self.simd, &view.depth, self.config.metres_per_unit);
        self.keyframe.world_from_keyframe = view.world_from_camera;
        let still = ExposureTrajectory::still(RigidTransform::identity());
        self.keyframe.keyframe_from_camera = Some(BowedTrajectory::without_bow(still));
        self.keyframe.timing = FrameTiming::GLOBAL;
        self.keyframe.blur = 0.0;
        self.keyframe.frame_index = self.frames.saturating_sub(1);
        self.keyframe.restart_surface(self.simd);
        self.select_keypoints();
        self.brightness = BrightnessModel::default();
        if self.motion.is_none() {
            self.motion = Some(Motion::still(self.last_timestamp, view.world_from_camera));
        }
        Ok(())
    }

    /// Replaces the keyframe as [`Self::set_reference`] does and goes on near `world_from_camera`, wherever the camera
    /// was thought to be before: for a lost tracker whose place was recognised. The next frame is looked for around
    /// that pose and that of the view; how the camera moves is unknown until then.
    ///
    /// # Errors
    /// As [`Self::set_reference`], also for `world_from_camera`; the tracker is then unchanged.
    pub fn relocate(
        &mut self,
        view: &ReferenceView,
        world_from_camera: &RigidTransform,
    ) -> Result<(), FrameError> {
        if !world_from_camera.is_valid() {
            return Err(FrameError::Pose);
        }
        self.set_reference(view)?;
        // As long ago as can be: the way from there to the next frame then says nothing about its speed.
        self.motion = Some(Motion::still(f64::NEG_INFINITY, *world_from_camera));
        Ok(())
    }

    /// Moves all that the tracker remembers into another world, as a loop closure does. Later poses are
    /// `new_world_from_camera`; nothing else changes.
    ///
    /// # Errors
    /// [`FrameError::Pose`] when the transform is not finite or not a rotation; the tracker is then unchanged.
    pub fn move_world(&mut self, new_world_from_world: &RigidTransform) -> Result<(), FrameError> {
        if !new_world_from_world.is_valid() {
            return Err(FrameError::Pose);
        }
        self.motion = self.motion.map(|motion| motion.seen_from(new_world_from_world));
        let keyframe = &mut self.keyframe;
        keyframe.world_from_keyframe = new_world_from_world.compose(&keyframe.world_from_keyframe);
        self.recent.move_world(new_world_from_world);
        Ok(())
    }
}
