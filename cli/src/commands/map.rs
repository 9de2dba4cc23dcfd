//! `mba map`.

use std::path::Path;

use mba_mapper::checkpoint::CheckpointError;
use mba_mapper::dataset::Dataset;
use mba_mapper::mapping::{MapError, MapProgress, MapSettings, map_dataset};
use mba_mapper::run::{Run, RunSettings, Summary};
use mba_tracker::SimdLevel;
use serde_json::json;

use super::{calibrate, open};
use crate::args::map::{Map, Mapping};
use crate::console::Console;
use crate::failure::{OrBadInput, bad_input, interrupted, is_disk_full};
use crate::interrupt::{self, Resumption};
use crate::report::table;
use crate::written_run::{self, OUT_HINT, absolute, announce, claim, name, or_auto};

/// Steps of the progress bar: positions are shares, not counts.
pub(super) const PROGRESS_STEPS: usize = 1000;

/// Makes a map of a tracked data set and prints the summary.
///
/// # Errors
/// Bad input when data set, run or checkpoint cannot be used; failure when the results cannot be written.
pub fn run(args: &Map, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let missing = || bad_input("--trajectory and --out are needed", "see `mba map --help`");
    let trajectory = args.trajectory.as_deref().ok_or_else(missing)?;
    let out = args.out.as_deref().ok_or_else(missing)?;
    let dataset = open::dataset(&args.dataset, simd)?;
    let run = open::run(trajectory)?;
    let dataset = open::with_estimates(dataset, &run)?;
    let how = (args.force, Resumption::Option(args.resume));
    let summary = map_into(&dataset, &run, out, how, &args.mapping, console)?;
    console.result(&summary, table::summary)
}

/// Maps `dataset` from the poses of `run` into the RUN folder `out`; with `force` also into a folder of others.
/// It goes on from the checkpoint there if it is to be resumed.
///
/// # Errors
/// As [`run`].
pub fn map_into(
    dataset: &Dataset,
    run: &Run,
    out: &Path,
    (force, resumption): (bool, Resumption),
    args: &Mapping,
    console: &Console,
) -> anyhow::Result<Summary> {
    let _saving = interrupt::saving();
    let settings = MapSettings::from(args);
    let folder = claim(out, force, &[dataset.folder(), &run.folder])?;
    let progress = console.progress(PROGRESS_STEPS, "mapping");
    let observe = |at: MapProgress| {
        progress.set_position((at.position * PROGRESS_STEPS as f64) as u64);
        progress.set_message(format!("mapping: {}, loss {:.4}, {:.1} dB", at.size, at.loss, at.psnr));
        interrupt::flow()
    };
    let mapped = map_dataset(
        dataset,
        run,
        &settings,
        folder,
        resumption.resumes(),
        describe(dataset, run, args),
        observe,
    );
    progress.finish_and_clear();
    if let Err(MapError::Stopped) = mapped {
        let message = format!("stopped; {} holds the tracked poses and a checkpoint", out.display());
        return Err(interrupted(message, resumption.advice()));
    }
    let summary = mapped.or_else(|error| advise(error, run))?;
    calibrate::keep(dataset, out)?;
    announce(&summary, out, console);
    Ok(summary)
}

fn describe(dataset: &Dataset, run: &Run, args: &Mapping) -> RunSettings {
    let values = json!({
        "field": name(&args.field),
        "trajectory": absolute(&run.folder),
        "blur": name(&args.blur),
        "continuity": if args.no_continuity { "off" } else { "on" },
        "virtual_views": or_auto(args.virtual_views),
        "max_keyframes": args.max_keyframes,
        "max_gaussians": or_auto(args.max_gaussians),
        "time_budget_seconds": args.time_budget.map(|budget| budget.as_secs_f64()),
        "seed": args.seed,
    });
    written_run::settings(dataset, &values)
}

/// Advice for what the user can repair.
pub(super) fn advise(error: MapError, run: &Run) -> anyhow::Result<Summary> {
    let disk_is_full = match &error {
        MapError::Run(error) => is_disk_full(error),
        MapError::Checkpoint(CheckpointError::File(error)) => is_disk_full(error),
        _ => false,
    };
    if disk_is_full {
        return Err(error.into());
    }
    if let MapError::Continuity(error) = &error {
        let message = format!("the poses of {} make no path: {error}", run.folder.display());
        return Err(bad_input(message, "track the data set again"));
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
        _ => OUT_HINT,
    };
    Err(error).or_bad_input(hint)
}
