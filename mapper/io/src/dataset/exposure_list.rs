//! `exposures.csv`: the exposure time of each frame of a camera that chooses it by itself.

use std::path::Path;

use super::association::associate;
use super::calibration::check_exposure;
use super::sequence::FrameEntry;
use super::{Calibration, DatasetError, Warning};
use crate::FileError;
use crate::text_lines::{Line, TextFile};
use crate::whole_file::write_text;

const FILE_NAME: &str = "exposures.csv";
const HEADER: &str = "a header line with the columns timestamp and exposure_s";
const ROW: &str = "a row with a timestamp and a positive exposure_s in seconds";
const PLAUSIBLE: &str = "an exposure_s of 0.000001 to 1 seconds (16 ms are 0.016)";

/// Gives each entry the exposure time of the row closest in time, at most half a frame interval away, or else the
/// one of the calibration. Returns whether there is such a file.
pub(super) fn read(
    folder: &Path,
    entries: &mut [FrameEntry],
    calibration: &Calibration,
    warnings: &mut Vec<Warning>,
) -> Result<bool, DatasetError> {
    let path = folder.join(FILE_NAME);
    if !path.is_file() {
        return Ok(false);
    }
    let (times, exposures) = read_exposure_times(&path)?;
    let frame_times: Vec<f64> = entries.iter().map(|entry| entry.timestamp).collect();
    // Half an interval: no row can belong to two frames.
    for (frame, row) in associate(&frame_times, &times, 0.5 / calibration.frame_rate) {
        entries[frame].exposure_seconds = Some(exposures[row]);
    }
    // Frames without a row get the time of the calibration, and the user is told how many.
    let mut missing = entries.iter_mut().filter(|entry| entry.exposure_seconds.is_none()).peekable();
    if let Some(first) = missing.peek().map(|entry| entry.timestamp) {
        let fallback = calibration.fallback_exposure_seconds();
        let count = missing.map(|entry| entry.exposure_seconds = Some(fallback)).count();
        warnings.push(Warning::ExposureMissing { path, count, first, fallback });
    }
    Ok(true)
}

/// Reads a list of exposure times: timestamps and exposure times in seconds, in order.
///
/// # Errors
///
/// [`FileError`] if the file is unreadable or malformed.
pub fn read_exposure_times(path: &Path) -> Result<(Vec<f64>, Vec<f64>), FileError> {
    let file = TextFile::read(path)?;
    let mut lines = file.lines();
    let columns = match lines.next() {
        Some(header) => columns(&header)?,
        None => {
            let (path, found) = (path.to_owned(), String::new());
            return Err(FileError::MalformedLine { path, line: 1, found, expected: HEADER });
        }
    };
    let (mut times, mut exposures) = (Vec::new(), Vec::new());
    for line in lines {
        let [timestamp, exposure] = row(&line, columns)?;
        line.check_order(timestamp, times.last().copied())?;
        times.push(timestamp);
        exposures.push(exposure);
    }
    Ok((times, exposures))
}

/// Where the columns `timestamp` and `exposure_s` are.
fn columns(header: &Line<'_>) -> Result<[usize; 2], FileError> {
    let position = |name| header.text.split(',').position(|column| column.trim() == name);
    match (position("timestamp"), position("exposure_s")) {
        (Some(timestamp), Some(exposure)) => Ok([timestamp, exposure]),
        _ => Err(header.malformed(HEADER)),
    }
}

fn row(line: &Line<'_>, columns: [usize; 2]) -> Result<[f64; 2], FileError> {
    let fields: Vec<&str> = line.text.split(',').map(str::trim).collect();
    let mut values = [0.0; 2];
    for (value, column) in values.iter_mut().zip(columns) {
        let field = fields.get(column).ok_or_else(|| line.malformed(ROW))?;
        *value = line.number(field, ROW)?;
    }
    match values[1] {
        exposure if exposure <= 0.0 => Err(line.malformed(ROW)),
        exposure if check_exposure(exposure).is_err() => Err(line.malformed(PLAUSIBLE)),
        _ => Ok(values),
    }
}

/// Writes the exposure times (seconds) of frames with these timestamps, as the data set's list `exposures.csv` has
/// them; both read back exactly.
///
/// # Errors
///
/// [`FileError`] if the file cannot be written.
pub fn write_exposure_times(path: &Path, times_and_exposures: &[(f64, f64)]) -> Result<(), FileError> {
    let row = |(time, exposure): &(f64, f64)| format!("{time:?},{exposure:?}\n");
    let rows: String = times_and_exposures.iter().map(row).collect();
    write_text(path, &format!("timestamp,exposure_s\n{rows}"))
}
