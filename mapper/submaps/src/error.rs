//! What can be wrong with a job.

use std::path::PathBuf;

use mba_io::FileError;
use mba_io::output::OutputError;
use mba_raster::gaussians::PlyError;
use mba_slam::mapping::MapError;
use mba_slam::run::RunError;

/// A job cannot be made, worked on or merged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SubmapError {
    /// The folder has no plan.
    #[error("{folder} is not a job: it has no submaps.json")]
    NotAJob {
        /// The folder.
        folder: PathBuf,
    },
    /// A file of the job is not what this version writes.
    #[error("{path}: {message}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong with which value.
        message: String,
    },
    /// The data set or the run is not the one that was split.
    #[error("{path}: the {what} is not the one that was split, or has changed since")]
    Changed {
        /// The file with the plan.
        path: PathBuf,
        /// `data set` or `run`.
        what: &'static str,
    },
    /// There is no such group.
    #[error("{folder} has no group {group}: there are {groups}, from 0")]
    NoSuchGroup {
        /// The job.
        folder: PathBuf,
        /// Number that was asked for.
        group: usize,
        /// Groups of the job.
        groups: usize,
    },
    /// A group was not mapped, or not to its end.
    #[error("{folder} is not mapped: it has no submap.json")]
    Missing {
        /// RUN folder of the group.
        folder: PathBuf,
    },
    /// The map of a group was made for another plan.
    #[error("{path}: {what}")]
    Foreign {
        /// The file that says so.
        path: PathBuf,
        /// To what it belongs instead.
        what: String,
    },
    /// A file of a group is not the one that was mapped.
    #[error("{path} has changed since the group was mapped")]
    Damaged {
        /// The file.
        path: PathBuf,
    },
    /// Nothing can be split.
    #[error("no frame of the run was tracked")]
    NoKeyframes,
    /// A map cannot be read.
    #[error(transparent)]
    Ply(#[from] PlyError),
    /// A group cannot be mapped.
    #[error(transparent)]
    Map(#[from] MapError),
    /// A RUN folder cannot be read or written.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The folder must not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
}
