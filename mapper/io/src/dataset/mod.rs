//! Recorded RGB-D sequences: which layout a folder has, what its camera is, and its frames one by one.
//!
//! The native layout is that of the TUM RGB-D benchmark plus a `calibration.toml`; the sequences of that
//! benchmark, of Bonn and of ETH3D, Replica as rendered for NICE-SLAM and ScanNet exports are read as they are. Timestamps are those of
//! mid exposure of the middle of the image; depth images have their own. Poses are `world_from_camera`.
//!
//! ```no_run
//! let dataset = mba_io::dataset::open(std::path::Path::new("my_sequence"))?;
//! for index in 0..dataset.len() {
//!     match dataset.frame(index) {
//!         Ok(frame) => println!("{} {}x{}", frame.timestamp, frame.width, frame.height),
//!         Err(error) => eprintln!("skipping frame {index}: {error}"),
//!     }
//! }
//! # Ok::<(), mba_io::dataset::DatasetError>(())
//! ```

mod association;
mod calibration;
mod calibration_file;
mod calibration_text;
mod depth_camera;
mod depth_view;
mod error;
mod eth3d;
mod exposure_list;
mod frame;
mod image_source;
mod jpeg_scan;
mod knowledge;
mod known_cameras;
mod numbered_images;
mod options;
mod replica;
mod response_table;
mod scannet;
mod sequence;
mod survey;
mod tum;
mod usable_depth;
mod validity;
mod vignetting;

use std::fs;
use std::path::Path;

use mba_tracker::photometric::InverseResponse;

use crate::FileError;
pub use crate::trajectory_file::{TimedExposure, TimedPose};
pub use calibration::{
    ASSUMED_EXPOSURE_SHARE, Calibration, ExposureSource, LONGEST_ASSUMED_EXPOSURE, Response, Shutter,
    assumed_exposure_seconds,
};
pub use calibration_text::write_calibration;
pub use depth_camera::DepthCamera;
pub use error::{DatasetError, FrameReadError, Warning};
pub use exposure_list::{read_exposure_times, write_exposure_times};
pub use frame::RgbdFrame;
pub use frame::read_image;
pub use knowledge::{CalibrationSources, CameraFact, Knowledge};
pub use mba_tracker::photometric::Vignetting;
pub use options::OpenOptions;
pub use response_table::to_text as response_text;
pub use sequence::Dataset;
pub use survey::{Survey, survey};
pub(crate) use validity::MAX_PIXELS;
pub use validity::{InvalidValue, check_camera, check_positive};

/// Opens the data set in `folder` with default options: recognises the layout, reads lists, calibration and
/// ground truth, but no images.
///
/// # Errors
///
/// [`DatasetError`] if the folder is unreadable or of no known layout, or if lists, calibration or ground truth
/// make no sense. What is merely odd ends up in [`Dataset::warnings`].
pub fn open(folder: &Path) -> Result<Dataset, DatasetError> {
    open_with(folder, &OpenOptions::default())
}

/// Whether `folder` looks like a data set: it has the lists or folders by which a layout is recognised.
#[must_use]
pub fn is_data_set(folder: &Path) -> bool {
    tum::recognise(folder) || replica::recognise(folder) || scannet::recognise(folder)
}

/// As [`open`], with options.
///
/// # Errors
///
/// As [`open`].
pub fn open_with(folder: &Path, options: &OpenOptions) -> Result<Dataset, DatasetError> {
    fs::read_dir(folder).map_err(|reason| FileError::Unreadable { path: folder.to_owned(), reason })?;
    let contents = if tum::recognise(folder) {
        tum::read(folder, options)?
    } else if replica::recognise(folder) {
        replica::read(folder)?
    } else if scannet::recognise(folder) {
        scannet::read(folder)?
    } else {
        return Err(DatasetError::UnknownLayout { folder: folder.to_owned() });
    };
    Dataset::new(folder, contents, options.simd)
}

/// Reads a calibration file by itself, without exposure times of its frames.
///
/// # Errors
///
/// [`DatasetError`] if it is unreadable, malformed or absurd.
pub fn read_calibration(path: &Path) -> Result<Calibration, DatasetError> {
    let mut calibration = calibration_file::read(path, None, &mut Vec::new())?;
    calibration.settle_exposure(false);
    Ok(calibration)
}

/// Reads a measured response: 256 increasing numbers, the light of each code, or rows under the header `light,value`
/// that sample what is stored for some light.
///
/// # Errors
///
/// [`FileError`] if the file is unreadable or no response.
pub fn read_response(path: &Path) -> Result<InverseResponse, FileError> {
    response_table::read(path)
}
