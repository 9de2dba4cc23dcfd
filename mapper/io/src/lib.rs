//! Files of every kind: data sets and IMU recordings, trajectories, checkpoints, and where anything may be written.
//!
//! The ground floor of the mapper. `mba-mapper` re-exports what its users need.

pub mod binary_file;
pub mod checkpoint;
pub mod dataset;
mod error;
pub mod file_kind;
pub mod imu;
pub mod output;
pub mod ply;
pub mod png;
mod pose_matrix;
pub mod run_layout;
pub mod statistics;
pub mod text_lines;
pub mod trajectory_file;
pub mod whole_file;

pub use error::FileError;

pub use binary_file::BinaryFileError;
