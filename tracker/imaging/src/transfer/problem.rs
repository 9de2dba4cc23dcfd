//! The data that a transfer kernel reads and writes.

use bytemuck::{Pod, Zeroable};

use super::pattern::PATCH_PIXELS;
use super::virtual_view::VirtualView;
pub(super) use crate::image::LevelImage;

/// Parameters of a path without bow: translation and left rotation of start and of end.
pub const LINEAR_PATH: usize = 12;

/// Parameters of a path with bow: those of [`LINEAR_PATH`], then the bow's translation and rotation in the camera.
pub const BOWED_PATH: usize = 18;

/// Columns of a Jacobian row: start translation, start rotation, end translation, end rotation (three each, left
/// rotations), gain, offset.
pub const ROW_LENGTH: usize = LINEAR_PATH + 2;

/// Columns of a Jacobian row of a path with bow: as [`ROW_LENGTH`], with the bow (translation, rotation in the camera)
/// before gain and offset.
pub const BOWED_ROW_LENGTH: usize = BOWED_PATH + 2;

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
    /// How the time of a row differs from that of the views.
    pub rows: RowDelay,
}

/// Rows that are exposed one after the other: `views` are those of one row, a patch in row `v` of the current image is
/// exposed `(v - centre) step` later, in units of normalised time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RowDelay {
    /// Row whose views are given.
    pub centre: f32,
    /// Normalised time from one row to the next; 0 for a global shutter.
    pub step: f32,
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
pub struct PatchRows<const PATH: usize = LINEAR_PATH> {
    /// Predicted intensities.
    pub values: PatchValues,
    /// Derivative of the mean by the parameters of the path, in the order of [`LINEAR_PATH`] or [`BOWED_PATH`]:
    /// `pose[column][pixel]`; zero where the pixel is not valid.
    pub pose: [[f32; PATCH_PIXELS]; PATH],
}

impl<const PATH: usize> Default for PatchRows<PATH> {
    fn default() -> Self {
        Self { values: PatchValues::default(), pose: [[0.0; PATCH_PIXELS]; PATH] }
    }
}
