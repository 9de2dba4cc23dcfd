//! Why a run cannot be exported.

use std::path::PathBuf;

use mba_io::FileError;
use mba_io::dataset::{FrameReadError, InvalidValue};
use mba_io::output::OutputError;

/// A run cannot be exported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The files of the run contradict each other.
    #[error("{folder} has {exposures} rows in exposures.txt and {frames} in frames.csv")]
    Rows {
        /// The run.
        folder: PathBuf,
        /// Rows of poses.
        exposures: usize,
        /// Rows of the table of frames.
        frames: usize,
    },
    /// No frame of the run has a pose.
    #[error("{folder} has no frame with a pose: all {lost} are lost")]
    NoPose {
        /// The run.
        folder: PathBuf,
        /// Lost frames.
        lost: usize,
    },
    /// Only keyframes are wanted, and there is none.
    #[error("{folder} has no keyframe with a pose")]
    NoKeyframe {
        /// The run.
        folder: PathBuf,
    },
    /// The run does not tell its camera.
    #[error("{folder} does not tell its camera")]
    NoCamera {
        /// The run.
        folder: PathBuf,
    },
    /// The run's camera makes no sense.
    #[error("{folder} has a camera whose {reason}")]
    InvalidCamera {
        /// The run.
        folder: PathBuf,
        /// The value that is out of its range.
        reason: InvalidValue,
    },
    /// A frame is not in the run, and nobody has opened the data set.
    #[error("frame {index} is in the data set, which is not there")]
    NoDataSet {
        /// Index of the frame.
        index: usize,
    },
    /// The data set has another camera than the run.
    #[error("{field} is {found} in the data set {dataset}, and {expected} in the run")]
    Camera {
        /// The data set.
        dataset: PathBuf,
        /// The intrinsic that differs.
        field: &'static str,
        /// Its value in the data set.
        found: f64,
        /// Its value in the run.
        expected: f64,
    },
    /// The data set has more or fewer frames.
    #[error("the data set {dataset} has {found} frames, and the run {expected}")]
    Frames {
        /// The data set.
        dataset: PathBuf,
        /// Frames of the data set.
        found: usize,
        /// Frames of the run.
        expected: usize,
    },
    /// A frame has another time in the data set.
    #[error("frame {index} is at {found:.6} s in the data set {dataset}, and at {expected:.6} s in the run")]
    Timestamp {
        /// The data set.
        dataset: PathBuf,
        /// Index of the frame.
        index: usize,
        /// Its time in the data set, seconds.
        found: f64,
        /// Its time in the run, seconds.
        expected: f64,
    },
    /// An image of the run does not have the size of its camera.
    #[error("{path} has {} x {} pixels, the run's camera {} x {}", .found[0], .found[1], .expected[0], .expected[1])]
    Size {
        /// The image.
        path: PathBuf,
        /// Its columns and rows.
        found: [usize; 2],
        /// Columns and rows of the camera.
        expected: [usize; 2],
    },
    /// An image cannot be read.
    #[error(transparent)]
    Image(#[from] FrameReadError),
    /// An image cannot be encoded.
    #[error("cannot encode {name}: {reason}")]
    Encode {
        /// Name of the image in the export.
        name: String,
        /// What the encoder says.
        reason: std::io::Error,
    },
    /// A file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The folder cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}
