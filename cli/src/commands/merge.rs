//! `mba merge`.

use mba_mapper::mapping::MapError;
use mba_mapper::submaps::{MergeReport, MergeSettings, SubmapError, merge};
use mba_tracker::SimdLevel;
use serde_json::json;

use super::{calibrate, job};
use crate::args::submaps::Merge;
use crate::console::Console;
use crate::failure::interrupted;
use crate::interrupt::{self, Resumption};
use crate::report::table;
use crate::written_run::{self, absolute, announce, claim};

/// Merges the maps of a job and prints the summary.
///
/// # Errors
/// Bad input when a group cannot be used; failure when the results cannot be written.
pub fn run(args: &Merge, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let job = job::open_job(&args.job)?;
    let (dataset, run) = job::inputs(&job, simd)?;
    let _saving = interrupt::saving();
    let folder = claim(&args.out, args.force, &[dataset.folder(), &run.folder, &args.job])?;
    let values = json!({
        "job": absolute(&args.job),
        "trajectory": job.plan.run,
        "groups": job.plan.groups.len(),
        "without_missing": args.without_missing,
    });
    let describe = written_run::settings(&dataset, &values);
    let progress = console.progress(job.plan.groups.len(), "merging");
    let observe = |group| {
        progress.set_position(group as u64);
        interrupt::flow()
    };
    let settings = MergeSettings { without_missing: args.without_missing };
    let merged = merge(&job, (&dataset, &run), settings, folder, describe, observe);
    progress.finish_and_clear();
    if let Err(SubmapError::Map(MapError::Stopped)) = merged {
        let message = format!("stopped; {} is as it was", args.out.display());
        return Err(interrupted(message, Resumption::Never.advice()));
    }
    let (summary, report) = merged.or_else(job::refuse)?;
    calibrate::keep(&dataset, &args.out)?;
    announce(&summary, &args.out, console);
    console.note(told(&report));
    console.result(&summary, table::summary)
}

/// What merging did, in one line.
fn told(report: &MergeReport) -> String {
    let [before, after] = report.disagreement_m.map(|metres| 1e3 * metres);
    let [all, kept] = report.gaussians;
    let shared = report.shared_keyframes;
    format!(
        "{} groups, {shared} shared keyframes {before:.2} mm apart before and {after:.2} mm after, {kept} of {all} Gaussians",
        report.groups
    )
}
