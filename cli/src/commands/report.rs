//! `mba report`.

use mba_tracker::SimdLevel;
use serde::Serialize;

use super::open;
use crate::args::Report;
use crate::console::Console;
use crate::report;
use crate::written_run::advise_report;

/// What is printed.
#[derive(Serialize)]
struct Written {
    report: String,
}

/// Writes `report.html` and the charts into a RUN folder.
///
/// # Errors
/// Bad input when the folder is not a run; failure when it cannot be written.
pub fn run(args: &Report, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let run = open::run(&args.run)?;
    let dataset = open::dataset_if_there(&run, args.dataset.as_deref(), simd, console)?;
    let path = report::write(&run, simd, dataset.as_ref(), args.force).or_else(advise_report)?;
    console.result(&Written { report: path.display().to_string() }, |written| {
        format!("wrote {}", written.report)
    })
}
