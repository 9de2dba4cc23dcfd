//! The Replica sequences rendered for NICE-SLAM (Zhu et al., CVPR 2022): `results/frame000000.jpg`,
//! `results/depth000000.png`, one 4x4 camera-to-world matrix per line of `traj.txt`, and `cam_params.json` in
//! the folder or the one above.

use std::path::{Path, PathBuf};

use mba_tracker::geometry::{Distortion, PinholeCamera};
use serde::Deserialize;

use super::numbered_images::{self, ImageFolder};
use super::sequence::{Contents, FrameEntry};
use super::validity::InvalidValue;
use super::{Calibration, DatasetError, Knowledge, TimedPose, Warning, calibration_file};
use crate::FileError;
use crate::pose_matrix::pose_from_rows;
use crate::text_lines::TextFile;
use crate::whole_file::read_text;

const TRAJECTORY: &str = "traj.txt";
const IMAGES: &str = "results";
const CAMERA: &str = "cam_params.json";

/// Frames per second that are assumed: the files have no times.
const FRAME_RATE: f64 = 30.0;

#[derive(Deserialize)]
struct CameraFile {
    camera: CameraKeys,
}

#[derive(Deserialize)]
struct CameraKeys {
    w: usize,
    h: usize,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    scale: f64,
}

/// Whether `folder` looks like this layout.
pub(super) fn recognise(folder: &Path) -> bool {
    folder.join(TRAJECTORY).is_file() && folder.join(IMAGES).is_dir()
}

/// Reads images, camera and trajectory. A `calibration.toml` in the folder takes the place of the camera file.
pub(super) fn read(folder: &Path) -> Result<Contents, DatasetError> {
    let mut warnings = Vec::new();
    // What the user wrote comes before what the benchmark has.
    let own_calibration = folder.join(calibration_file::FILE_NAME);
    let mut calibration = if own_calibration.is_file() {
        calibration_file::read(&own_calibration, None, &mut warnings)?
    } else {
        read_camera(&camera_path(folder))?
    };
    calibration.settle_exposure(false);
    let images = folder.join(IMAGES);
    let colour = ImageFolder { path: &images, prefix: "frame" };
    let depth = ImageFolder { path: &images, prefix: "depth" };
    let numbered = numbered_images::pair(&colour, &depth, calibration.frame_rate, &mut warnings)?;
    let ground_truth = read_poses(&folder.join(TRAJECTORY), &numbered, &mut warnings)?;
    Ok(Contents {
        calibration,
        colour_camera: None,
        entries: numbered.into_iter().map(|(_, entry)| entry).collect(),
        ground_truth,
        ground_truth_exposures: Vec::new(),
        warnings,
    })
}

/// In the folder itself, else in the one above.
fn camera_path(folder: &Path) -> PathBuf {
    let beside = folder.join(CAMERA);
    if beside.is_file() {
        return beside;
    }
    let absolute = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    absolute.parent().map_or(beside, |above| above.join(CAMERA))
}

fn read_camera(path: &Path) -> Result<Calibration, DatasetError> {
    let text = read_text(path)?;
    let CameraFile { camera } = serde_json::from_str(&text).map_err(|error| {
        let message = error.to_string();
        DatasetError::CalibrationSyntax {
            path: path.to_owned(),
            line: error.line(),
            message: message.split(" at line ").next().unwrap_or_default().to_owned(),
        }
    })?;
    let CameraKeys { w: width, h: height, fx, fy, cx, cy, scale } = camera;
    let camera = PinholeCamera { width, height, fx, fy, cx, cy };
    let mut calibration = Calibration::of_geometry(camera, Distortion::default(), scale, FRAME_RATE);
    // The images are rendered.
    calibration.sources.readout = Knowledge::Recorded;
    let own_key = |invalid: InvalidValue| {
        let key = match invalid.key {
            "width" => "w",
            "height" => "h",
            "depth_scale" => "scale",
            other => other,
        };
        calibration_file::invalid_value(path, &text, InvalidValue { key, ..invalid })
    };
    calibration.check().map_err(own_key)?;
    Ok(calibration)
}

/// The pose of each frame: line n belongs to image number n.
fn read_poses(
    path: &Path,
    numbered: &[(usize, FrameEntry)],
    warnings: &mut Vec<Warning>,
) -> Result<Vec<TimedPose>, DatasetError> {
    const EXPECTED: &str = "the 16 numbers of a 4x4 camera-to-world matrix, row by row";
    let file = TextFile::read(path)?;
    let poses = file
        .lines()
        .map(|line| pose_from_rows(&line.numbers(EXPECTED)?, path, line.number))
        .collect::<Result<Vec<_>, FileError>>()?;
    let timed = |(number, entry): &(usize, FrameEntry)| {
        Some(TimedPose { timestamp: entry.timestamp, world_from_camera: *poses.get(*number)? })
    };
    let mut beyond = numbered.iter().filter(|(number, _)| *number >= poses.len());
    if let Some((_, first)) = beyond.next() {
        let (count, first) = (1 + beyond.count(), first.colour.clone());
        warnings.push(Warning::PosesMissing { count, first });
    }
    Ok(numbered.iter().filter_map(timed).collect())
}
