//! The camera of the ETH3D SLAM benchmark (Schops et al., CVPR 2019), whose sequences otherwise have the layout of TUM:
//! `calibration.txt` with `fx fy cx cy`.

use std::path::Path;

use mba_tracker::geometry::{Distortion, PinholeCamera};

use super::frame::header;
use super::known_cameras::TUM_DEPTH_SCALE;
use super::sequence::{FrameEntry, frames_per_second};
use super::validity::{InvalidValue, check_camera};
use super::{Calibration, DatasetError, Knowledge};
use crate::text_lines::TextFile;

/// Name of the file.
pub(super) const FILE_NAME: &str = "calibration.txt";

/// Frames per second of the camera.
const FRAME_RATE: f64 = 27.1;

/// Reads the file at `path`. Images are rectified and of a global shutter; their size is that of the first that can be read.
pub(super) fn read(path: &Path, entries: &[FrameEntry]) -> Result<Calibration, DatasetError> {
    const EXPECTED: &str = "fx fy cx cy";
    let file = TextFile::read(path)?;
    let numbers = file.lines().next().map(|line| line.numbers(EXPECTED)).transpose()?;
    let [fx, fy, cx, cy] = numbers.ok_or_else(|| DatasetError::EmptyList { path: path.to_owned() })?;
    let size = entries.iter().find_map(|entry| header(&entry.colour)).map(|header| header.shown());
    let (width, height) = size.unwrap_or_default();
    let camera = PinholeCamera { width, height, fx, fy, cx, cy };
    check_camera(&camera).map_err(|InvalidValue { key, value, expected }| {
        DatasetError::CalibrationValue { path: path.to_owned(), line: 1, key, value, expected }
    })?;
    let times: Vec<f64> = entries.iter().map(|entry| entry.timestamp).collect();
    let rate = frames_per_second(&times).unwrap_or(FRAME_RATE);
    let mut calibration = Calibration::of_geometry(camera, Distortion::default(), TUM_DEPTH_SCALE, rate);
    calibration.sources.readout = Knowledge::Recorded;
    Ok(calibration)
}
