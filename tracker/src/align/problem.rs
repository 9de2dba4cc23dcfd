//! What an alignment on one level is given.

use fearless_simd::Level;

use super::depth_problem::DepthProblem;
use super::prior::MotionPrior;
use super::{AlignSettings, Estimate};
use crate::geometry::PinholeCamera;
use crate::image::{GreyLevel, PixelRectangle};
use crate::keyframe::Keypoint;
use crate::surface::{InverseDepthMap, SurfacePlanes};
use crate::trajectory::FrameTiming;
use crate::transfer::{
    BrightnessModel, PatchCost, PatchSite, ResidualModel, RowDelay, TransferProblem, VirtualView,
};

/// The sharp reference that a frame is aligned with.
#[derive(Clone, Copy, Debug)]
pub struct ReferenceData<'a> {
    /// Sharp image, finest level first.
    pub levels: &'a [GreyLevel<'a>],
    /// Keypoints of every level.
    pub keypoints: &'a [&'a [Keypoint]],
    /// Inverse depth.
    pub depth: &'a InverseDepthMap<'a>,
    /// Surface planes of the depth map.
    pub planes: &'a SurfacePlanes<'a>,
}

/// The frame that is aligned.
#[derive(Clone, Copy, Debug)]
pub struct FrameData<'a> {
    /// Blurred image, finest level first.
    pub levels: &'a [GreyLevel<'a>],
    /// Inverse depth at the time that `timing` gives.
    pub depth: &'a InverseDepthMap<'a>,
    /// Which of `levels` has the size of `depth`.
    pub depth_level: usize,
    /// Part of `levels[0]` that holds data.
    pub region: PixelRectangle,
    /// When its rows and its depth were measured.
    pub timing: FrameTiming,
}

/// Memory that an alignment works in.
#[derive(Debug)]
pub struct AlignScratch<'m> {
    /// Patch positions.
    pub sites: &'m mut [PatchSite],
    /// Cost per patch.
    pub costs: &'m mut [PatchCost],
    /// Values whose median is taken.
    pub medians: &'m mut [f32],
}

/// The depth term with its measured noise.
#[derive(Clone, Copy, Debug)]
pub(super) struct DepthPart<'a> {
    pub(super) problem: DepthProblem<'a>,
    /// Robust standard deviation, 1/m.
    pub(super) sigma: f32,
    /// Independent measurements per point.
    pub(super) weight: f64,
}

/// Everything that stays fixed while steps on one level are tried out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Objective<'a> {
    pub(super) simd: Level,
    pub(super) camera: PinholeCamera,
    pub(super) depth_camera: PinholeCamera,
    pub(super) level: usize,
    pub(super) reference: ReferenceData<'a>,
    pub(super) frame: FrameData<'a>,
    pub(super) sites: &'a [PatchSite],
    pub(super) views: usize,
    pub(super) model: ResidualModel,
    pub(super) depth: Option<DepthPart<'a>>,
    pub(super) prior: MotionPrior,
    pub(super) expected_brightness: BrightnessModel,
    /// Typical inverse depth of the scene, 1/m.
    pub(super) inverse_depth: f64,
    pub(super) settings: &'a AlignSettings,
}

impl Objective<'_> {
    /// The transfer at an estimate through `views`, whose rows have the times `rows`.
    pub(super) fn transfer_problem<'b>(
        &'b self,
        estimate: &Estimate,
        views: &'b [VirtualView],
        rows: RowDelay,
    ) -> TransferProblem<'b> {
        TransferProblem {
            reference: self.reference.levels[self.level].image(),
            current: self.frame.levels[self.level].image(),
            focal: [self.camera.fx as f32, self.camera.fy as f32],
            centre: [self.camera.cx as f32, self.camera.cy as f32],
            views,
            brightness: estimate.brightness,
            rows,
        }
    }
}
