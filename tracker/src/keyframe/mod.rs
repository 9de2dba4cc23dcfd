//! Keyframes: the sharp reference that frames are aligned with.

mod select;

pub use select::{Keypoint, SelectionSettings, select_keypoints};
