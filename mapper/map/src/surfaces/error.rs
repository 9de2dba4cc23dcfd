//! Why a surface cannot be made.

/// A surface cannot be made with these settings.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceError {
    /// The grid would take more memory than allowed.
    #[error("voxels of {:.3} cm need more than {limit_mb} MB for a grid of this scene", 100.0 * voxel)]
    TooFine {
        /// Edge of a voxel, metres.
        voxel: f64,
        /// Memory that a grid may take, megabytes.
        limit_mb: usize,
    },
    /// A setting is out of its range.
    #[error("{name} is {value}, expected {expected}")]
    Setting {
        /// The setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        expected: &'static str,
    },
}
