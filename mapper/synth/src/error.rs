//! What can be wrong with the order for a synthetic sequence.

use std::io;
use std::path::PathBuf;

use mba_io::FileError;
use mba_io::output::OutputError;

/// A synthetic sequence could not be made or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SynthError {
    /// A number of the settings is out of range.
    #[error("{setting} {value}: expected {expected}")]
    Setting {
        /// Which one.
        setting: &'static str,
        /// Its value.
        value: f64,
        /// The valid range in words.
        expected: &'static str,
    },
    /// There is no scene of this name.
    #[error("unknown scene \"{name}\"; known are room, hall and wall")]
    UnknownScene {
        /// The name asked for.
        name: String,
    },
    /// A walk from room to room in a scene that has none.
    #[error("the scene {scene} has no doors to walk through; the room has")]
    NoDoors {
        /// Its name.
        scene: &'static str,
    },
    /// A text that names no frames.
    #[error("\"{text}\" are no frames; ranges such as 10-15,20 are needed")]
    FrameRanges {
        /// The text.
        text: String,
    },
    /// Even the strongest hand shake moves the image too little while the shutter is open.
    #[error(
        "mean blur of {requested} px cannot be reached with an exposure of {exposure_seconds} s, at most \
         {reachable:.1} px; ask for less blur or a longer exposure"
    )]
    BlurOutOfReach {
        /// Mean blur asked for, pixels.
        requested: f64,
        /// Exposure time, seconds.
        exposure_seconds: f64,
        /// Largest mean blur at this exposure time, pixels.
        reachable: f64,
    },
    /// The camera's way blurs more than asked for, without any shake.
    #[error(
        "mean blur of {requested} px is less than the {least:.1} px of the camera's way alone; ask for more blur, \
         more frames or a shorter exposure"
    )]
    BlurOfTheWay {
        /// Mean blur asked for, pixels.
        requested: f64,
        /// Mean blur without hand shake, pixels.
        least: f64,
    },
    /// Whoever watches asked for it; nothing is left in the folder.
    #[error("stopped on request")]
    Stopped,
    /// The target folder has something in it.
    #[error("{folder} is not empty; name a new folder")]
    FolderNotEmpty {
        /// The folder.
        folder: PathBuf,
    },
    /// The folder must not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A text file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
}

impl SynthError {
    /// The error of a file or folder that cannot be written.
    pub(super) fn unwritable(path: impl Into<PathBuf>, reason: io::Error) -> Self {
        Self::File(FileError::Unwritable { path: path.into(), reason })
    }
}
