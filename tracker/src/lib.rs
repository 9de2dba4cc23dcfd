//! Motion-blur-aware RGB-D camera tracking for devices: `no_std`, no heap, one core.
//!
//! A camera moves while its shutter is open, so a frame is the average of many sharp *virtual views* along a
//! short trajectory. This crate estimates, for every RGB-D frame, the camera pose at shutter opening and at
//! shutter closing.
//!
//! # Conventions
//!
//! * Camera frame: x right, y down, z forward. The centre of the top-left pixel is `(0, 0)`.
//! * Poses map camera coordinates into a reference (keyframe or world) frame and are named
//!   `reference_from_camera`: `x_reference = R * x_camera + p`, metres and unit quaternions.
//! * Tangent vectors are `(translation, rotation)`: translation added in the reference frame, rotation
//!   multiplied on the right (camera frame), radians.
//! * Intensities are linear light in `[0, 1]`. Depth is z along the optical axis in metres, not distance.
//! * Exposure time is normalised: `s = 0` at shutter opening, `s = 1` at closing.
#![no_std]
#![deny(unsafe_code)]

#[cfg(feature = "std")]
extern crate std;

pub mod align;
pub mod deblur;
pub mod error;
pub mod geometry;
pub mod image;
pub mod keyframe;
pub mod math;
pub mod photometric;
pub mod simd;
pub mod surface;
mod tracker;
pub mod trajectory;
pub mod transfer;
pub mod workspace;

/// Instruction sets that the kernels can run on; chosen once, at construction.
pub use fearless_simd::Level as SimdLevel;
pub use tracker::{
    Frame, FrameResult, FrameStatus, ReferenceMode, ReferenceView, Revision, Tracker, TrackerConfig,
    workspace_len,
};
