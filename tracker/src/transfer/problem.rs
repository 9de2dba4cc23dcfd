//! The data that a transfer kernel reads and writes.

use bytemuck::{Pod, Zeroable};

use super::pattern::PATCH_PIXELS;
use super::virtual_view::VirtualView;
pub(super) use crate::image::LevelImage;

/// Columns of a Jacobian row: start translation, start rotation, end translation, end rotation (three each, left
/// rotations), gain, offset.
pub const ROW_LENGTH: usize = 14;

/// A keypoint as it is observed in the current frame; frozen while one linearisation is tried out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PatchSite {
    /// Column of the patch centre in the current image.
    pub u: i16,
    /// Row of the patch centre in the current image.
    pub v: i16,
    /// Inverse depth `1/d` of the keypoint's plane in the reference frame, 1/m; positive.
    pub inverse_depth: f32,
}

/// Photometric relation between the frames: `predicted = gain * mean(reference) + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrightnessModel {
    /// Factor on reference intensities.
    pub gain: f32,
    /// Linear intensity added after the factor.
    pub offset: f32,
}

impl Default for BrightnessModel {
    fn default() -> Self {
        Self { gain: 1.0, offset: 0.0 }
    }
}

/// One evaluation of all patches of a level.
#[derive(Clone, Copy, Debug)]
pub struct TransferProblem<'a> {
    /// Sharp reference image of this level.
    pub reference: LevelImage<'a>,
    /// Observed, blurred image of this level.
    pub current: LevelImage<'a>,
    /// Focal lengths `(fx, fy)` of this level, pixels; reference and current share them.
    pub focal: [f32; 2],
    /// Principal point `(cx, cy)` of this level, pixels.
    pub centre: [f32; 2],
    /// Virtual views of the exposure; at least one, at most [`super::MAX_VIRTUAL_VIEWS`] (more are ignored).
    pub views: &'a [VirtualView],
    /// Photometric relation.
    pub brightness: BrightnessModel,
}

/// Predicted intensities of a patch, before gain and offset; aligned for whole vectors.
#[derive(Clone, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct PatchValues {
    /// Mean reference intensity over the virtual views, per pattern pixel; zero where it is not valid.
    pub mean: [f32; PATCH_PIXELS],
    /// 1 where all virtual samples of the pixel were valid and the pixel lies in the current image, else 0.
    pub valid: [f32; PATCH_PIXELS],
}

impl Default for PatchValues {
    fn default() -> Self {
        Self { mean: [0.0; PATCH_PIXELS], valid: [0.0; PATCH_PIXELS] }
    }
}

/// Predicted intensities and their derivatives; aligned for whole vectors.
#[derive(Clone, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct PatchRows {
    /// Predicted intensities.
    pub values: PatchValues,
    /// Derivative of the mean by the twelve pose parameters (left rotations): `pose[column][pixel]`; zero where
    /// the pixel is not valid.
    pub pose: [[f32; PATCH_PIXELS]; 12],
}

impl Default for PatchRows {
    fn default() -> Self {
        Self { values: PatchValues::default(), pose: [[0.0; PATCH_PIXELS]; 12] }
    }
}
