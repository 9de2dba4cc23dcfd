//! Why a checkpoint cannot be used.

use std::path::PathBuf;

use super::Difference;
use crate::FileError;

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
    /// The layout is that of another version.
    #[error("{path} has version {found} of the checkpoint layout, this program reads version {expected}")]
    Version {
        /// The checkpoint.
        path: PathBuf,
        /// Version in the file.
        found: u32,
        /// The version that can be read.
        expected: u32,
    },
    /// The file is shorter or longer than it should be.
    #[error("{path} should have {expected} bytes and has {found}: it was cut or something was added")]
    Length {
        /// The checkpoint.
        path: PathBuf,
        /// Bytes that the header announces; for a cut header those of a header.
        expected: u64,
        /// Bytes in the file.
        found: u64,
    },
    /// The checksum is wrong.
    #[error("{path} is damaged: its checksum is {found:08x}, expected {expected:08x}")]
    Damaged {
        /// The checkpoint.
        path: PathBuf,
        /// Checksum in the file.
        expected: u32,
        /// Checksum of the content.
        found: u32,
    },
    /// The checkpoint is whole but belongs to another run.
    #[error("{path} is a checkpoint {difference}")]
    Foreign {
        /// The checkpoint.
        path: PathBuf,
        /// The first difference in the order of [`super::Identity`].
        difference: Difference,
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
