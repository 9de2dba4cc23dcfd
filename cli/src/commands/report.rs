//! `mba report`.

use std::path::Path;

use mba_mapper::run::path_of;
use serde::Serialize;

use super::open;
use crate::args::Report;
use crate::console::Console;
use crate::report;

/// What is printed.
#[derive(Serialize)]
struct Written {
    report: String,
}

/// Writes `report.html` and the charts into a RUN folder.
///
/// # Errors
/// Bad input when the folder is not a run; failure when it cannot be written.
pub fn run(args: &Report, console: &Console) -> anyhow::Result<()> {
    let run = open::run(&args.run)?;
    let folder = args.dataset.clone().unwrap_or_else(|| path_of(&run.summary.settings.dataset));
    let dataset =
        if args.dataset.is_some() { Some(open::dataset(&folder)?) } else { open_if_there(&folder, console) };
    let path = report::write(&run, dataset.as_ref(), args.force)?;
    console.result(&Written { report: path.display().to_string() }, |written| {
        format!("wrote {}", written.report)
    })
}

/// The run's own data set; without it the report lacks the truth, nothing else.
fn open_if_there(folder: &Path, console: &Console) -> Option<mba_mapper::dataset::Dataset> {
    let dataset = mba_mapper::dataset::open(folder);
    if let Err(error) = &dataset {
        console.warning(format!("the report shows no ground truth, {error}; --dataset names another place"));
    }
    dataset.ok()
}
