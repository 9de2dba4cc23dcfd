//! Why SLAM stopped.

use mba_io::checkpoint::CheckpointError;

use crate::mapping::MapError;
use crate::run::RunError;
use crate::tracking::TrackingError;

/// Why [`run_slam`](super::run_slam) stopped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SlamError {
    /// The tracker cannot work.
    #[error(transparent)]
    Tracking(#[from] TrackingError),
    /// There is no map.
    #[error(transparent)]
    Map(#[from] MapError),
    /// The checkpoint cannot be used or written.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// A keyframe of a run that was stopped cannot be read any more.
    #[error("keyframe {index} of the stopped run cannot be used: {reason}")]
    Keyframe {
        /// Index of the frame in the data set.
        index: usize,
        /// Why.
        reason: String,
    },
    /// Whoever watches asked for it; the folder is up to date.
    #[error("stopped on request")]
    Stopped,
    /// The results cannot be written.
    #[error(transparent)]
    Run(#[from] RunError),
}
