//! Data sets, synthetic sequences, evaluation and offline refinement for motion-blur-aware RGB-D SLAM.

pub mod bundle;
pub mod checkpoint;
pub mod continuity;
pub mod dataset;
pub mod deblurring;
mod error;
pub mod evaluation;
pub mod exposure;
pub mod gaussians;
pub mod image_folders;
pub mod infill;
pub mod losses;
pub mod mapping;
mod png;
pub mod raster;
pub mod rendering;
pub mod run;
pub mod synth;
mod text_lines;
pub mod tracking;
pub mod trajectory_file;
mod whole_file;

pub use error::FileError;
