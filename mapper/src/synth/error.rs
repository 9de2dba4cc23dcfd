//! What can go wrong while a sequence is synthesised.

use std::path::PathBuf;

use crate::FileError;

/// A sequence cannot be synthesised or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SynthError {
    /// There is no scene of this name.
    #[error("there is no scene \"{name}\"; choose room, hall, desk or wall")]
    UnknownScene {
        /// The name.
        name: String,
    },
    /// A setting is out of range.
    #[error("the {setting} is {value}, expected {expected}")]
    Setting {
        /// The setting.
        setting: &'static str,
        /// Its value.
        value: f64,
        /// What it should be.
        expected: &'static str,
    },
    /// The blur would need a shake that leaves the scene.
    #[error(
        "a mean blur of {requested} pixels within {exposure_seconds} s needs a shake of {needed:.1} rad/s, at most \
         10 is possible; use a longer exposure or less blur"
    )]
    BlurOutOfReach {
        /// Mean blur asked for, pixels.
        requested: f64,
        /// Exposure time, seconds.
        exposure_seconds: f64,
        /// Rms angular rate that would be needed, rad/s.
        needed: f64,
    },
    /// The output folder has something in it.
    #[error("{folder} is not empty; name a new folder or remove it first")]
    FolderNotEmpty {
        /// The folder.
        folder: PathBuf,
    },
    /// A file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
}
