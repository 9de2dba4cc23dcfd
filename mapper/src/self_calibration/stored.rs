//! Estimates in a RUN folder, so that whoever goes on from the run has the same camera.

use std::fs;
use std::io;
use std::path::Path;

use super::search::SHORTEST;
use crate::FileError;
use crate::dataset::{
    CameraFact, Dataset, DatasetError, ExposureSource, Knowledge, read_calibration, read_exposure_times,
    write_calibration, write_exposure_times,
};

/// Name of the calibration with what was estimated; its list `estimated` tells what that is.
pub const ESTIMATED_FILE: &str = "calibration_estimated.toml";

/// Name of the estimated exposure times, in the layout of `exposures.csv`.
pub const ESTIMATED_EXPOSURES_FILE: &str = "exposures_estimated.csv";

/// Why stored estimates cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoredError {
    /// The file is unreadable or malformed.
    #[error(transparent)]
    File(#[from] FileError),
    /// The calibration is malformed or not that of the data set.
    #[error(transparent)]
    Calibration(#[from] DatasetError),
}

/// Whether anything about the data set is known from the recording itself only, or its frames are taken for sharp.
#[must_use]
pub fn has_estimates(dataset: &Dataset) -> bool {
    let calibration = dataset.calibration();
    let is_estimated = |fact: CameraFact| calibration.sources.of(fact) == Knowledge::Estimated;
    CameraFact::ALL.into_iter().any(is_estimated) || is_sharp(&calibration.exposure)
}

fn is_sharp(exposure: &ExposureSource) -> bool {
    *exposure == ExposureSource::Assumed { seconds: SHORTEST }
}

/// Removes estimates of an earlier run from a folder.
///
/// # Errors
/// [`FileError`] if a file is there and cannot be removed.
pub fn remove(folder: &Path) -> Result<(), FileError> {
    for name in [ESTIMATED_FILE, ESTIMATED_EXPOSURES_FILE] {
        let path = folder.join(name);
        match fs::remove_file(&path) {
            Err(reason) if reason.kind() != io::ErrorKind::NotFound => {
                return Err(FileError::Unwritable { path, reason });
            }
            _ => (),
        }
    }
    Ok(())
}

/// Writes the calibration of a data set that was completed; exposure times that stand on record are left out.
///
/// # Errors
/// [`FileError`] if a file cannot be written.
pub fn write(folder: &Path, dataset: &Dataset) -> Result<(), FileError> {
    remove(folder)?;
    write_calibration(&folder.join(ESTIMATED_FILE), dataset.calibration())?;
    if dataset.calibration().sources.exposure == Knowledge::Recorded {
        return Ok(());
    }
    let times: Vec<(f64, f64)> =
        (0..dataset.len()).map(|index| (dataset.timestamp(index), dataset.exposure_seconds(index))).collect();
    write_exposure_times(&folder.join(ESTIMATED_EXPOSURES_FILE), &times)
}

/// The data set with the estimates of a RUN folder; as it is if there are none.
///
/// # Errors
/// [`StoredError`] if the files are damaged or belong to another data set.
pub fn read_back(folder: &Path, dataset: Dataset) -> Result<Dataset, StoredError> {
    let path = folder.join(ESTIMATED_FILE);
    if !path.is_file() {
        return Ok(dataset);
    }
    let estimated = read_calibration(&path)?;
    let mut calibration = dataset.calibration().clone();
    for fact in CameraFact::ALL {
        if estimated.sources.of(fact) == Knowledge::Estimated {
            calibration.take(fact, &estimated);
        }
    }
    let exposures = folder.join(ESTIMATED_EXPOSURES_FILE);
    if !exposures.is_file() {
        return Ok(dataset.with_calibration(calibration)?);
    }
    let (_, seconds) = read_exposure_times(&exposures)?;
    // Frames that were taken for sharp have a time that nobody measured.
    let sharp = seconds.iter().all(|seconds| *seconds == SHORTEST);
    calibration.exposure = ExposureSource::Assumed { seconds: SHORTEST };
    calibration.sources.exposure = Knowledge::Assumed;
    let mut dataset = dataset.with_calibration(calibration)?;
    if !sharp {
        dataset.set_exposures(seconds)?;
    }
    Ok(dataset)
}
