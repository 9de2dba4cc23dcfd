//! What can be wrong with a RUN folder.

use std::io;
use std::path::{Path, PathBuf};

use mba_io::FileError;
use mba_io::output::OutputError;

/// A RUN folder cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The disk is full; the last complete version of every file is still there.
    #[error("cannot write {path}: the disk is full")]
    DiskFull {
        /// The file that did not fit.
        path: PathBuf,
    },
    /// A folder or file cannot be created or written.
    #[error("cannot write {path}: {reason}")]
    Unwritable {
        /// The folder or file.
        path: PathBuf,
        /// What the operating system says.
        reason: io::Error,
    },
    /// The folder has no summary, so no command wrote it.
    #[error("{folder} is not a run folder: it has no {missing}")]
    NotARun {
        /// The folder.
        folder: PathBuf,
        /// Name of the file that every run has.
        missing: &'static str,
    },
    /// A row of the table of frames makes no sense.
    #[error("{path}, line {line}: {message}")]
    MalformedFrame {
        /// The table.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// What is wrong with which value.
        message: String,
    },
    /// The summary is not the JSON that this version writes.
    #[error("{path}: {message}")]
    MalformedSummary {
        /// The summary.
        path: PathBuf,
        /// What is wrong, with line and column.
        message: String,
    },
    /// The folder must not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A trajectory, or any file that cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
}

impl RunError {
    /// The error of writing `path`.
    pub(super) fn unwritable(path: &Path, reason: io::Error) -> Self {
        let path = path.to_owned();
        match reason.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::DiskFull { path },
            _ => Self::Unwritable { path, reason },
        }
    }

    /// The error of writing, whichever layer noticed it.
    pub(super) fn from_write(error: FileError) -> Self {
        match error {
            FileError::Unwritable { path, reason } => Self::unwritable(&path, reason),
            other => Self::File(other),
        }
    }
}
