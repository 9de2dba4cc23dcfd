//! Keyframes: the sharp reference that frames are aligned with.

mod frame;
mod rectify;
mod resample;
mod rolling_fusion;
mod row_views;
mod select;

pub use frame::{Keyframe, MAX_KEYPOINTS, max_keypoints};
pub use rectify::RectifyScratch;
pub use select::{Keypoint, SelectionSettings, select_keypoints, typical_inverse_depth};
