//! `mba track`.

use std::path::Path;

use mba_mapper::dataset::Dataset;
use mba_mapper::deblurring::write_deblurred_keyframes;
use mba_mapper::run::{Merit, RunError, RunSettings, RunWriter, Summary};
use mba_mapper::tracking::{TrackingError, TrackingOptions, track_dataset, tracker_config};
use serde_json::json;

use super::written_run::{self, CAMERA_HINT, OUT_HINT, note_written, or_auto};
use super::{calibrate, open};
use crate::args::{Switch, Track, Tracking};
use crate::console::Console;
use crate::failure::OrBadInput;
use crate::report::table;

/// Tracks a data set into a RUN folder and prints the summary.
///
/// # Errors
/// Bad input when the data set cannot be used; failure when the results cannot be written.
pub fn run(args: &Track, console: &Console) -> anyhow::Result<()> {
    let dataset = open::dataset(&args.dataset)?;
    let dataset = calibrate::completed(dataset, args.tracking.self_calibrate, console)?;
    let summary = track_into(&dataset, &args.out, &args.tracking, console)?;
    console.result(&summary, table::summary)
}

/// Tracks `dataset` into the RUN folder `out`.
///
/// # Errors
/// As [`run`].
pub fn track_into(
    dataset: &Dataset,
    out: &Path,
    args: &Tracking,
    console: &Console,
) -> anyhow::Result<Summary> {
    let mut writer = RunWriter::create(out, settings(dataset, args)).or_else(advise_output)?;
    calibrate::keep(dataset, out)?;
    for warning in dataset.warnings() {
        console.warning(warning.to_string());
        writer.warn(warning.to_string());
    }
    let progress = console.progress(dataset.len(), "tracking");
    let tracked = track_dataset(dataset, &TrackingOptions::from(args), &mut writer, |_| progress.inc(1));
    progress.finish_and_clear();
    match tracked {
        Err(TrackingError::Camera(error)) => {
            Err(error).or_bad_input(CAMERA_HINT)?;
        }
        other => other?,
    }
    if args.keyframes == Switch::On {
        deblur_keyframes(dataset, args, &mut writer, console)?;
    }
    let merit = Merit::of(writer.exposures(), dataset);
    let summary = writer.finish(|summary| {
        summary.trajectory = merit.trajectory;
        summary.blur = merit.blur;
    })?;
    if summary.frames.skipped > 0 {
        let first = summary.warnings.iter().find(|w| w.starts_with("frame "));
        let reason = first.map_or("see summary.json", String::as_str);
        console.warning(format!("{} frames were skipped, the first: {reason}", summary.frames.skipped));
    }
    note_written(out, console);
    Ok(summary)
}

fn deblur_keyframes(
    dataset: &Dataset,
    args: &Tracking,
    writer: &mut RunWriter,
    console: &Console,
) -> Result<(), RunError> {
    let config = tracker_config(dataset, &TrackingOptions::from(args));
    let progress = console.progress(writer.keyframes().len(), "deblurring");
    let written = write_deblurred_keyframes(dataset, &config, writer, || progress.inc(1));
    progress.finish_and_clear();
    written
}

fn settings(dataset: &Dataset, args: &Tracking) -> RunSettings {
    let options = TrackingOptions::from(args);
    let values = json!({
        "blur": if options.blur { "auto" } else { "off" },
        "virtual_views": or_auto(options.virtual_views),
        "reference": format!("{:?}", options.reference).to_lowercase(),
        "tracker_memory_bytes": tracker_config(dataset, &options).workspace_len(),
        "depth_term": if args.depth_term == Switch::On { "on" } else { "off" },
    });
    written_run::settings(dataset, &values)
}

/// An output that cannot be written from the start is wrong use; a full disk is not.
fn advise_output(error: RunError) -> anyhow::Result<RunWriter> {
    match error {
        RunError::DiskFull { .. } => Err(error.into()),
        _ => Err(error).or_bad_input(OUT_HINT),
    }
}
