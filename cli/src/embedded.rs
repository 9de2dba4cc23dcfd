//! The commands for a program that calls them: Python's package does.

use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;

use clap::Parser;

use crate::args::Cli;
use crate::console::{Console, Listener};
use crate::failure::{bad_input, interrupted};
use crate::interrupt::GivenUp;

/// Runs a command line (program name first) in this thread and in workers of its own; `listener` hears what it says.
/// [`crate::interrupt::ask`] stops it.
///
/// # Errors
/// As [`crate::run`]; [`crate::failure::Interrupted`] when it was stopped, and bad input for arguments that make no sense.
pub fn call(arguments: impl IntoIterator<Item = OsString>, listener: &Arc<Listener>) -> anyhow::Result<()> {
    let cli = Cli::try_parse_from(arguments).map_err(|error| wrong_use(&error))?;
    let console = Console::heard_by(&cli.global, Arc::clone(listener));
    // Files are built beside their places, so that a command that was given up leaves what was there before.
    match catch_unwind(AssertUnwindSafe(|| crate::run_with(&cli, &console))) {
        Ok(outcome) => outcome,
        Err(cause) if cause.is::<GivenUp>() => Err(interrupted("stopped before it was done", "")),
        Err(cause) => resume_unwind(cause),
    }
}

/// The first paragraph of what the parser says: the rest is about the command line.
fn wrong_use(error: &clap::Error) -> anyhow::Error {
    let text = error.render().to_string();
    let paragraph = text.split("\n\n").next().unwrap_or_default();
    let lines: Vec<&str> = paragraph.lines().map(str::trim).collect();
    let said = lines.join(" ");
    bad_input(said.strip_prefix("error: ").unwrap_or(&said).to_owned(), "")
}
