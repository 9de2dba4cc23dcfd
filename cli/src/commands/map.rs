//! `mba map`.

use std::path::Path;

use mba_mapper::checkpoint::CheckpointError;
use mba_mapper::dataset::Dataset;
use mba_mapper::mapping::{MapError, MapProgress, MapSettings, map_dataset};
use mba_mapper::run::{Run, RunCamera, RunSettings, Summary};
use serde_json::json;

use super::open;
use crate::args::BlurMode;
use crate::args::map::{Map, Mapping};
use crate::console::Console;
use crate::failure::{OrBadInput, is_disk_full};
use crate::report::table;

/// Steps of the progress bar: positions are shares, not counts.
const PROGRESS_STEPS: usize = 1000;

/// Makes a map of a tracked data set and prints the summary.
///
/// # Errors
/// Bad input when data set, run or checkpoint cannot be used; failure when the results cannot be written.
pub fn run(args: &Map, console: &Console) -> anyhow::Result<()> {
    let dataset = open::dataset(&args.dataset)?;
    let run = open::run(&args.trajectory)?;
    let summary = map_into(&dataset, &run, &args.out, &args.mapping, args.resume, console)?;
    console.result(&summary, table::summary)
}

/// Maps `dataset` from the poses of `run` into the RUN folder `out`.
///
/// # Errors
/// As [`run`].
pub fn map_into(
    dataset: &Dataset,
    run: &Run,
    out: &Path,
    args: &Mapping,
    resume: bool,
    console: &Console,
) -> anyhow::Result<Summary> {
    let settings = MapSettings::from(args);
    let progress = console.progress(PROGRESS_STEPS, "mapping");
    let observe = |at: MapProgress| {
        progress.set_position((at.position * PROGRESS_STEPS as f64) as u64);
        progress.set_message(format!("mapping: {}, loss {:.4}, {:.1} dB", at.size, at.loss, at.psnr));
    };
    let mapped = map_dataset(dataset, run, &settings, out, resume, describe(dataset, run, args), observe);
    progress.finish_and_clear();
    let summary = mapped.or_else(advise)?;
    for warning in &summary.warnings {
        console.warning(warning);
    }
    console.note(format!("wrote {}", out.display()));
    Ok(summary)
}

fn describe(dataset: &Dataset, run: &Run, args: &Mapping) -> RunSettings {
    // The run may be looked at from another directory.
    let absolute =
        |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned()).display().to_string();
    let values = json!({
        "field": args.field.name(),
        "trajectory": absolute(&run.folder),
        "blur": if args.blur == BlurMode::Auto { "auto" } else { "off" },
        "virtual_views": args.virtual_views.map_or_else(|| json!("auto"), |n| json!(n)),
        "max_keyframes": args.max_keyframes,
        "max_gaussians": args.max_gaussians.map_or_else(|| json!("auto"), |n| json!(n)),
        "time_budget_seconds": args.time_budget.map(|budget| budget.as_secs_f64()),
        "seed": args.seed,
    });
    RunSettings {
        program: concat!("mba ", env!("CARGO_PKG_VERSION")).to_owned(),
        dataset: absolute(dataset.folder()),
        frame_rate: dataset.calibration().frame_rate,
        camera: Some(RunCamera::from(dataset.calibration())),
        options: values.as_object().cloned().unwrap_or_default(),
    }
}

/// Advice for what the user can repair.
fn advise(error: MapError) -> anyhow::Result<Summary> {
    let disk_is_full = match &error {
        MapError::Run(error) => is_disk_full(error),
        MapError::Checkpoint(CheckpointError::File(error)) => is_disk_full(error),
        _ => false,
    };
    if disk_is_full {
        return Err(error.into());
    }
    let hint = match &error {
        MapError::Frames { .. } | MapError::Timestamp { .. } => {
            "give the RUN folder that `mba track` wrote for this data set"
        }
        MapError::NoKeyframe(_) => "look at frames.csv of the run and at `mba info DATASET`",
        MapError::NoDepth => "a map needs depth images; see `mba info DATASET`",
        MapError::Checkpoint(_) => {
            "start without --resume, or with the inputs and options of the stopped run"
        }
        MapError::Continuity(_) => "track the data set again",
        _ => "name a folder for --out that can be created or written",
    };
    Err(error).or_bad_input(hint)
}
