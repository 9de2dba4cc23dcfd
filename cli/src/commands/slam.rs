//! `mba slam`.

use std::path::Path;

use mba_mapper::checkpoint::CheckpointError;
use mba_mapper::dataset::Dataset;
use mba_mapper::mapping::MapError;
use mba_mapper::run::{RunError, RunSettings, Summary};
use mba_mapper::slam::{SlamError, SlamProgress, SlamSettings, run_slam};
use mba_mapper::tracking::TrackingError;
use mba_tracker::SimdLevel;
use serde_json::json;

use super::{calibrate, open, outcome};
use crate::args::slam::{Slam, Slamming};
use crate::console::Console;
use crate::failure::{OrBadInput, interrupted, is_disk_full};
use crate::interrupt::{self, Resumption};
use crate::report::table;
use crate::written_run::{self, CAMERA_HINT, OUT_HINT, announce, claim, name, or_auto};

/// Steps of the refinement's progress bar: positions are shares, not counts.
const REFINEMENT_STEPS: u64 = 1000;

/// Tracks and maps a data set and prints the summary.
///
/// # Errors
/// Bad input when the data set cannot be used; failure when the results cannot be written.
pub fn run(args: &Slam, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let dataset = open::dataset(&args.dataset, simd)?;
    let dataset = calibrate::completed(dataset, args.slamming.self_calibrate, console)?;
    let resumption = if args.slamming.realtime { Resumption::Never } else { Resumption::Option(args.resume) };
    let how = (args.force, resumption);
    let summary = slam_into(&dataset, &args.out, how, &args.slamming, console)?;
    console.result(&summary, table::summary)
}

/// Tracks and maps `dataset` into the RUN folder `out`; with `force` also into a folder of others. It
/// goes on from the checkpoint there if it is to be resumed.
///
/// # Errors
/// As [`run`].
pub fn slam_into(
    dataset: &Dataset,
    out: &Path,
    (force, resumption): (bool, Resumption),
    args: &Slamming,
    console: &Console,
) -> anyhow::Result<Summary> {
    let _saving = interrupt::saving();
    let folder = claim(out, force, &[dataset.folder()])?;
    let progress = console.progress(dataset.len(), "frames");
    let observe = |at: SlamProgress| {
        match at {
            SlamProgress::Frames { frames, keyframes, map, loops } => {
                progress.set_position(frames as u64);
                progress.set_message(format!("frames: {keyframes} keyframes, {map}, {loops} loops"));
            }
            SlamProgress::Refinement { position, psnr } => {
                progress.set_length(REFINEMENT_STEPS);
                progress.set_position((position * REFINEMENT_STEPS as f64) as u64);
                progress.set_message(format!("refining: {psnr:.1} dB"));
            }
        }
        interrupt::flow()
    };
    let finished = run_slam(
        dataset,
        &SlamSettings::from(args),
        folder,
        resumption.resumes(),
        describe(dataset, args),
        observe,
    );
    progress.finish_and_clear();
    if let Err(SlamError::Stopped) = finished {
        let message = format!("stopped; {} holds the frames so far, marked as incomplete", out.display());
        return Err(interrupted(message, resumption.advice()));
    }
    let summary = finished.or_else(|error| advise(error, dataset))?;
    calibrate::keep(dataset, out)?;
    announce(&summary, out, console);
    outcome::check(&summary, dataset, console)?;
    Ok(summary)
}

fn describe(dataset: &Dataset, args: &Slamming) -> RunSettings {
    let on_off = |on: bool| if on { "on" } else { "off" };
    let settings = SlamSettings::from(args);
    let values = json!({
        "field": name(&args.field),
        "realtime": args.realtime,
        "blur": name(&args.ablation.blur),
        "virtual_views": or_auto(settings.virtual_views),
        "reference": name(&args.ablation.reference),
        "depth_term": on_off(settings.depth_term),
        "loop": on_off(settings.loops),
        "continuity": on_off(settings.continuity),
        "max_keyframes": settings.max_keyframes,
        "max_gaussians": or_auto(settings.max_gaussians),
        "time_budget_seconds": settings.time_budget.map(|budget| budget.as_secs_f64()),
        "seed": settings.seed,
    });
    written_run::settings(dataset, &values)
}

/// Advice for what the user can repair.
fn advise(error: SlamError, dataset: &Dataset) -> anyhow::Result<Summary> {
    let disk_is_full = match &error {
        SlamError::Run(error) => is_disk_full(error),
        SlamError::Map(MapError::Run(error)) => is_disk_full(error),
        SlamError::Checkpoint(CheckpointError::File(error))
        | SlamError::Map(MapError::Checkpoint(CheckpointError::File(error))) => is_disk_full(error),
        _ => false,
    };
    if disk_is_full {
        return Err(error.into());
    }
    if let SlamError::Map(MapError::NoKeyframe(_) | MapError::NoDepth) = &error {
        return Err(outcome::failure(dataset, ""));
    }
    let hint = match &error {
        SlamError::Tracking(TrackingError::Camera(_)) => CAMERA_HINT,
        SlamError::Run(RunError::Unwritable { .. }) => OUT_HINT,
        SlamError::Checkpoint(_) | SlamError::Map(MapError::Checkpoint(_)) => {
            "start without --resume, or with the data set and options of the stopped run"
        }
        SlamError::Map(_) => "a map needs frames with depth that can be tracked; see `mba info DATASET`",
        _ => "see `mba info DATASET`",
    };
    Err(error).or_bad_input(hint)
}
