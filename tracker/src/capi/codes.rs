//! Numbers that C sees instead of enumerations, and their names.

use core::ffi::{CStr, c_char};

use crate::error::{ConfigError, FrameError};

/// All is well.
pub const MBA_OK: i32 = 0;
/// A pointer that must not be null is null.
pub const MBA_ERROR_NULL_POINTER: i32 = 1;
/// A pointer does not have the alignment of what it points to, or the memory not that of `MBA_MEMORY_ALIGNMENT`.
pub const MBA_ERROR_MISALIGNED: i32 = 2;
/// Memory or an image is shorter than its size and stride say.
pub const MBA_ERROR_SHORT_BUFFER: i32 = 3;
/// An image does not have the configured size.
pub const MBA_ERROR_IMAGE_SIZE: i32 = 4;
/// A stride is shorter than a row, or that of a depth image odd.
pub const MBA_ERROR_STRIDE: i32 = 5;
/// A pixel format is none of `MBA_PIXEL_*`.
pub const MBA_ERROR_PIXEL_FORMAT: i32 = 6;
/// The calibration or a setting is outside its range or not a number.
pub const MBA_ERROR_CONFIG: i32 = 7;
/// A timestamp is not finite or not after that of the frame before.
pub const MBA_ERROR_TIMESTAMP: i32 = 8;
/// An exposure time is negative or not finite.
pub const MBA_ERROR_EXPOSURE: i32 = 9;
/// A pose is not finite or its quaternion not of unit length.
pub const MBA_ERROR_POSE: i32 = 10;
/// An angular velocity is not finite.
pub const MBA_ERROR_ANGULAR_VELOCITY: i32 = 11;
/// The memory does not hold a tracker.
pub const MBA_ERROR_NOT_INITIALISED: i32 = 12;
/// The time of a depth image is not finite or more than 0.2 s from that of its colour image.
pub const MBA_ERROR_DEPTH_TIMESTAMP: i32 = 13;

/// One byte per pixel.
pub const MBA_PIXEL_GREY8: i32 = 1;
/// Three bytes per pixel: red, green, blue.
pub const MBA_PIXEL_RGB8: i32 = 2;

/// The frame was aligned.
pub const MBA_STATUS_OK: i32 = 0;
/// Aligned, but with few measurements or large residuals.
pub const MBA_STATUS_WEAK: i32 = 1;
/// Not aligned: the pose is the last good one.
pub const MBA_STATUS_LOST: i32 = 2;

/// Keyframes are deblurred with their own motion.
pub const MBA_REFERENCE_DEBLURRED: i32 = 0;
/// Keyframes stay as captured; takes less memory.
pub const MBA_REFERENCE_RAW: i32 = 1;

/// As accurate as can be.
pub const MBA_EFFORT_FULL: i32 = 0;
/// At most 5 linearisations per level and 16 virtual views.
pub const MBA_EFFORT_MEDIUM: i32 = 1;
/// At most 3 linearisations per level and 8 virtual views.
pub const MBA_EFFORT_LOW: i32 = 2;

/// Alignment in bytes of the memory of a tracker.
pub const MBA_MEMORY_ALIGNMENT: usize = 64;

/// What a code of this interface means, in English.
pub(super) const fn describe(code: i32) -> &'static CStr {
    match code {
        MBA_OK => c"ok",
        MBA_ERROR_NULL_POINTER => c"a pointer is null",
        MBA_ERROR_MISALIGNED => c"a pointer is misaligned",
        MBA_ERROR_SHORT_BUFFER => c"memory or an image is shorter than needed",
        MBA_ERROR_IMAGE_SIZE => c"an image does not have the configured size",
        MBA_ERROR_STRIDE => c"a stride is shorter than a row, or odd for depth",
        MBA_ERROR_PIXEL_FORMAT => c"unknown pixel format",
        MBA_ERROR_CONFIG => c"calibration or setting outside its range",
        MBA_ERROR_TIMESTAMP => c"timestamp is not finite or not after that of the frame before",
        MBA_ERROR_EXPOSURE => c"exposure is negative or not finite",
        MBA_ERROR_POSE => c"pose is not finite or its quaternion not of unit length",
        MBA_ERROR_ANGULAR_VELOCITY => c"angular velocity is not finite",
        MBA_ERROR_NOT_INITIALISED => c"memory holds no tracker",
        MBA_ERROR_DEPTH_TIMESTAMP => {
            c"depth timestamp is not finite or more than 0.2 s from that of the image"
        }
        _ => c"unknown code",
    }
}

/// Name of a frame's status.
pub(super) const fn status_name(status: i32) -> &'static CStr {
    match status {
        MBA_STATUS_OK => c"ok",
        MBA_STATUS_WEAK => c"weak",
        MBA_STATUS_LOST => c"lost",
        _ => c"unknown status",
    }
}

pub(super) const fn as_c(text: &'static CStr) -> *const c_char {
    text.as_ptr()
}

pub(super) fn code_of_frame(error: FrameError) -> i32 {
    match error {
        FrameError::Buffer(_) => MBA_ERROR_SHORT_BUFFER,
        FrameError::Size { .. } => MBA_ERROR_IMAGE_SIZE,
        FrameError::Timestamp { .. } => MBA_ERROR_TIMESTAMP,
        FrameError::DepthTimestamp { .. } => MBA_ERROR_DEPTH_TIMESTAMP,
        // Frames of the C interface have no expected path.
        FrameError::Pose | FrameError::ExpectedPath => MBA_ERROR_POSE,
        FrameError::Exposure { .. } => MBA_ERROR_EXPOSURE,
    }
}

pub(super) fn code_of_config(error: ConfigError) -> i32 {
    match error {
        ConfigError::Setting { .. } => MBA_ERROR_CONFIG,
        ConfigError::Workspace(_) => MBA_ERROR_SHORT_BUFFER,
    }
}
