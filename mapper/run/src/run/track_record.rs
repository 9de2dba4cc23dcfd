//! What is known of the frames of a run.

use mba_io::trajectory_file::TimedExposure;
use mba_tracker::geometry::RigidTransform;
use nalgebra::Matrix6;

use super::covariances::turned;
use super::{FrameRecord, FrameStatus, Reason, Upright};

/// Poses and figures of all frames so far, in order of time, and what else a run has to say of its input. Knows nothing of
/// files: [`RunWriter`](super::RunWriter) keeps a folder up to date with it.
#[derive(Clone, Debug, Default)]
pub struct TrackRecord {
    pub(super) exposures: Vec<TimedExposure>,
    pub(super) frames: Vec<FrameRecord>,
    /// By frame; empty where nothing is known.
    pub(super) covariances: Vec<Option<Matrix6<f64>>>,
    pub(super) skipped: usize,
    pub(super) upright: Option<Upright>,
    pub(super) warnings: Vec<String>,
    /// Frames that were added or changed since the folder was last brought up to date.
    pub(super) unwritten: usize,
}

impl TrackRecord {
    /// The exposures so far.
    #[must_use]
    pub fn exposures(&self) -> &[TimedExposure] {
        &self.exposures
    }

    /// What was recorded of the frames so far.
    #[must_use]
    pub fn frames(&self) -> &[FrameRecord] {
        &self.frames
    }

    /// Index and exposure of every keyframe so far.
    #[must_use]
    pub fn keyframes(&self) -> Vec<(usize, TimedExposure)> {
        let all = self.exposures.iter().zip(&self.frames).enumerate();
        all.filter(|(_, (_, record))| record.keyframe != 0)
            .map(|(index, (exposure, _))| (index, *exposure))
            .collect()
    }

    /// Number of frames that were found, counted up to `most`.
    pub(super) fn found(&self, most: usize) -> usize {
        self.frames.iter().filter(|frame| frame.status != FrameStatus::Lost).take(most).count()
    }

    /// Adds one frame.
    pub(super) fn push(&mut self, exposure: TimedExposure, record: FrameRecord) {
        self.exposures.push(exposure);
        self.frames.push(record);
        self.unwritten += 1;
    }

    /// Replaces the exposure and the blur in pixels of frame `index`, counted from 0 in the order of pushing.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn revise(&mut self, index: usize, exposure: TimedExposure, blur_px: f64) {
        let (old, record) = self.frame_mut(index);
        *old = exposure;
        record.blur_px = blur_px;
    }

    /// A lost frame `index` was found at a pose, its motion is unknown: it counts as weak.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn recover(&mut self, index: usize, world_from_camera: &RigidTransform) {
        let (exposure, record) = self.frame_mut(index);
        let [start, mid, end] = [*world_from_camera; 3];
        *exposure = TimedExposure { start, mid, end, ..*exposure };
        (record.status, record.blur_px) = (FrameStatus::Weak, 0.0);
        record.reason = Some(Reason::FoundAgain);
    }

    /// Replaces the exposure and the gain of frame `index` by refined ones, and says whether it is a keyframe of the map.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn refine(&mut self, index: usize, exposure: TimedExposure, gain: f64, is_keyframe: bool) {
        let (old, record) = self.frame_mut(index);
        *old = exposure;
        record.gain = gain;
        record.keyframe = u8::from(is_keyframe);
    }

    /// What is known of a frame, which is about to change.
    #[track_caller]
    fn frame_mut(&mut self, index: usize) -> (&mut TimedExposure, &mut FrameRecord) {
        let count = self.frames.len();
        assert!(index < count, "frame {index} of a run of {count} frames");
        self.unwritten += 1;
        (&mut self.exposures[index], &mut self.frames[index])
    }

    /// Moves every exposure to another world, which may be another one for each frame: `new_world_from_world` by index.
    pub fn move_world(&mut self, new_world_from_world: impl Fn(usize) -> RigidTransform) {
        for (index, exposure) in self.exposures.iter_mut().enumerate() {
            let new_world_from_world = new_world_from_world(index);
            *exposure = exposure.seen_from(&new_world_from_world);
            if let Some(Some(covariance)) = self.covariances.get_mut(index) {
                *covariance = turned(covariance, &new_world_from_world);
            }
        }
        self.unwritten += self.exposures.len();
    }

    /// Notes that the z axis of the world that the exposures are in points up.
    pub fn set_upright(&mut self, upright: Upright) {
        self.upright = Some(upright);
    }

    /// How it is known that the world's z axis points up, if it is.
    #[must_use]
    pub fn upright(&self) -> Option<&Upright> {
        self.upright.as_ref()
    }

    /// Notes the covariance of the pose at mid exposure of every frame that has one, relative to the first frame: translation in
    /// world axes, square metres, before rotation in the camera's, square radians.
    ///
    /// # Panics
    /// If there is not one entry per frame.
    pub fn set_covariances(&mut self, covariances: Vec<Option<Matrix6<f64>>>) {
        assert_eq!(covariances.len(), self.frames.len(), "covariances of another run");
        self.covariances = covariances;
        self.unwritten += 1;
    }

    /// Adds a sentence about the input, for the summary.
    pub fn warn(&mut self, warning: String) {
        self.warnings.push(warning);
    }
}
