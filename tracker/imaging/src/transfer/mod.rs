//! Pixel transfer through the fronto-parallel plane of a keypoint, and the blurred patch it predicts.
//!
//! A pixel of a virtual view is mapped into the sharp reference image through the plane `z = d` on which its
//! keypoint lies; the mean of the reference intensities over all virtual views of an exposure is the intensity
//! the blurred frame should show (MBA-VO and MBA-SLAM, with the corrections stated at each formula).

mod accumulate;
mod evaluate;
mod kernel;
mod pattern;
mod pixel;
mod problem;
pub mod reference;
mod sums;
mod virtual_view;

pub use evaluate::{
    TransferParts, accumulate_rows, evaluate_cost, linearize, linearize_bowed, transfer_rows, transfer_values,
};
pub use pattern::{PATCH_PIXELS, PATTERN_DU, PATTERN_DV, PATTERN_RADIUS};
pub use pixel::{TransferredPixel, transfer_pixel};
pub use problem::{
    BOWED_PATH, BOWED_ROW_LENGTH, BrightnessModel, LINEAR_PATH, PatchRows, PatchSite, PatchValues,
    ROW_LENGTH, RowDelay, TransferProblem,
};
pub use sums::{BowedSums, PatchCost, PhotometricSums, ResidualModel, huber};
pub use virtual_view::{MAX_BANDS, MAX_VIRTUAL_VIEWS, RowBand, VirtualView, virtual_views};
