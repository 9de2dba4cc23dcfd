//! `mba track`.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

use mba_mapper::dataset::Dataset;
use mba_mapper::hindsight::look_back;
use mba_mapper::run::{
    Merit, RunError, RunSettings, RunWriter, Summary, TrackRecord, plausibility, write_deblurred_keyframes,
};
use mba_mapper::self_calibration::{contradictions, depth_lag_of_tracked};
use mba_mapper::tracking::{
    Tracked, TrackingCheckpoint, TrackingError, TrackingOptions, track_and_keep, tracker_config,
    upright_world,
};
use mba_tracker::SimdLevel;
use nalgebra::UnitVector3;
use serde_json::json;

use super::{calibrate, open, outcome};
use crate::args::{Switch, Track, Tracking};
use crate::console::Console;
use crate::failure::{OrBadInput, interrupted, is_disk_full};
use crate::interrupt::{self, Resumption};
use crate::report::table;
use crate::written_run::{self, CAMERA_HINT, claim, note_written, or_auto};

/// Advice when a checkpoint is not fit to go on from.
const CHECKPOINT_HINT: &str = "start without --resume, or with the data set and options of the stopped run";

/// Tracks a data set into a RUN folder and prints the summary.
///
/// # Errors
/// Bad input when the data set cannot be used; failure when the results cannot be written.
pub fn run(args: &Track, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let dataset = open::dataset(&args.dataset, simd)?;
    let dataset = calibrate::completed(dataset, args.tracking.self_calibrate, console)?;
    let (how, interval) = ((args.force, Resumption::Option(args.resume)), args.checkpoint_interval);
    let summary = track_into(&dataset, &args.out, how, interval, &args.tracking, console)?;
    console.result(&summary, table::summary)
}

/// Tracks `dataset` into the RUN folder `out`: with `force` also into a folder of others, from the checkpoint there if it is
/// to be resumed, and with another checkpoint after each interval.
///
/// # Errors
/// As [`run`].
pub fn track_into(
    dataset: &Dataset,
    out: &Path,
    (force, resumption): (bool, Resumption),
    interval: Duration,
    args: &Tracking,
    console: &Console,
) -> anyhow::Result<Summary> {
    let _saving = interrupt::saving();
    let folder = claim(out, force, &[dataset.folder()])?;
    let options = TrackingOptions::from(args);
    let mut checkpoint = TrackingCheckpoint::new(out, dataset, &options, interval, resumption.resumes())
        .or_bad_input(CHECKPOINT_HINT)?;
    let mut writer = RunWriter::create(folder, settings(dataset, args))?;
    for warning in dataset.warnings() {
        console.warning(warning.to_string());
        // Those of a run that goes on have been noted.
        if checkpoint.frames() == 0 {
            writer.record_mut().warn(warning.to_string());
        }
    }
    let progress = console.progress(dataset.len(), "tracking");
    progress.set_position(checkpoint.frames() as u64);
    let tracked = track_and_keep(dataset, &options, &mut writer, Some(&mut checkpoint), |_| {
        progress.inc(1);
        interrupt::flow()
    });
    progress.finish_and_clear();
    match tracked {
        Err(TrackingError::Camera(error)) => {
            Err(error).or_bad_input(CAMERA_HINT)?;
        }
        Err(TrackingError::Stopped) => return Err(stopped(dataset, out, &writer, resumption)),
        Err(TrackingError::Checkpoint(error)) if !is_disk_full(&error) => {
            Err(error).or_bad_input(CHECKPOINT_HINT)?;
        }
        other => {
            let tracked = other?;
            if args.hindsight == Switch::On {
                match look_back_with_progress(dataset, &options, &mut writer, &tracked, console) {
                    Err(TrackingError::Stopped) => return Err(stopped(dataset, out, &writer, resumption)),
                    other => other?,
                }
            }
            if let Some(lag) = depth_lag_of_tracked(dataset, tracked.disagreement) {
                console.warning(lag.to_string());
                writer.record_mut().warn(lag.to_string());
            }
        }
    }
    let track = writer.record();
    for found in contradictions(dataset, track.exposures(), track.frames()) {
        console.warning(found.to_string());
        writer.record_mut().warn(found.to_string());
    }
    stand_upright(dataset, args.up, writer.record_mut());
    if outcome::nothing_tracked(writer.record().frames()) && writer.has_earlier() {
        writer.give_up();
        return Err(outcome::failure(dataset, "; the earlier run in the folder stays"));
    }
    writer.replace_earlier()?;
    calibrate::keep(dataset, out)?;
    if args.keyframes == Switch::On && deblur_keyframes(dataset, args, &mut writer, console)?.is_break() {
        return Err(stopped(dataset, out, &writer, resumption));
    }
    let track = writer.record();
    let merit = Merit::of(track.exposures(), dataset);
    let plausibility = plausibility(track.exposures(), track.frames(), dataset);
    let summary = writer.finish(|summary| {
        summary.plausibility = plausibility;
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

/// Tracks the recording once more, backwards, and joins both ways in `writer`.
fn look_back_with_progress(
    dataset: &Dataset,
    options: &TrackingOptions,
    writer: &mut RunWriter,
    tracked: &Tracked,
    console: &Console,
) -> Result<(), TrackingError> {
    let progress = console.progress(dataset.len(), "looking back");
    let looked_back = look_back(dataset, options, writer.record_mut(), &tracked.measured, || {
        progress.inc(1);
        interrupt::flow()
    });
    progress.finish_and_clear();
    looked_back
}

/// Moves the poses into a world whose z axis points up, if it is known where that is.
fn stand_upright(dataset: &Dataset, up_in_first_camera: Option<UnitVector3<f64>>, track: &mut TrackRecord) {
    let upright = upright_world(dataset, track.exposures(), track.frames(), up_in_first_camera);
    if let Some((upright_from_world, how)) = upright {
        track.move_world(|_| upright_from_world);
        track.set_upright(how);
    }
}

fn deblur_keyframes(
    dataset: &Dataset,
    args: &Tracking,
    writer: &mut RunWriter,
    console: &Console,
) -> Result<ControlFlow<()>, RunError> {
    let config = tracker_config(dataset, &TrackingOptions::from(args));
    let progress = console.progress(writer.record().keyframes().len(), "deblurring");
    let written = write_deblurred_keyframes(dataset, &config, writer, || {
        progress.inc(1);
        interrupt::flow()
    });
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
        "hindsight": if args.hindsight == Switch::On { "on" } else { "off" },
        "depth_term": if args.depth_term == Switch::On { "on" } else { "off" },
    });
    written_run::settings(dataset, &values)
}

fn stopped(dataset: &Dataset, out: &Path, writer: &RunWriter, resumption: Resumption) -> anyhow::Error {
    let (frames, all) = (writer.record().frames().len(), dataset.len());
    let message = if writer.has_earlier() {
        format!("stopped after {frames} of {all} frames; {} still holds the earlier run", out.display())
    } else {
        format!("stopped after {frames} of {all} frames; {} holds them, marked as incomplete", out.display())
    };
    interrupted(message, resumption.advice())
}
