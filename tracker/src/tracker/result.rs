//! Output of the tracker.

use crate::align::{StopReason, UNKNOWNS};
use crate::trajectory::ExposureTrajectory;
use crate::transfer::BrightnessModel;
use nalgebra::SMatrix;

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

/// Everything known about a frame after tracking.
#[derive(Clone, Debug)]
pub struct FrameResult {
    /// Running number of the frame, from 0.
    pub index: usize,
    /// Mid-exposure time, seconds.
    pub timestamp: f64,
    /// How far the poses can be trusted.
    pub status: FrameStatus,
    /// `world_from_camera` at shutter opening and closing; the world is the first frame's camera at mid exposure.
    pub world_from_camera: ExposureTrajectory,
    /// Inverse covariance of (centre motion, exposure motion, gain, offset) as the objective sees it.
    pub information: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    /// Brightness relative to the reference.
    pub brightness: BrightnessModel,
    /// Mean blur length in pixels.
    pub blur: f32,
    /// Virtual views on the finest level.
    pub virtual_views: usize,
    /// Linearisations on all levels.
    pub iterations: usize,
    /// Robust photometric residual: standard deviations of the nominal noise.
    pub residual: f32,
    /// Share of the keyframe's patches that are in view and agree.
    pub inliers: f32,
    /// Robust depth residual, 1/m.
    pub depth_residual: f32,
    /// Why the last level ended.
    pub stop: StopReason,
    /// Whether the frame became the keyframe.
    pub is_keyframe: bool,
    /// Running number of the frame that it was aligned with.
    pub reference_index: usize,
}
