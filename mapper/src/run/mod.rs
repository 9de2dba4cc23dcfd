//! The RUN folder: what commands hand to each other.
//!
//! | file | content |
//! |---|---|
//! | `trajectory.txt` | camera-to-world at mid exposure, every input frame once, TUM lines |
//! | `exposures.txt` | camera-to-world at opening, middle and closing of the shutter |
//! | `frames.csv` | one [`FrameRecord`] per frame |
//! | `summary.json` | a [`Summary`] |
//! | `map.ply` | a map of Gaussians, see [`crate::gaussians::read_ply`], or |
//! | `map.mbaf` | a map that is a tri-plane field, see [`crate::triplane::read_field`] |
//! | `deblurred/NNNNNN.png` | the deblurred image of every keyframe, named by the index of the frame |
//!
//! A file is written beside its place and then renamed, so a reader sees an old or a new version, never half of one.

mod camera;
mod deblurred_keyframes;
mod error;
mod frame_record;
mod keyframe_images;
mod merit;
mod reader;
mod rows;
mod summary;
mod writer;

pub use camera::{RunCamera, RunResponse};
pub use deblurred_keyframes::write_deblurred_keyframes;
pub use error::RunError;
pub use frame_record::{FrameRecord, FrameStatus, Reason};
pub use keyframe_images::{DEBLURRED_FOLDER, DEPTH_FOLDER, deblurred_path};
pub use merit::{Merit, mid_pose, trajectory_figures};
pub use reader::Run;
pub(crate) use reader::is_run;
pub(crate) use rows::RunRows;
pub use summary::{FrameCounts, MapFigures, RunSettings, SlamFigures, Spread, Summary};
pub use writer::RunWriter;

/// Name of the trajectory at mid exposure.
pub const TRAJECTORY_FILE: &str = "trajectory.txt";
/// Name of the poses at opening, middle and closing of the shutter.
pub const EXPOSURES_FILE: &str = "exposures.txt";
/// Name of the table of frames.
pub const FRAMES_FILE: &str = "frames.csv";
/// Name of the summary.
pub const SUMMARY_FILE: &str = "summary.json";
/// Name of what a run that was stopped goes on from.
pub const CHECKPOINT_FILE: &str = "checkpoint";
