//! Why a checkpoint cannot be used.

use std::path::PathBuf;

use mba_tracker::SessionError;

use super::Difference;
use crate::{BinaryFileError, FileError};

/// A checkpoint cannot be written or is not fit to go on from.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// The file cannot be read or written; an older checkpoint is still there.
    #[error(transparent)]
    File(#[from] FileError),
    /// The value cannot be encoded: it has a sequence of unknown length.
    #[error("cannot write {path}: {reason}")]
    Unencodable {
        /// The checkpoint.
        path: PathBuf,
        /// What the encoder says.
        reason: postcard::Error,
    },
    /// The file does not start like a checkpoint.
    #[error("{path} is not a checkpoint")]
    NotACheckpoint {
        /// The file.
        path: PathBuf,
    },
    /// The file was cut or changed, or has the layout of another version.
    #[error(transparent)]
    Unsound(#[from] BinaryFileError),
    /// The checkpoint is whole but belongs to another run.
    #[error("{path} is a checkpoint {difference}")]
    Foreign {
        /// The checkpoint.
        path: PathBuf,
        /// The first difference in the order of [`super::Identity`].
        difference: Difference,
    },
    /// What was recorded of the frames is not of this many frames.
    #[error("{path} holds frames that the data set does not have")]
    Rows {
        /// The checkpoint.
        path: PathBuf,
    },
    /// The tracker cannot go on from what is stored of it.
    #[error("cannot go on from {path}: {reason}")]
    Session {
        /// The checkpoint.
        path: PathBuf,
        /// What the tracker says.
        reason: SessionError,
    },
    /// The content is whole but not a value of the expected type.
    #[error("{path} does not hold what this program expects: {reason}")]
    Content {
        /// The checkpoint.
        path: PathBuf,
        /// What the decoder says.
        reason: postcard::Error,
    },
}
