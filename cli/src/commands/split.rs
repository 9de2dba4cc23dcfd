//! `mba split`.

use mba_mapper::output::{OutputFolder, Permission};
use mba_mapper::submaps::{JobStatus, SplitSettings, estimated_memory_bytes, split_run};
use mba_tracker::SimdLevel;

use super::status::table;
use super::{job, open};
use crate::args::submaps::Split;
use crate::console::Console;
use crate::written_run::{note_written, refuse};

/// Splits a run into groups and prints them.
///
/// # Errors
/// Bad input when run or data set cannot be used; failure when the plan cannot be written.
pub fn run(args: &Split, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let run = open::run(&args.run)?;
    let dataset = job::dataset_of(&run, args.dataset.as_deref(), simd)?;
    let inputs = [dataset.folder(), run.folder.as_path()];
    let permission = Permission { force: args.force, inputs: &inputs };
    let out = OutputFolder::for_job(&args.out, &permission).or_else(refuse)?;
    let program = concat!("mba ", env!("CARGO_PKG_VERSION"));
    let job = split_run(&dataset, &run, &SplitSettings::from(args), &out, program).or_else(job::refuse)?;
    note_written(&args.out, console);
    let camera = dataset.calibration().camera;
    let megabytes = estimated_memory_bytes(&job, camera.width * camera.height) as f64 / 1e6;
    console.note(format!("every group takes at most {megabytes:.0} MB of memory, about"));
    console.result(&JobStatus::of(&job), table)
}
