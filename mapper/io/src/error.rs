//! What can be wrong with a file of numbers.

use std::io;
use std::path::PathBuf;

/// A text file could not be read or written, or one of its lines makes no sense.
///
/// Every message names the file, the line (counted from 1) and the value in one sentence.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// The file or folder cannot be read.
    #[error("cannot read {path}: {reason}")]
    Unreadable {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system says.
        reason: io::Error,
    },
    /// The path leads to something without a known end.
    #[error("cannot read {path}: it is a {kind}, not a file")]
    NotAFile {
        /// The path.
        path: PathBuf,
        /// What it is, in a word.
        kind: &'static str,
    },
    /// A text is not in UTF-8.
    #[error("{path} is in {encoding}, expected UTF-8")]
    Encoding {
        /// The file.
        path: PathBuf,
        /// What it is in, as far as that is known.
        encoding: String,
    },
    /// The file is larger than any that makes sense.
    #[error("cannot read {path}: the file has {bytes} bytes, the most that is read is {limit}")]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        bytes: u64,
        /// The largest size of a file of this kind.
        limit: u64,
    },
    /// The file cannot be written, for example because the disk is full; an older version of it is still there.
    #[error("cannot write {path}: {reason}")]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        reason: io::Error,
    },
    /// A line does not have the expected form.
    #[error("{path}, line {line}: expected {expected}, found \"{found}\"")]
    MalformedLine {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// The offending text.
        found: String,
        /// The form that the line should have.
        expected: &'static str,
    },
    /// A number is infinite or not a number.
    #[error("{path}, line {line}: {value} is not a finite number")]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// The offending text.
        value: String,
    },
    /// The quaternion of a pose is not of unit length.
    #[error(
        "{path}, line {line}: the quaternion has length {norm:.4}, expected 1; \
         the order of a pose is tx ty tz qx qy qz qw"
    )]
    NotUnitQuaternion {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Length of the quaternion.
        norm: f64,
    },
    /// The rotation part of a pose matrix is not a rotation.
    #[error("{path}, line {line}: the 3x3 block is not a rotation (R R^T differs from I by {deviation:.4})")]
    NotRotation {
        /// The file.
        path: PathBuf,
        /// Line of the matrix's first row, from 1.
        line: usize,
        /// Largest element of `|R R^T - I|`, or infinity for a reflection.
        deviation: f64,
    },
    /// A timestamp is smaller than the one before.
    #[error(
        "{path}, line {line}: timestamp {timestamp} comes after {previous}; sort the lines by time, \
         or move the file away if it is not needed"
    )]
    TimestampOrder {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// The offending timestamp.
        timestamp: f64,
        /// The timestamp before it.
        previous: f64,
    },
    /// A timestamp occurs twice.
    #[error("{path}, line {line}: timestamp {timestamp} occurs twice; remove one of the lines")]
    TimestampDoubled {
        /// The file.
        path: PathBuf,
        /// Line of the second occurrence, from 1.
        line: usize,
        /// The offending timestamp.
        timestamp: f64,
    },
}
