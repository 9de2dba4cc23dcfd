//! Opening inputs with advice for what can go wrong.

use std::borrow::Cow;
use std::path::Path;

use mba_mapper::dataset::{self, Dataset, DatasetError, OpenOptions};
use mba_mapper::import::Source;
use mba_mapper::map::{FIELD_FILE, MAP_FILE, StoredMap};
use mba_mapper::run::{Run, RunError, path_of};
use mba_mapper::self_calibration::read_back;
use mba_tracker::SimdLevel;

use crate::console::Console;
use crate::failure::{OrBadInput, bad_input};

/// Opens a data set, to be worked on with the instructions `simd`.
///
/// # Errors
/// Bad input with advice.
pub fn dataset(folder: &Path, simd: SimdLevel) -> anyhow::Result<Dataset> {
    open_with(folder, simd).map_err(|error| (import_hint(folder, &error), error)).or_else(advise)
}

/// Opens a data set, to be worked on with the instructions `simd`; without advice.
///
/// # Errors
/// As [`dataset::open`].
pub fn open_with(folder: &Path, simd: SimdLevel) -> Result<Dataset, DatasetError> {
    dataset::open_with(folder, &OpenOptions { simd, ..OpenOptions::default() })
}

/// What to do about something that is no data set but may become one, or else about a data set that cannot be used.
fn import_hint(path: &Path, error: &DatasetError) -> Cow<'static, str> {
    let may_be_recording = matches!(error, DatasetError::UnknownLayout { .. }) || path.is_file();
    match Source::recognise(path) {
        Ok(source) if may_be_recording => {
            format!("`mba import {} --out data` makes a data set of it ({})", path.display(), source.kind())
                .into()
        }
        _ => dataset_hint(error),
    }
}

/// Opens a RUN folder.
///
/// # Errors
/// Bad input with advice.
pub fn run(folder: &Path) -> anyhow::Result<Run> {
    let hint = |error: &RunError| match error {
        RunError::NotARun { .. } => "give the folder that `mba track --out` wrote",
        _ => "track the sequence again, or restore the file",
    };
    Run::open(folder).map_err(|error| (hint(&error), error)).or_else(advise)
}

/// The data set in `folder`, or else the run's own if it is there: a report lacks captured images and truth without it,
/// nothing else.
///
/// # Errors
/// Bad input with advice for a folder that was named.
pub fn dataset_if_there(
    run: &Run,
    folder: Option<&Path>,
    simd: SimdLevel,
    console: &Console,
) -> anyhow::Result<Option<Dataset>> {
    if let Some(folder) = folder {
        return dataset(folder, simd).map(Some);
    }
    let opened = open_with(&path_of(&run.summary.settings.dataset), simd);
    if let Err(error) = &opened {
        let hint = "--dataset names another place";
        console.warning(format!("there are no captured images and no truth to show, {error}; {hint}"));
    }
    Ok(opened.ok())
}

/// The data set with what the run found about its camera.
///
/// # Errors
/// Bad input with advice.
pub fn with_estimates(dataset: Dataset, run: &Run) -> anyhow::Result<Dataset> {
    read_back(&run.folder, dataset).or_bad_input("track the sequence again, or restore the file")
}

/// Reads the map of a run.
///
/// # Errors
/// Bad input with advice.
pub fn map(run: &Run) -> anyhow::Result<StoredMap> {
    let Some(path) = StoredMap::path(&run.folder) else {
        let message =
            format!("{} has no map: there is no {MAP_FILE} and no {FIELD_FILE}", run.folder.display());
        return Err(bad_input(message, "`mba map` makes one from the data set and a tracked run"));
    };
    StoredMap::read(&path).or_bad_input("restore the file, or map the sequence again")
}

fn advise<T, E>((hint, error): (impl Into<String>, E)) -> anyhow::Result<T>
where
    E: std::error::Error + Send + Sync + 'static,
{
    Err(error).or_bad_input(hint)
}

/// What to do about a data set that cannot be used.
pub(super) fn dataset_hint(error: &DatasetError) -> Cow<'static, str> {
    let hint = match error {
        DatasetError::File(_) => "correct that line or file",
        DatasetError::UnknownLayout { .. } => "give the folder that holds the lists of images",
        DatasetError::MissingCalibration { .. } => "see docs/formats.md for an example",
        DatasetError::CalibrationSyntax { .. } | DatasetError::CalibrationValue { .. } => {
            "correct the calibration; lengths are in pixels of the stored images, times in seconds"
        }
        DatasetError::EmptyList { .. } => "the list needs lines `timestamp file`",
        DatasetError::NoAssociation { .. } => "write associations.txt to pair the images yourself",
        DatasetError::TimestampUnit { per_second, .. } => {
            return format!(
                "divide all times of the data set by {per_second}, or give the frame_rate in the calibration if frames are that far apart"
            )
            .into();
        }
        DatasetError::DepthSize { .. } => {
            "docs/formats.md shows the section; a camera that sees more than colour does needs one, too"
        }
        DatasetError::SizeMismatch { .. } => "the calibration must be that of the stored image size",
        _ => "see `mba info --help` for what a data set needs",
    };
    hint.into()
}
