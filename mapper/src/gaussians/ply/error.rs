//! What can be wrong with a file of Gaussians.

use std::io;
use std::path::PathBuf;

/// A file of Gaussians cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlyError {
    /// The file cannot be read.
    #[error("cannot read {path}: {reason}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        reason: io::Error,
    },
    /// The file cannot be written; an older version of it is still there.
    #[error("cannot write {path}: {reason}")]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        reason: io::Error,
    },
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
    /// The vertices lack a property that every file of Gaussians has.
    #[error("{path}: the vertices have no property \"{name}\", so this is not a file of Gaussians")]
    MissingProperty {
        /// The file.
        path: PathBuf,
        /// The property.
        name: &'static str,
    },
    /// The file ends before its last vertex.
    #[error("{path}: the header announces {announced} vertices, the file ends after {found}")]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Vertices according to the header.
        announced: u64,
        /// Complete vertices.
        found: u64,
    },
    /// A value is not a finite number.
    #[error("{path}, vertex {vertex}: {property} is \"{found}\", which is not a finite number")]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// Vertex, from 0.
        vertex: u64,
        /// The property.
        property: &'static str,
        /// The value.
        found: String,
    },
}
