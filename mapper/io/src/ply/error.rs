//! What can be wrong with a PLY file.

use std::path::PathBuf;

use crate::FileError;

/// A PLY file cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlyError {
    /// The file cannot be opened.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file does not start like a PLY file.
    #[error("{path} is not a PLY file: its first line is not \"ply\"")]
    NotPly {
        /// The file.
        path: PathBuf,
    },
    /// A line of the header makes no sense.
    #[error("{path}, header line {line}: expected {expected}, found \"{found}\"")]
    Header {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What should be there.
        expected: &'static str,
        /// The line.
        found: String,
    },
    /// A property is missing that every file of this kind has.
    #[error("{path}: the {records} have no property \"{name}\", so this is not {kind}")]
    MissingProperty {
        /// The file.
        path: PathBuf,
        /// What lacks it, in the plural.
        records: &'static str,
        /// The property.
        name: &'static str,
        /// What the file was to be.
        kind: &'static str,
    },
    /// The file ends before its last record.
    #[error("{path}: the header announces {announced} {records}, the file ends after {found}")]
    Truncated {
        /// The file.
        path: PathBuf,
        /// What there are too few of.
        records: String,
        /// Their number according to the header.
        announced: u64,
        /// Complete ones.
        found: u64,
    },
    /// A value is not a finite number.
    #[error("{path}, {element} {index}: {property} is \"{found}\", which is not a finite number")]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// What has the value.
        element: String,
        /// Which one, from 0.
        index: u64,
        /// The property.
        property: String,
        /// The value.
        found: String,
    },
    /// A face has a corner that is no vertex.
    #[error("{path}, face {face}: corner \"{found}\" is none of the {vertices} vertices")]
    NoSuchVertex {
        /// The file.
        path: PathBuf,
        /// Face, from 0.
        face: u64,
        /// The corner.
        found: f64,
        /// Number of vertices.
        vertices: usize,
    },
}
