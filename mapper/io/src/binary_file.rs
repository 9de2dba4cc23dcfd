//! What every binary file with a version, a length and a checksum is tested for.

use std::path::{Path, PathBuf};

/// A binary file is not of this version, or not as it was written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BinaryFileError {
    /// The layout is that of another version.
    #[error("{path} has version {found} of {layout}, this program reads version {expected}")]
    Version {
        /// The file.
        path: PathBuf,
        /// What has the versions.
        layout: &'static str,
        /// Version in the file.
        found: u32,
        /// The version that can be read.
        expected: u32,
    },
    /// The file is shorter or longer than it should be.
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
}

/// Checks the version that was `found` in a file.
pub fn check_version(
    path: &Path,
    layout: &'static str,
    expected: u32,
    found: u32,
) -> Result<(), BinaryFileError> {
    if found == expected {
        return Ok(());
    }
    Err(BinaryFileError::Version { path: path.to_owned(), layout, found, expected })
}

/// Checks the number of bytes of a file.
pub fn check_length(path: &Path, expected: u64, found: u64) -> Result<(), BinaryFileError> {
    if found == expected {
        return Ok(());
    }
    Err(BinaryFileError::Length { path: path.to_owned(), expected, found })
}

/// Checks the checksum of what a file holds against the one that it names.
pub fn check_checksum(path: &Path, expected: u32, found: u32) -> Result<(), BinaryFileError> {
    if found == expected {
        return Ok(());
    }
    Err(BinaryFileError::Damaged { path: path.to_owned(), expected, found })
}
