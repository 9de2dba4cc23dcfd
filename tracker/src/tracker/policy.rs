//! When a frame is trusted and when it becomes the keyframe.

use super::result::FrameStatus;
use crate::align::{LevelOutcome, StopReason};

/// What an alignment ended with, in the terms of the decisions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Evidence {
    /// Share of the keyframe's patches in view.
    pub(super) overlap: f32,
    /// Share of the keyframe's patches in view that agree.
    pub(super) inliers: f32,
    /// Mean image motion since the keyframe, pixels.
    pub(super) flow: f32,
    /// Blur, pixels.
    pub(super) blur: f32,
    /// Share of the image with measured depth.
    pub(super) depth_share: f32,
    /// Speed since the last frame, m/s.
    pub(super) speed: f64,
    /// Angular speed since the last frame, rad/s.
    pub(super) angular_speed: f64,
}

/// Running means of what good frames end with.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Typical {
    /// Photometric residual of the finest level.
    pub(super) residual: f32,
    /// Depth residual, 1/m.
    pub(super) depth_residual: f32,
}

impl Typical {
    /// Takes in a good frame.
    pub(super) fn learn(&mut self, outcome: &LevelOutcome) {
        let share = if self.residual == 0.0 { 1.0 } else { 0.2 };
        self.residual += share * (outcome.photometric_scale - self.residual);
        self.depth_residual += share * (outcome.depth_scale - self.depth_residual);
    }
}

/// Speeds beyond which a hand-held or flying camera's pose is a mistake.
const MAX_SPEED: f64 = 8.0;
const MAX_ANGULAR_SPEED: f64 = 15.0;

/// How far the pose can be trusted.
pub(super) fn judge(outcome: &LevelOutcome, evidence: &Evidence, typical: &Typical) -> FrameStatus {
    let aligned = !matches!(outcome.stop, StopReason::NoData | StopReason::Singular);
    let plausible = evidence.speed < MAX_SPEED && evidence.angular_speed < MAX_ANGULAR_SPEED;
    let measured = evidence.inliers > 0.08 || outcome.depth_points > 300;
    if !(aligned && plausible && measured) {
        return FrameStatus::Lost;
    }
    let residual = ratio(outcome.photometric_scale, typical.residual);
    let depth_residual = ratio(outcome.depth_scale, typical.depth_residual);
    let depth_agrees = outcome.depth_points > 300 && depth_residual < 3.0;
    if residual > 4.0 && !depth_agrees {
        return FrameStatus::Lost;
    }
    if residual > 2.5 || evidence.inliers < 0.2 { FrameStatus::Weak } else { FrameStatus::Ok }
}

/// Whether an alignment fits so much worse than usual that another try from other guesses is worth its time.
pub(super) fn fits_badly(outcome: &LevelOutcome, typical: &Typical) -> bool {
    ratio(outcome.photometric_scale, typical.residual) > 2.0
}

fn ratio(value: f32, typical: f32) -> f32 {
    if typical > 0.0 { value / typical } else { 1.0 }
}

/// Whether the frame should replace a keyframe that was blurred by `keyframe_blur` pixels.
///
/// A keyframe is chosen for being sharp, not only for distance: a frame that is much sharper is taken at once, one
/// that is far is taken if it is not blurred more, and only when the view is about to be lost is any frame taken. Where
/// `rolling` rows make the velocity an unknown that only overlap can tell, a new view is worth more blur.
pub(super) fn wants_keyframe(
    evidence: &Evidence,
    keyframe_blur: f32,
    image_width: usize,
    rolling: bool,
) -> bool {
    let width = image_width as f32;
    let usable = evidence.depth_share > 0.15;
    let much_sharper = evidence.blur + 1.0 < 0.6 * keyframe_blur;
    let far = evidence.overlap < 0.6 || evidence.flow > 0.2 * width;
    let as_sharp = evidence.blur < (1.2 * keyframe_blur).max(if rolling { 0.012 } else { 0.006 } * width);
    let leaving = evidence.overlap < 0.45 || evidence.flow > 0.3 * width;
    usable && (much_sharper || (far && as_sharp) || leaving)
}
