//! Why a map file cannot be read.

use std::path::PathBuf;

use mba_io::{BinaryFileError, FileError};

/// A map file of a field cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FieldFileError {
    /// The file cannot be opened.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file does not start like a map of this kind.
    #[error("{path} is not a map of a tri-plane field")]
    NotAField {
        /// The file.
        path: PathBuf,
    },
    /// The file was cut or changed, or has the layout of another version.
    #[error(transparent)]
    Unsound(#[from] BinaryFileError),
    /// A value of the header is out of range.
    #[error("{path}: {field} is {value}, expected {expected}")]
    Header {
        /// The file.
        path: PathBuf,
        /// What the value says.
        field: &'static str,
        /// The value.
        value: String,
        /// Its range.
        expected: &'static str,
    },
    /// A weight or a value of a plane is infinite or not a number.
    #[error("{path}: {part} has a value that is not a finite number")]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// Where the value is.
        part: &'static str,
    },
}
