//! Why SLAM stopped.

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
    /// Whoever watches asked for it; the folder is up to date.
    #[error("stopped on request")]
    Stopped,
    /// The results cannot be written.
    #[error(transparent)]
    Run(#[from] RunError),
}
