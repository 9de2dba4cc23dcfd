//! Why a map file cannot be read.

use std::path::PathBuf;

use crate::FileError;

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
    /// The layout is that of another version.
    #[error("{path} has version {found} of the layout of fields, this program reads version {expected}")]
    Version {
        /// The file.
        path: PathBuf,
        /// Version in the file.
        found: u32,
        /// The version that can be read.
        expected: u32,
    },
    /// The file is shorter or longer than its header says.
    #[error("{path} should have {expected} bytes and has {found}: it was cut or something was added")]
    Length {
        /// The file.
        path: PathBuf,
        /// Bytes that the header announces; for a cut header those of a header.
        expected: u64,
        /// Bytes in the file.
        found: u64,
    },
    /// The checksum is wrong.
    #[error("{path} is damaged: its checksum is {found:08x}, expected {expected:08x}")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Checksum in the file.
        expected: u32,
        /// Checksum of the content.
        found: u32,
    },
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
