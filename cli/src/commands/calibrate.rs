//! `mba calibrate`, and calibrating by the way in the commands that track.

use std::path::Path;

use mba_mapper::dataset::{
    Calibration, CalibrationSources, Dataset, ExposureSource, Knowledge, write_calibration,
    write_exposure_times,
};
use mba_mapper::self_calibration::{self, Finding};
use mba_tracker::SimdLevel;
use serde::Serialize;

use super::open;
use crate::args::{Calibrate, LengthBetween, Switch};
use crate::console::Console;
use crate::failure::{OrBadInput, bad_input};
use crate::written_run::note_written;

/// What the command prints.
#[derive(Debug, Serialize)]
struct Result {
    /// What was looked for.
    findings: Vec<Finding>,
    /// How each fact came to be known, afterwards.
    sources: CalibrationSources,
}

/// Finds what is not on record, prints it and writes a calibration if asked to.
///
/// # Errors
/// Bad input when the data set cannot be used or the file not be written.
pub fn run(args: &Calibrate, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let recorded = open::dataset(&args.dataset, simd)?;
    let was_complete = self_calibration::is_complete(&recorded);
    let (mut dataset, mut findings) = self_calibration::complete(recorded)?;
    if was_complete && dataset.calibration().sources.vignetting == Knowledge::Assumed {
        let (finding, found) = self_calibration::vignetting(&dataset);
        findings.push(finding);
        if let Some(vignetting) = found {
            let mut calibration = dataset.calibration().clone();
            (calibration.vignetting, calibration.sources.vignetting) = (vignetting, Knowledge::Estimated);
            dataset = dataset.with_calibration(calibration)?;
        }
    }
    // A measured length is surer than an accelerometer.
    let scale = match &args.distance {
        Some(length) => Some(measured(&dataset, length)?),
        None => self_calibration::depth_scale(&dataset),
    };
    if let Some((finding, found)) = scale {
        findings.push(finding);
        if let Some(depth_scale) = found {
            let mut calibration = dataset.calibration().clone();
            (calibration.depth_scale, calibration.sources.depth_scale) = (depth_scale, Knowledge::Estimated);
            dataset = dataset.with_calibration(calibration)?;
        }
    }
    if args.focal_length {
        let (finding, factor) = self_calibration::focal_length(&dataset);
        findings.push(finding);
        if let Some(factor) = factor {
            let calibration = refocused(dataset.calibration(), factor);
            dataset = dataset.with_calibration(calibration)?;
        }
    }
    if let Some(path) = &args.out {
        write(path, &dataset).or_bad_input("name a file for --out in a folder that exists")?;
        note_written(path, console);
    }
    let result = Result { findings, sources: dataset.calibration().sources };
    console.result(&result, table)
}

/// The depth scale by a length that was measured.
fn measured(dataset: &Dataset, length: &LengthBetween) -> anyhow::Result<(Finding, Option<f64>)> {
    let LengthBetween { from, to, metres } = *length;
    if from.max(to) >= dataset.len() {
        let message = format!("--distance names frame {}, but there are {}", from.max(to), dataset.len());
        return Err(bad_input(message, "frames count from 0, in the order of time"));
    }
    let found = self_calibration::depth_scale_by_distance(dataset, [from, to], metres);
    found.or_bad_input("name two frames that are tracked and some decimetres apart")
}

fn refocused(calibration: &Calibration, factor: f64) -> Calibration {
    let mut calibration = calibration.clone();
    calibration.camera.fx *= factor;
    calibration.camera.fy *= factor;
    calibration.sources.camera = Knowledge::Estimated;
    calibration
}

/// The calibration and, beside it, the exposure times of single frames; those on record stay where they are.
fn write(path: &Path, dataset: &Dataset) -> std::result::Result<(), mba_mapper::FileError> {
    write_calibration(path, dataset.calibration())?;
    let calibration = dataset.calibration();
    let is_estimated = calibration.sources.exposure == Knowledge::Estimated;
    if calibration.exposure != ExposureSource::PerFrame || !is_estimated {
        return Ok(());
    }
    let times: Vec<(f64, f64)> =
        (0..dataset.len()).map(|index| (dataset.timestamp(index), dataset.exposure_seconds(index))).collect();
    write_exposure_times(&path.with_file_name("exposures.csv"), &times)
}

fn table(result: &Result) -> String {
    if result.findings.is_empty() {
        return "exposure and readout times are on record".to_owned();
    }
    result.findings.iter().map(|finding| format!("{finding}\n")).collect()
}

/// The data set with exposure and readout times that are not on record, found from the recording itself, and without an
/// IMU that contradicts it, unless that is switched off; says what was found.
///
/// # Errors
/// As [`self_calibration::complete`].
pub fn completed(dataset: Dataset, switch: Switch, console: &Console) -> anyhow::Result<Dataset> {
    if switch == Switch::Off {
        return Ok(dataset);
    }
    if self_calibration::is_complete(&dataset) {
        return Ok(without_faults(dataset));
    }
    console.note("looking for what is not on record about the camera, which takes some seconds");
    let (dataset, findings) = self_calibration::complete(dataset)?;
    let found: Vec<String> = findings.iter().map(ToString::to_string).collect();
    console.note(format!("found from the recording: {}", found.join("; ")));
    Ok(without_faults(dataset))
}

/// The data set without an IMU whose gyroscope does not turn as the camera does.
fn without_faults(dataset: Dataset) -> Dataset {
    match self_calibration::gyroscope_fault(&dataset) {
        Some(fault) => dataset.without_imu(fault.to_string()),
        None => dataset,
    }
}

/// Keeps in the RUN folder `out` what was found about the camera, in place of what an earlier run found.
///
/// # Errors
/// When the files cannot be written.
pub fn keep(dataset: &Dataset, out: &Path) -> anyhow::Result<()> {
    if self_calibration::has_estimates(dataset) {
        self_calibration::write(out, dataset)?;
    } else {
        self_calibration::remove(out)?;
    }
    Ok(())
}
