//! Why nothing is written there.

use std::io;
use std::path::{Path, PathBuf};

use crate::FileError;

/// A path must not be written to, or cannot be.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The path is a recording or lies in one.
    #[error("cannot write {path}: it lies in the data set {dataset}, and recordings stay as they are")]
    DataSet {
        /// Where to write.
        path: PathBuf,
        /// The data set, without links.
        dataset: PathBuf,
    },
    /// The path is what the same command reads.
    #[error("cannot write {path}: the command reads it")]
    Input {
        /// Where to write.
        path: PathBuf,
    },
    /// Somebody else's file or folder.
    #[error("cannot write {path}: it holds {found}, which this program did not write")]
    Foreign {
        /// Where to write.
        path: PathBuf,
        /// Name of something in the folder, or what the file looks like.
        found: String,
    },
    /// Something else than a folder is where one should be.
    #[error("cannot write {path}: it is a {kind}, not a folder")]
    NotAFolder {
        /// Where to write.
        path: PathBuf,
        /// What it is.
        kind: &'static str,
    },
    /// Something that is no file, pipe or device is where a file should be.
    #[error("cannot write {path}: it is a {kind}, not a file")]
    NotAFile {
        /// Where to write.
        path: PathBuf,
        /// What it is.
        kind: &'static str,
    },
    /// A link leads to nothing.
    #[error("cannot write {path}: {link} is a link to nothing")]
    DeadLink {
        /// Where to write.
        path: PathBuf,
        /// The link.
        link: PathBuf,
    },
    /// Another process writes the same folder.
    #[error("cannot write {path}: another process is writing it{}", process(*pid))]
    InUse {
        /// Where to write.
        path: PathBuf,
        /// Number of that process, if it left one.
        pid: Option<u32>,
    },
    /// The operating system does not let it happen.
    #[error(transparent)]
    File(#[from] FileError),
}

fn process(pid: Option<u32>) -> String {
    pid.map_or_else(String::new, |pid| format!(", process {pid}"))
}

impl OutputError {
    /// The error of a path that cannot be written for `reason`.
    pub(super) fn unwritable(path: &Path, reason: io::Error) -> Self {
        FileError::Unwritable { path: path.to_owned(), reason }.into()
    }
}
