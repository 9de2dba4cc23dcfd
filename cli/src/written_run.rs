//! What the commands that write a RUN folder have in common.

use std::path::Path;

use clap::ValueEnum;
use mba_mapper::dataset::Dataset;
use mba_mapper::output::{OutputError, OutputFolder, Permission};
use mba_mapper::run::{RunSettings, Summary, stored_path};
use serde::Serialize;
use serde_json::{Value, json};

use crate::console::Console;
use crate::failure::{OrBadInput, is_disk_full};

/// Advice when the folder cannot be written.
pub const OUT_HINT: &str = "name a folder for --out that can be created or written";

/// Advice when the tracker refuses the camera.
pub const CAMERA_HINT: &str = "check the calibration: the tracker needs at least 32 x 32 pixels";

/// Claims the folder `out` for a RUN of a command that reads `inputs`.
///
/// # Errors
/// Bad input with advice; failure when the disk is full.
pub fn claim(out: &Path, force: bool, inputs: &[&Path]) -> anyhow::Result<OutputFolder> {
    OutputFolder::for_run(out, &Permission { force, inputs }).or_else(refuse)
}

/// The refusal of an output, with advice.
///
/// # Errors
/// Always: bad input, or failure when the disk is full.
pub fn refuse<T>(error: OutputError) -> anyhow::Result<T> {
    if is_disk_full(&error) {
        return Err(error.into());
    }
    let hint = output_hint(&error);
    Err(error).or_bad_input(hint)
}

/// The error of a report, with advice where it is the refusal of an output.
///
/// # Errors
/// Always; as [`refuse`] where an output is refused.
pub fn advise_report<T>(error: anyhow::Error) -> anyhow::Result<T> {
    error.downcast().map_or_else(Err, refuse)
}

/// Advice for an output that is refused.
#[must_use]
pub fn output_hint(error: &OutputError) -> &'static str {
    match error {
        OutputError::DataSet { .. } | OutputError::Input { .. } => "name another place for --out",
        OutputError::Foreign { .. } => "name a new place for --out, or add --force if it may be written over",
        OutputError::DeadLink { .. } => "remove the link, or name another place for --out",
        OutputError::InUse { .. } => "wait until that process has ended, or name another place for --out",
        _ => "name a place for --out that can be created or written",
    }
}

/// The settings of a run on `dataset`; `options` is an object.
#[must_use]
pub fn settings(dataset: &Dataset, options: &Value) -> RunSettings {
    let mut options = options.as_object().cloned().unwrap_or_default();
    options.insert("calibration".to_owned(), json!(dataset.calibration().sources));
    let settings = RunSettings::new(concat!("mba ", env!("CARGO_PKG_VERSION")), dataset);
    RunSettings { dataset: absolute(dataset.folder()), options, ..settings }
}

/// `path` for somebody who looks at the run from another directory.
#[must_use]
pub fn absolute(path: &Path) -> String {
    stored_path(&path.canonicalize().unwrap_or_else(|_| path.to_owned()))
}

/// A limit that is chosen by the program unless it is given.
#[must_use]
pub fn or_auto(limit: Option<impl Serialize>) -> Value {
    limit.map_or_else(|| json!("auto"), |limit| json!(limit))
}

/// The name of a value on the command line.
#[must_use]
pub fn name(value: &impl ValueEnum) -> String {
    value.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

/// Says what was odd in a finished run, and where it is.
pub fn announce(summary: &Summary, out: &Path, console: &Console) {
    for warning in &summary.warnings {
        console.warning(warning);
    }
    note_written(out, console);
}

/// Says where a run is.
pub fn note_written(out: &Path, console: &Console) {
    console.note(format!("wrote {}", out.display()));
}
