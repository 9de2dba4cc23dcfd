//! `mba status`.

use std::fmt::Write as _;

use mba_mapper::submaps::{GroupState, JobStatus};

use super::job;
use crate::args::submaps::Status;
use crate::console::Console;

/// Prints how far a job is.
///
/// # Errors
/// Bad input when there is no job.
pub fn run(args: &Status, console: &Console) -> anyhow::Result<()> {
    console.result(&JobStatus::of(&job::open_job(&args.job)?), table)
}

/// The groups of a job, one line each.
#[must_use]
pub fn table(status: &JobStatus) -> String {
    let mut text =
        format!("{:>6}{:>10}{:>11}{:>9}{:>9}\n", "group", "state", "keyframes", "border", "frames");
    for group in &status.groups {
        let state = match group.state {
            GroupState::Waiting => "waiting",
            GroupState::Begun => "begun",
            GroupState::Stale => "stale",
            GroupState::Done => "done",
        };
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:>6}{state:>10}{:>11}{:>9}{:>9}",
            group.group, group.keyframes, group.border, group.frames
        );
    }
    let _ = writeln!(text, "{} of {} groups are mapped", status.done, status.groups.len());
    text
}
