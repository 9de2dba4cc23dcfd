//! `calibration.toml`: the camera of one data set.

use std::ops::Range;
use std::path::Path;

use mba_tracker::geometry::{Distortion, PinholeCamera};
use nalgebra::Rotation3;
use serde::Deserialize;

use super::depth_camera::DepthKeys;
use super::validity::{InvalidValue, ROTATION, rotation_of};
use super::{
    Calibration, CalibrationSources, CameraFact, DatasetError, ExposureSource, Knowledge, Response, Shutter,
    Vignetting, Warning, response_table,
};
use crate::whole_file::read_text;

/// Name of the file.
pub(super) const FILE_NAME: &str = "calibration.toml";

/// The keys of the file; any other key is an error.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    width: usize,
    height: usize,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    distortion: Option<[f64; 5]>,
    depth_scale: f64,
    exposure_seconds: Option<f64>,
    frame_rate: Option<f64>,
    response: Option<String>,
    readout: Option<ReadoutKey>,
    readout_seconds: Option<f64>,
    depth_readout_seconds: Option<f64>,
    depth_delay_seconds: Option<f64>,
    depth_clock_seconds: Option<f64>,
    vignetting: Option<[f64; 2]>,
    imu_from_camera: Option<RotationKey>,
    estimated: Option<Vec<CameraFact>>,
    depth: Option<DepthKeys>,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum ReadoutKey {
    Global,
    Rolling,
}

/// Nine numbers, or three rows of three.
#[derive(Deserialize)]
#[serde(untagged, expecting = "imu_from_camera must be 9 numbers or three rows of 3")]
enum RotationKey {
    Rows([[f64; 3]; 3]),
    Flat([f64; 9]),
}

/// Reads the file at `path`. `measured_rate` (frames per second, from the timestamps) stands in for a missing
/// `frame_rate`; whatever is assumed is added to `warnings`.
///
/// `response` is `"srgb"`, `"linear"` or the name of a `.csv` or `.txt` file beside the calibration (see
/// [`response_table`]). A list of exposure times is not looked for: see [`Calibration::settle_exposure`].
pub(super) fn read(
    path: &Path,
    measured_rate: Option<f64>,
    warnings: &mut Vec<Warning>,
) -> Result<Calibration, DatasetError> {
    let text = read_text(path)?;
    let keys: Keys = toml::from_str(&text).map_err(|error| DatasetError::CalibrationSyntax {
        path: path.to_owned(),
        line: line_of(&text, error.span()),
        message: error.message().replace('\n', ", "),
    })?;
    let calibration = calibration(path, &text, keys, measured_rate, warnings)?;
    calibration.check().map_err(|invalid| invalid_value(path, &text, invalid))?;
    Ok(calibration)
}

/// The value with the line that sets its key.
pub(super) fn invalid_value(path: &Path, text: &str, invalid: InvalidValue) -> DatasetError {
    // The section of a key comes before it.
    let (section, key) = invalid.key.split_once('.').map_or((0, invalid.key), |(section, key)| {
        let opens = |line: &str| line.trim() == format!("[{section}]");
        (text.lines().position(opens).unwrap_or(0), key)
    });
    let sets_key =
        |line: &str| line.trim_start().trim_start_matches('"').split([' ', '=', '"']).next() == Some(key);
    DatasetError::CalibrationValue {
        path: path.to_owned(),
        line: text.lines().skip(section).position(sets_key).map_or(1, |index| section + index + 1),
        key: invalid.key,
        value: invalid.value,
        expected: invalid.expected,
    }
}

fn calibration(
    path: &Path,
    text: &str,
    keys: Keys,
    measured_rate: Option<f64>,
    warnings: &mut Vec<Warning>,
) -> Result<Calibration, DatasetError> {
    let located = |invalid| invalid_value(path, text, invalid);
    let camera = PinholeCamera {
        width: keys.width,
        height: keys.height,
        fx: keys.fx,
        fy: keys.fy,
        cx: keys.cx,
        cy: keys.cy,
    };
    let [k1, k2, p1, p2, k3] = keys.distortion.unwrap_or_default();
    let lens = Distortion { k1, k2, p1, p2, k3 };
    let frame_rate = keys.frame_rate.unwrap_or_else(|| assumed_rate(measured_rate, warnings));
    // What has to be there, then what may be there, each with a note of where it comes from.
    let mut calibration = Calibration::of_geometry(camera, lens, keys.depth_scale, frame_rate);
    calibration.sources = sources(&keys).map_err(located)?;
    if let Some(seconds) = keys.exposure_seconds {
        calibration.exposure = ExposureSource::Constant { seconds };
    }
    calibration.depth_camera = keys.depth.as_ref().map(DepthKeys::camera).transpose().map_err(located)?;
    calibration.readout = readout(&keys, warnings).map_err(located)?;
    calibration.response = response(path, text, keys.response, warnings)?;
    calibration.depth_readout_seconds = keys.depth_readout_seconds.unwrap_or(0.0);
    calibration.depth_delay_seconds = keys.depth_delay_seconds;
    calibration.depth_clock_seconds = keys.depth_clock_seconds.unwrap_or(0.0);
    calibration.vignetting = keys.vignetting.map_or(Vignetting::NONE, |[a2, a4]| Vignetting { a2, a4 });
    calibration.imu_from_camera = keys.imu_from_camera.map(rotation).transpose().map_err(located)?;
    Ok(calibration)
}

/// What is on record, and what the file says was estimated.
fn sources(keys: &Keys) -> Result<CalibrationSources, InvalidValue> {
    let estimated = keys.estimated.as_deref().unwrap_or_default();
    let of = |fact: CameraFact, is_given: bool| match (estimated.contains(&fact), is_given) {
        (true, true) => Ok(Knowledge::Estimated),
        // The times of the frames may stand in their own list.
        (true, false) if fact == CameraFact::Exposure => Ok(Knowledge::Estimated),
        (true, false) => Err(InvalidValue {
            key: "estimated",
            value: format!("\"{}\"", fact.name()),
            expected: "names of facts that have a value in this file",
        }),
        (false, true) => Ok(Knowledge::Recorded),
        (false, false) => Ok(Knowledge::Assumed),
    };
    Ok(CalibrationSources {
        camera: of(CameraFact::Camera, true)?,
        depth_scale: of(CameraFact::DepthScale, true)?,
        exposure: of(CameraFact::Exposure, keys.exposure_seconds.is_some())?,
        readout: of(CameraFact::Readout, keys.readout.is_some() || keys.readout_seconds.is_some())?,
        response: of(CameraFact::Response, keys.response.is_some())?,
        vignetting: of(CameraFact::Vignetting, keys.vignetting.is_some())?,
        depth_delay: of(CameraFact::DepthDelay, is_depth_timed(keys))?,
    })
}

/// Whether anything but timestamps tells when depth is measured.
fn is_depth_timed(keys: &Keys) -> bool {
    let Keys { depth_delay_seconds, depth_clock_seconds, depth_readout_seconds, .. } = keys;
    [depth_delay_seconds, depth_clock_seconds, depth_readout_seconds].into_iter().any(Option::is_some)
}

/// The readout of two keys that must not contradict each other; a time alone says that rows are exposed one after
/// the other.
fn readout(keys: &Keys, warnings: &mut Vec<Warning>) -> Result<Shutter, InvalidValue> {
    match (&keys.readout, keys.readout_seconds) {
        (Some(ReadoutKey::Rolling), seconds) => Ok(Shutter::Rolling { seconds }),
        (Some(ReadoutKey::Global), Some(seconds)) if seconds != 0.0 => Err(InvalidValue {
            key: "readout_seconds",
            value: seconds.to_string(),
            expected: "0 or nothing with readout = \"global\"",
        }),
        (Some(ReadoutKey::Global), _) | (None, Some(0.0)) => Ok(Shutter::Global),
        (None, Some(seconds)) => Ok(Shutter::Rolling { seconds: Some(seconds) }),
        (None, None) => {
            warnings.push(Warning::Assumed { key: "readout", value: "\"global\"".into() });
            Ok(Shutter::Global)
        }
    }
}

fn rotation(key: RotationKey) -> Result<Rotation3<f64>, InvalidValue> {
    let rows = match key {
        RotationKey::Flat(rows) => rows,
        RotationKey::Rows(rows) => std::array::from_fn(|index| rows[index / 3][index % 3]),
    };
    rotation_of(&rows).ok_or_else(|| InvalidValue {
        key: "imu_from_camera",
        value: format!("{rows:?}"),
        expected: ROTATION,
    })
}

fn assumed_rate(measured_rate: Option<f64>, warnings: &mut Vec<Warning>) -> f64 {
    let (rate, why) = match measured_rate {
        Some(rate) => (rate, "from the timestamps"),
        None => (30.0, "as for most cameras"),
    };
    warnings.push(Warning::Assumed { key: "frame_rate", value: format!("{rate:.2} ({why})") });
    rate
}

fn response(
    path: &Path,
    text: &str,
    name: Option<String>,
    warnings: &mut Vec<Warning>,
) -> Result<Response, DatasetError> {
    match name.as_deref() {
        Some("srgb") => Ok(Response::Srgb),
        Some("linear") => Ok(Response::Linear),
        // A table beside the calibration.
        Some(file) if file.ends_with(".csv") || file.ends_with(".txt") => {
            Ok(Response::Table(Box::new(response_table::read(&path.with_file_name(file))?)))
        }
        Some(other) => Err(invalid_value(
            path,
            text,
            InvalidValue {
                key: "response",
                value: format!("\"{other}\""),
                expected: "\"srgb\", \"linear\" or the name of a .csv or .txt table of 256 numbers",
            },
        )),
        None => {
            warnings.push(Warning::Assumed { key: "response", value: "\"srgb\"".into() });
            Ok(Response::Srgb)
        }
    }
}

/// Line, from 1, in which `span` begins.
fn line_of(text: &str, span: Option<Range<usize>>) -> usize {
    let start = span.map_or(0, |span| span.start);
    1 + text.bytes().take(start).filter(|byte| *byte == b'\n').count()
}
