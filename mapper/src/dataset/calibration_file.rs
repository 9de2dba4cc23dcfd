//! `calibration.toml`: the camera of one data set.

use std::ops::Range;
use std::path::Path;

use mba_tracker::geometry::{Distortion, PinholeCamera};
use mba_tracker::photometric::InverseResponse;
use serde::Deserialize;

use super::calibration::{ASSUMED_EXPOSURE_SHARE, InvalidValue};
use super::{Calibration, DatasetError, ExposureSource, Readout, Response, Warning};
use crate::FileError;
use crate::text_lines::TextFile;
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
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum ReadoutKey {
    Global,
    Rolling,
}

/// Reads the file at `path`. `measured_rate` (frames per second, from the timestamps) stands in for a missing
/// `frame_rate`; whatever is assumed is added to `warnings`.
///
/// `response` is `"srgb"`, `"linear"` or the name of a `.csv` or `.txt` file beside the calibration with 256
/// increasing numbers: the linear light of each code, in any unit.
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
    let sets_key = |line: &str| {
        line.trim_start().trim_start_matches('"').split([' ', '=', '"']).next() == Some(invalid.key)
    };
    DatasetError::CalibrationValue {
        path: path.to_owned(),
        line: text.lines().position(sets_key).map_or(1, |index| index + 1),
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
    let Keys { width, height, fx, fy, cx, cy, .. } = keys;
    let [k1, k2, p1, p2, k3] = keys.distortion.unwrap_or_default();
    let frame_rate = keys.frame_rate.unwrap_or_else(|| assumed_rate(measured_rate, warnings));
    let exposure = match keys.exposure_seconds {
        Some(seconds) => ExposureSource::Constant { seconds },
        None => ExposureSource::Assumed { seconds: ASSUMED_EXPOSURE_SHARE / frame_rate },
    };
    let readout = match keys.readout {
        Some(ReadoutKey::Global) => Readout::Global,
        Some(ReadoutKey::Rolling) => Readout::Rolling,
        None => {
            warnings.push(Warning::Assumed { key: "readout", value: "\"global\"".into() });
            Readout::Global
        }
    };
    Ok(Calibration {
        camera: PinholeCamera { width, height, fx, fy, cx, cy },
        distortion: Distortion { k1, k2, p1, p2, k3 },
        depth_scale: keys.depth_scale,
        exposure,
        frame_rate,
        response: response(path, text, keys.response, warnings)?,
        readout,
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
        Some(file) if file.ends_with(".csv") || file.ends_with(".txt") => {
            Ok(read_response_table(&path.with_file_name(file))?)
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

/// Reads 256 increasing numbers, separated by white space, commas or line ends, and scales the last to 1.
fn read_response_table(path: &Path) -> Result<Response, FileError> {
    const EXPECTED: &str = "256 increasing numbers, not negative: the linear light of the codes 0 to 255";
    let file = TextFile::read(path)?;
    let mut values: Vec<f32> = Vec::with_capacity(256);
    let mut last_line = 1;
    for line in file.lines() {
        for field in line.fields() {
            let value = line.number(field, EXPECTED)? as f32;
            let increases = values.last().is_none_or(|previous| value > *previous);
            if !increases || value < 0.0 || values.len() == 256 {
                return Err(line.malformed(EXPECTED));
            }
            values.push(value);
        }
        last_line = line.number;
    }
    let table = values.as_slice().try_into().ok().and_then(InverseResponse::from_table);
    table.map(|table| Response::Table(Box::new(table))).ok_or_else(|| FileError::MalformedLine {
        path: path.to_owned(),
        line: last_line,
        found: format!("{} numbers", values.len()),
        expected: EXPECTED,
    })
}

/// Line, from 1, in which `span` begins.
fn line_of(text: &str, span: Option<Range<usize>>) -> usize {
    let start = span.map_or(0, |span| span.start);
    1 + text.bytes().take(start).filter(|byte| *byte == b'\n').count()
}
