//! `mba track`.

use std::path::Path;

use mba_mapper::dataset::Dataset;
use mba_mapper::run::{Merit, RunError, RunSettings, RunWriter, Summary, write_deblurred_keyframes};
use mba_mapper::tracking::{TrackingError, TrackingOptions, track_dataset, tracker_config};
use serde_json::json;

use super::{calibrate, open, outcome};
use crate::args::{Switch, Track, Tracking};
use crate::console::Console;
use crate::failure::{OrBadInput, interrupted};
use crate::interrupt;
use crate::report::table;
use crate::written_run::{self, CAMERA_HINT, claim, note_written, or_auto};

/// Tracks a data set into a RUN folder and prints the summary.
///
/// # Errors
/// Bad input when the data set cannot be used; failure when the results cannot be written.
pub fn run(args: &Track, console: &Console) -> anyhow::Result<()> {
    let dataset = open::dataset(&args.dataset)?;
    let dataset = calibrate::completed(dataset, args.tracking.self_calibrate, console)?;
    let summary = track_into(&dataset, &args.out, args.force, &args.tracking, console)?;
    console.result(&summary, table::summary)
}

/// Tracks `dataset` into the RUN folder `out`; with `force` also into a folder of others.
///
/// # Errors
/// As [`run`].
pub fn track_into(
    dataset: &Dataset,
    out: &Path,
    force: bool,
    args: &Tracking,
    console: &Console,
) -> anyhow::Result<Summary> {
    interrupt::watch();
    let folder = claim(out, force, &[dataset.folder()])?;
    let mut writer = RunWriter::create(folder, settings(dataset, args))?;
    for warning in dataset.warnings() {
        console.warning(warning.to_string());
        writer.warn(warning.to_string());
    }
    let progress = console.progress(dataset.len(), "tracking");
    let tracked = track_dataset(dataset, &TrackingOptions::from(args), &mut writer, |_| {
        progress.inc(1);
        interrupt::flow()
    });
    progress.finish_and_clear();
    match tracked {
        Err(TrackingError::Camera(error)) => {
            Err(error).or_bad_input(CAMERA_HINT)?;
        }
        Err(TrackingError::Stopped) => return Err(stopped(dataset, out, writer.frames().len())),
        other => other?,
    }
    if outcome::nothing_tracked(writer.frames()) && writer.has_earlier() {
        writer.give_up();
        return Err(outcome::failure(dataset, "; the earlier run in the folder stays"));
    }
    writer.replace_earlier()?;
    calibrate::keep(dataset, out)?;
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
    outcome::check(&summary, dataset, console)?;
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

fn stopped(dataset: &Dataset, out: &Path, frames: usize) -> anyhow::Error {
    let message = format!(
        "stopped after {frames} of {} frames; {} holds them, marked as incomplete",
        dataset.len(),
        out.display()
    );
    interrupted(message, format!("`{}` starts again", interrupt::command_to_go_on(false)))
}
