//! Output of the tracker.

use nalgebra::SMatrix;

use crate::align::{LevelOutcome, StopReason, UNKNOWNS};
use crate::geometry::RigidTransform;
use crate::trajectory::ExposureTrajectory;
use crate::transfer::BrightnessModel;
use crate::work::Work;

/// How far a result can be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameStatus {
    /// Aligned.
    Ok,
    /// Aligned, but with few measurements or large residuals.
    Weak,
    /// Not aligned: the pose is the last good one.
    Lost,
}

impl FrameStatus {
    /// `ok`, `weak` or `lost`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Weak => "weak",
            Self::Lost => "lost",
        }
    }
}

/// Why a frame is weak or lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doubt {
    /// The image shows nothing: it is black, saturated or covered.
    Blind,
    /// Nothing to start from: too little depth, depth out of any sensor's range, or no texture.
    NoStart,
    /// Nothing of the reference was found.
    NoMatch,
    /// The camera would have moved faster than any hand, or more jerkily.
    Speed,
    /// The brightness would have changed more than any exposure control changes it.
    Brightness,
    /// Few of the reference's patches are in view and agree.
    Inliers,
    /// Picture and depth fit much worse than usual.
    Residual,
    /// Found again near an earlier keyframe; the motion is not known yet.
    FoundAgain,
}

impl Doubt {
    /// The reason in one or two words, as in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Blind => "blind",
            Self::NoStart => "no start",
            Self::NoMatch => "no match",
            Self::Speed => "speed",
            Self::Brightness => "brightness",
            Self::Inliers => "inliers",
            Self::Residual => "residual",
            Self::FoundAgain => "found again",
        }
    }
}

/// A better estimate of an earlier frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Revision {
    /// Running number of the frame.
    pub index: usize,
    /// `world_from_camera` at its shutter opening and closing.
    pub world_from_camera: ExposureTrajectory,
    /// `world_from_camera` at mid exposure.
    pub world_from_mid: RigidTransform,
    /// Its blur in pixels.
    pub blur: f32,
}

/// Everything known about a frame after tracking.
#[derive(Clone, Debug)]
pub struct FrameResult {
    /// Running number of the frame, from 0.
    pub index: usize,
    /// Mid-exposure time, seconds.
    pub timestamp: f64,
    /// How far the poses can be trusted.
    pub status: FrameStatus,
    /// Why no further; `None` for a frame that is ok.
    pub doubt: Option<Doubt>,
    /// `world_from_camera` at shutter opening and closing of the middle row; the world is the first frame's camera at mid
    /// exposure.
    pub world_from_camera: ExposureTrajectory,
    /// `world_from_camera` at mid exposure of the middle row. That is the middle of the linear motion between opening and
    /// closing unless the path's acceleration is estimated, too.
    pub world_from_mid: RigidTransform,
    /// Inverse covariance of (centre motion, exposure motion, gain, offset) as the objective sees it: translation
    /// in keyframe axes in metres, rotation in the camera in radians.
    pub information: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    /// How far picture and depth are apart about the pose: the square of their difference over what their noise explains;
    /// 1 on average where only noise sets them apart, far above where depth has another time or place than is supposed.
    pub disagreement: f64,
    /// Brightness relative to the reference.
    pub brightness: BrightnessModel,
    /// Mean blur length in pixels.
    pub blur: f32,
    /// Virtual views on the finest level.
    pub virtual_views: usize,
    /// Linearisations on all levels, of all attempts.
    pub iterations: usize,
    /// What the frame took; never more than [`crate::TrackerConfig::work_bound`].
    pub work: Work,
    /// Robust photometric residual: standard deviations of the nominal noise.
    pub residual: f32,
    /// Share of the keyframe's patches that are in view and agree.
    pub inliers: f32,
    /// Robust depth residual, 1/m; 0 when the depth term did not take part.
    pub depth_residual: f32,
    /// Why the last level ended.
    pub stop: StopReason,
    /// Whether the frame became the keyframe.
    pub is_keyframe: bool,
    /// Running number of the frame that it was aligned with.
    pub reference_index: usize,
    /// What this frame taught about an earlier one: the motion of the very first frame is known only after the
    /// second, and whether a shutter was open for the motion that a picture seems to show only after the next.
    pub revision: Option<Revision>,
}

impl FrameResult {
    /// A result with the figures of an alignment; the rest is that of a lost frame that took no work.
    pub(super) fn of(
        index: usize,
        timestamp: f64,
        world_from_camera: ExposureTrajectory,
        outcome: &LevelOutcome,
    ) -> Self {
        Self {
            index,
            timestamp,
            status: FrameStatus::Lost,
            doubt: Some(Doubt::NoMatch),
            world_from_mid: world_from_camera.mid(),
            world_from_camera,
            information: outcome.information,
            disagreement: outcome.disagreement,
            brightness: outcome.estimate.brightness,
            blur: 0.0,
            virtual_views: outcome.views,
            iterations: 0,
            work: Work::none(),
            residual: outcome.photometric_scale,
            inliers: 0.0,
            depth_residual: outcome.depth_scale,
            stop: outcome.stop,
            is_keyframe: false,
            reference_index: index,
            revision: None,
        }
    }
}
