//! The RUN folder: what commands hand to each other.
//!
//! | file | content |
//! |---|---|
//! | `trajectory.txt` | camera-to-world at mid exposure, every input frame once, TUM lines |
//! | `exposures.txt` | camera-to-world at opening, middle and closing of the shutter |
//! | `covariances.txt` | covariance of the pose at mid exposure, of tracked runs, see [`TrackRecord::set_covariances`] |
//! | `frames.csv` | one [`FrameRecord`] per frame |
//! | `summary.json` | a [`Summary`] |
//! | `map.ply` | a map of Gaussians, see [`mba_raster::gaussians::read_ply`], with [colours and sizes for viewers](for_viewers), or |
//! | `map.mbaf` | a map that is a tri-plane field, see [`mba_field::triplane::read_field`] |
//! | `deblurred/NNNNNN.png` | the deblurred image of every keyframe, named by the index of the frame |
//!
//! A file is written beside its place and then renamed, so a reader sees an old or a new version, never half of one.

mod camera;
mod covariances;
mod deblurred_keyframes;
mod earlier_images;
mod error;
mod frame_record;
mod keyframe_images;
mod merit;
mod orientation;
mod reader;
mod rows;
mod stored_path;
mod summary;
mod track_record;
mod upright;
mod viewing;
mod writer;

pub use camera::{RunCamera, RunResponse};
pub use deblurred_keyframes::write_deblurred_keyframes;
pub use error::RunError;
pub use frame_record::{FrameRecord, Reason};
pub use merit::{Merit, mid_pose, plausibility, trajectory_figures};
pub use orientation::{start_view, up_direction};
pub use reader::Run;
pub use rows::RunRows;
pub use stored_path::{path_of, stored_path};
pub use summary::{FrameCounts, LocalisationFigures, MapFigures, RunSettings, SlamFigures, Spread, Summary};
pub use track_record::TrackRecord;
pub use upright::{UpSource, Upright};
pub use viewing::{for_viewers, is_own_splats};
pub use writer::RunWriter;

/// How far the pose of a frame can be trusted, as the tracker says it.
pub use mba_tracker::FrameStatus;

pub use mba_io::run_layout::{
    CHECKPOINT_FILE, COVARIANCES_FILE, DEBLURRED_FOLDER, DEPTH_FOLDER, EXPOSURES_FILE, FRAMES_FILE,
    SUMMARY_FILE, TRAJECTORY_FILE, deblurred_path,
};
