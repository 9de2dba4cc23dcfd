//! Estimates in a RUN folder, so that whoever goes on from the run has the same camera.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use mba_io::FileError;
use mba_io::dataset::{
    CameraFact, Dataset, DatasetError, ExposureSource, Knowledge, read_calibration, read_exposure_times,
    write_calibration, write_exposure_times,
};

use super::exposure_times::SHORTEST;

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
    /// The calibration is malformed.
    #[error(transparent)]
    Calibration(#[from] DatasetError),
    /// What a file says cannot be true of the data set.
    #[error("{path} does not fit the data set: {reason}")]
    Unfit {
        /// The file.
        path: PathBuf,
        /// What speaks against it.
        reason: DatasetError,
    },
    /// An exposure time has another timestamp than its frame.
    #[error(
        "{path} does not fit the data set: exposure time {index} is that of {found} s, the frame is at {expected} s"
    )]
    OtherFrame {
        /// The file.
        path: PathBuf,
        /// Number of the row and of the frame, from 0.
        index: usize,
        /// Timestamp in the file.
        found: f64,
        /// Timestamp of the frame.
        expected: f64,
    },
}

/// Largest difference between the times of a frame here and in the data set, seconds.
const SAME_TIME: f64 = 1e-4;

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
    let unfit = |path: &Path| {
        let path = path.to_owned();
        move |reason| StoredError::Unfit { path, reason }
    };
    if !exposures.is_file() {
        return dataset.with_calibration(calibration).map_err(unfit(&path));
    }
    let (times, seconds) = read_exposure_times(&exposures)?;
    // Frames that were taken for sharp have a time that nobody measured.
    let sharp = seconds.iter().all(|seconds| *seconds == SHORTEST);
    calibration.exposure = ExposureSource::Assumed { seconds: SHORTEST };
    calibration.sources.exposure = Knowledge::Assumed;
    let mut dataset = dataset.with_calibration(calibration).map_err(unfit(&path))?;
    check_times(&exposures, &times, &dataset)?;
    if !sharp {
        dataset.set_exposures(seconds).map_err(unfit(&exposures))?;
    }
    Ok(dataset)
}

/// Checks that there is one time for each frame, which is that of the frame.
fn check_times(path: &Path, times: &[f64], dataset: &Dataset) -> Result<(), StoredError> {
    let (found, frames) = (times.len(), dataset.len());
    if found != frames {
        let reason = DatasetError::ExposureCount { found, frames };
        return Err(StoredError::Unfit { path: path.to_owned(), reason });
    }
    let differs = |index: &usize| (times[*index] - dataset.timestamp(*index)).abs() > SAME_TIME;
    match (0..frames).find(differs) {
        Some(index) => {
            let (path, found, expected) = (path.to_owned(), times[index], dataset.timestamp(index));
            Err(StoredError::OtherFrame { path, index, found, expected })
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mba_io::dataset::{Calibration, open};
    use mba_synth::{SynthConfig, SynthSequence, write_dataset};

    fn three_frames(folder: &Path) -> Dataset {
        let config =
            SynthConfig { frames: 3, width: 32, height: 24, mean_blur_px: 0.0, ..SynthConfig::default() };
        let data = folder.join("data");
        write_dataset(&SynthSequence::new(config).unwrap(), &data, |_, _| ()).unwrap();
        open(&data).unwrap()
    }

    #[test]
    fn estimates_of_other_frames_are_refused_with_the_name_of_their_file() {
        let folder = tempfile::tempdir().unwrap();
        let dataset = three_frames(folder.path());
        let mut estimated: Calibration = dataset.calibration().clone();
        estimated.sources.exposure = Knowledge::Estimated;
        let dataset = dataset.with_calibration(estimated).unwrap();
        let stamps: Vec<f64> = (0..3).map(|index| dataset.timestamp(index)).collect();
        write(folder.path(), &dataset).unwrap();
        let read = || read_back(folder.path(), dataset.clone());
        assert!(read().is_ok());
        let path = folder.path().join(ESTIMATED_EXPOSURES_FILE);
        let refusal = |times: &[f64]| {
            let rows: Vec<(f64, f64)> = times.iter().map(|time| (*time, 0.01)).collect();
            write_exposure_times(&path, &rows).unwrap();
            read().unwrap_err().to_string()
        };
        let expected = format!("{} does not fit the data set: 2 exposure times for 3 frames", path.display());
        assert_eq!(refusal(&stamps[..2]), expected);
        let message = refusal(&[stamps[0], stamps[1], stamps[2] + 1.0]);
        let expected = format!("{} does not fit the data set: exposure time 2 is that of ", path.display());
        assert!(message.starts_with(&expected), "{message}");
    }
}
