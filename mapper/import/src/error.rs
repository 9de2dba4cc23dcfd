//! Why a recording cannot be brought in.

use std::path::{Path, PathBuf};

use mba_io::FileError;
use mba_io::dataset::DatasetError;
use mba_io::output::OutputError;

/// A recording cannot be brought in; what was written so far is gone again.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The source is nothing that is known.
    #[error("{source_path} is no recording that is known; looked for {looked_for}")]
    Unknown {
        /// The source.
        source_path: PathBuf,
        /// What would have been recognised.
        looked_for: String,
    },
    /// A file is cut off or damaged, or not what its name says.
    #[error("{path} cannot be read: {reason}")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        reason: String,
    },
    /// The recording is sound but lacks something, or has it in a form that is not read.
    #[error("{path}: {reason}")]
    Unusable {
        /// The file or folder.
        path: PathBuf,
        /// What is missing or not read.
        reason: String,
        /// What the user can do.
        hint: String,
    },
    /// A file is unreadable or malformed.
    #[error(transparent)]
    File(#[from] FileError),
    /// The place for the data set may not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// What was recorded does not make a data set.
    #[error("{source_path} does not make a data set: {error}")]
    Unfit {
        /// The recording.
        source_path: PathBuf,
        /// Why what was written of it is none. It has gone again.
        error: DatasetError,
    },
    /// The source is a data set in a layout that is read as it is, and cannot be used.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
}

impl ImportError {
    /// A file that is cut off or damaged.
    pub(crate) fn damaged(path: &Path, reason: impl Into<String>) -> Self {
        Self::Damaged { path: path.to_owned(), reason: reason.into() }
    }

    /// A recording that lacks something.
    pub(crate) fn unusable(path: &Path, reason: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Unusable { path: path.to_owned(), reason: reason.into(), hint: hint.into() }
    }

    /// A file that the operating system does not let be read.
    pub(crate) fn unreadable(path: &Path, reason: std::io::Error) -> Self {
        FileError::Unreadable { path: path.to_owned(), reason }.into()
    }
}
