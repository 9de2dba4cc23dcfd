//! Sequences exported from ScanNet (Dai et al., CVPR 2017): `color/0.jpg`, `depth/0.png`, `pose/0.txt` and
//! `intrinsic/intrinsic_{color,depth}.txt`, all 4x4 matrices.
//!
//! Colour is resampled to the smaller depth images; both cameras are at the same place in these exports.

use std::path::Path;

use mba_tracker::geometry::{Distortion, PinholeCamera};

use super::frame::header;
use super::numbered_images::{self, ImageFolder};
use super::sequence::{Contents, FrameEntry};
use super::validity::{InvalidValue, check_camera};
use super::{Calibration, DatasetError, TimedPose, Warning};
use crate::FileError;
use crate::pose_matrix::pose_from_rows;
use crate::text_lines::TextFile;

const FOLDERS: [&str; 4] = ["color", "depth", "pose", "intrinsic"];

/// Frames per second of the recordings.
const FRAME_RATE: f64 = 30.0;

/// Depth is in millimetres.
const DEPTH_SCALE: f64 = 1000.0;

/// Whether `folder` looks like this layout.
pub(super) fn recognise(folder: &Path) -> bool {
    FOLDERS.iter().all(|name| folder.join(name).is_dir())
}

/// Reads images, intrinsics and poses.
pub(super) fn read(folder: &Path) -> Result<Contents, DatasetError> {
    let mut warnings = Vec::new();
    let [colour, depth, poses, intrinsics] = FOLDERS.map(|name| folder.join(name));
    let numbered = numbered_images::pair(
        &ImageFolder { path: &colour, prefix: "" },
        &ImageFolder { path: &depth, prefix: "" },
        FRAME_RATE,
        &mut warnings,
    )?;
    let colour_images = numbered.iter().map(|(_, entry)| entry.colour.as_path());
    let depth_images = numbered.iter().map(|(_, entry)| entry.depth.as_path());
    // Colour has another camera; it is resampled to that of depth.
    let colour_camera = read_camera(&intrinsics.join("intrinsic_color.txt"), colour_images)?;
    let camera = read_camera(&intrinsics.join("intrinsic_depth.txt"), depth_images)?;
    let ground_truth = read_poses(&poses, &numbered, &mut warnings)?;
    Ok(Contents {
        calibration: Calibration::of_geometry(camera, Distortion::default(), DEPTH_SCALE, FRAME_RATE)
            .rolling(),
        colour_camera: Some(colour_camera),
        entries: numbered.into_iter().map(|(_, entry)| entry).collect(),
        ground_truth,
        ground_truth_exposures: Vec::new(),
        warnings,
    })
}

/// The camera of a matrix file; its size is that of the first readable image.
fn read_camera<'a>(
    path: &Path,
    mut images: impl Iterator<Item = &'a Path>,
) -> Result<PinholeCamera, DatasetError> {
    let matrix = read_matrix(path)?;
    let (width, height) = images.find_map(header).map_or((0, 0), |header| header.shown());
    let camera = PinholeCamera { width, height, fx: matrix[0], fy: matrix[5], cx: matrix[2], cy: matrix[6] };
    let located = |InvalidValue { key, value, expected }| DatasetError::CalibrationValue {
        path: path.to_owned(),
        line: if matches!(key, "fy" | "cy") { 2 } else { 1 },
        key,
        value,
        expected,
    };
    check_camera(&camera).map_err(located)?;
    Ok(camera)
}

/// Reads each frame's pose; frames that the recording could not localise have infinite numbers or no file.
fn read_poses(
    folder: &Path,
    numbered: &[(usize, FrameEntry)],
    warnings: &mut Vec<Warning>,
) -> Result<Vec<TimedPose>, DatasetError> {
    let mut poses = Vec::with_capacity(numbered.len());
    let mut missing = Vec::new();
    for (number, entry) in numbered {
        let path = folder.join(format!("{number}.txt"));
        if !path.is_file() {
            missing.push(path);
            continue;
        }
        match read_matrix(&path) {
            Ok(rows) => poses.push(TimedPose {
                timestamp: entry.timestamp,
                world_from_camera: pose_from_rows(&rows, &path, 1)?,
            }),
            Err(FileError::NotFinite { .. }) => missing.push(path),
            Err(error) => return Err(error.into()),
        }
    }
    // Frames that the benchmark could not place have infinite poses.
    let count = missing.len();
    if let Some(first) = missing.into_iter().next() {
        warnings.push(Warning::PosesMissing { count, first });
    }
    Ok(poses)
}

/// Four lines of four finite numbers.
fn read_matrix(path: &Path) -> Result<[f64; 16], FileError> {
    const EXPECTED: &str = "four lines of four numbers";
    let file = TextFile::read(path)?;
    let mut rows = Vec::with_capacity(16);
    for line in file.lines() {
        rows.extend(line.numbers::<4>(EXPECTED)?);
    }
    rows.try_into().map_err(|rows: Vec<f64>| FileError::MalformedLine {
        path: path.to_owned(),
        line: rows.len() / 4,
        found: format!("{} numbers", rows.len()),
        expected: EXPECTED,
    })
}
