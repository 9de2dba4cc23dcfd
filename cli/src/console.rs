//! What the user sees: results on stdout, notes and progress on stderr.

use std::io::{self, Write};

use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::args::Global;

/// Where a command reports to.
#[derive(Clone, Copy, Debug)]
pub struct Console {
    /// Figures go to stdout as JSON instead of a table.
    pub json: bool,
    quiet: bool,
    verbose: bool,
}

impl Console {
    /// The console that the global options ask for.
    #[must_use]
    pub fn new(global: &Global) -> Self {
        Self { json: global.json, quiet: global.quiet, verbose: global.verbose }
    }

    /// Prints `value` as JSON or, without `--json`, the text that `table` makes.
    ///
    /// # Errors
    /// When stdout cannot be written; a reader that has gone away is no error.
    pub fn result<T: Serialize>(&self, value: &T, table: impl FnOnce(&T) -> String) -> anyhow::Result<()> {
        let text = if self.json { serde_json::to_string_pretty(value)? } else { table(value) };
        match writeln!(io::stdout().lock(), "{}", text.trim_end()) {
            Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error.into()),
            _ => Ok(()),
        }
    }

    /// A line for somebody who watches; nothing with `-q`.
    pub fn note(&self, text: impl AsRef<str>) {
        if !self.quiet {
            eprintln!("{}", text.as_ref());
        }
    }

    /// A line with `-v` only.
    pub fn detail(&self, text: impl AsRef<str>) {
        if self.verbose {
            eprintln!("{}", text.as_ref());
        }
    }

    /// Something odd in the input that does not stop the work; shown even with `-q`.
    pub fn warning(&self, text: impl AsRef<str>) {
        eprintln!("warning: {}", text.as_ref());
    }

    /// A progress bar over `steps` steps with an estimate of the time left; invisible with `-q` or when stderr is not
    /// a terminal.
    #[must_use]
    pub fn progress(&self, steps: usize, label: &'static str) -> ProgressBar {
        if self.quiet {
            return ProgressBar::hidden();
        }
        let style = ProgressStyle::with_template("{msg:>12} {bar:32} {pos}/{len}  {per_sec}, {eta} left")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        ProgressBar::new(steps as u64).with_style(style).with_message(label)
    }
}
