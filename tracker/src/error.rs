//! Errors of the tracker's interface.

use core::fmt;

use crate::image::ExtentError;
use crate::workspace::WorkspaceError;

/// Why a frame cannot be used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FrameError {
    /// A buffer is too short for its size and stride.
    Buffer(ExtentError),
    /// An image does not have the size of the configuration.
    Size {
        /// Configured columns and rows.
        expected: (usize, usize),
        /// Columns and rows of the image.
        got: (usize, usize),
    },
    /// The timestamp is not finite or not after that of the frame before.
    Timestamp {
        /// Timestamp of the frame before, seconds.
        previous: f64,
        /// Timestamp of this frame, seconds.
        got: f64,
    },
    /// The time of the depth image is not finite or more than 0.2 s from that of the colour image.
    DepthTimestamp {
        /// Timestamp of the colour image, seconds.
        frame: f64,
        /// Timestamp of the depth image, seconds.
        got: f64,
    },
    /// A pose is not finite or its quaternion not of unit length.
    Pose,
    /// The exposure time is negative or not finite.
    Exposure {
        /// Exposure in seconds.
        got: f64,
    },
    /// What is expected of the path is not finite, impossible for any camera, or its standard deviation below 0.
    ExpectedPath,
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Buffer(error) => error.fmt(f),
            Self::Size { expected, got } => {
                write!(f, "image is {}x{}, the calibration says {}x{}", got.0, got.1, expected.0, expected.1)
            }
            Self::Timestamp { previous, got } => {
                write!(f, "timestamp {got:.6} s does not follow {previous:.6} s")
            }
            Self::DepthTimestamp { frame, got } => {
                write!(f, "depth of {got:.6} s does not belong to the image of {frame:.6} s")
            }
            Self::Pose => f.write_str("pose is not finite or its quaternion not of unit length"),
            Self::Exposure { got } => write!(f, "exposure of {got} s is not a duration"),
            Self::ExpectedPath => f.write_str("the expected path is not that of a camera"),
        }
    }
}

impl core::error::Error for FrameError {}

impl From<ExtentError> for FrameError {
    fn from(error: ExtentError) -> Self {
        Self::Buffer(error)
    }
}

/// Why a tracker cannot be built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ConfigError {
    /// A setting is outside its range.
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The range it must lie in.
        expected: &'static str,
    },
    /// The caller's memory cannot be used.
    Workspace(WorkspaceError),
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Setting { name, value, expected } => write!(f, "{name} = {value}: expected {expected}"),
            Self::Workspace(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for ConfigError {}

impl From<WorkspaceError> for ConfigError {
    fn from(error: WorkspaceError) -> Self {
        Self::Workspace(error)
    }
}
