//! Why there is no map.

use mba_adjust::continuity::ContinuityError;
use mba_io::checkpoint::CheckpointError;

use crate::run::RunError;

/// Why mapping a data set stopped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MapError {
    /// The run is not one of the data set.
    #[error("the run has {run} frames and the data set {dataset}")]
    Frames {
        /// Frames of the run.
        run: usize,
        /// Frames of the data set.
        dataset: usize,
    },
    /// A frame of the run has another time than that of the data set.
    #[error("frame {index} is at {run:.6} s in the run and at {dataset:.6} s in the data set")]
    Timestamp {
        /// Index of the frame.
        index: usize,
        /// Its time in the run.
        run: f64,
        /// Its time in the data set.
        dataset: f64,
    },
    /// No frame can be used.
    #[error("no frame was tracked and can be read: {0}")]
    NoKeyframe(String),
    /// Nothing has a depth that a map could start from.
    #[error("no keyframe has any depth: the map stays empty")]
    NoDepth,
    /// The motion of the run makes no sense.
    #[error(transparent)]
    Continuity(#[from] ContinuityError),
    /// The checkpoint cannot be used or written.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// Whoever watches asked for it; a checkpoint was written.
    #[error("stopped on request")]
    Stopped,
    /// The results cannot be written.
    #[error(transparent)]
    Run(#[from] RunError),
}
