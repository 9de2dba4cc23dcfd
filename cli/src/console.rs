//! What the user sees: results on stdout, notes and progress on stderr. A program that calls a command hears the same.

use std::io::{self, IsTerminal, Write};
use std::sync::{Arc, Mutex, PoisonError};

use serde::Serialize;

use crate::args::Global;
use crate::progress::{Progress, Standing};

/// Where a command reports to.
#[derive(Clone, Debug)]
pub struct Console {
    /// Figures go to stdout as JSON instead of a table.
    pub json: bool,
    quiet: bool,
    verbose: bool,
    /// A program that called the command, and hears all that people would see.
    listener: Option<Arc<Listener>>,
}

/// What a program that calls a command hears.
#[derive(Debug, Default)]
pub struct Listener {
    heard: Mutex<Heard>,
    standing: Arc<Mutex<Standing>>,
}

/// What a command said.
#[derive(Clone, Debug, Default)]
pub struct Heard {
    /// Its figures as JSON, as with `--json`.
    pub result: Option<String>,
    /// What was odd.
    pub warnings: Vec<String>,
    /// What somebody who watches would be told.
    pub notes: Vec<String>,
}

impl Listener {
    /// Takes what was said since the last call.
    pub fn take(&self) -> Heard {
        std::mem::take(&mut *self.heard.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// How far the command is.
    #[must_use]
    pub fn standing(&self) -> Standing {
        self.standing.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn hear(&self, change: impl FnOnce(&mut Heard)) {
        change(&mut self.heard.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

impl Console {
    /// The console that the global options ask for.
    #[must_use]
    pub fn new(global: &Global) -> Self {
        Self { json: global.json, quiet: global.quiet, verbose: global.verbose, listener: None }
    }

    /// A console that a program listens to.
    #[must_use]
    pub fn heard_by(global: &Global, listener: Arc<Listener>) -> Self {
        Self { listener: Some(listener), ..Self::new(global) }
    }

    /// Prints `value` as JSON or, without `--json`, the text that `table` makes.
    ///
    /// # Errors
    /// When stdout cannot be written; a reader that has gone away is no error.
    pub fn result<T: Serialize>(&self, value: &T, table: impl FnOnce(&T) -> String) -> anyhow::Result<()> {
        let text = if self.json || self.listener.is_some() {
            serde_json::to_string_pretty(value)?
        } else {
            table(value)
        };
        if let Some(listener) = &self.listener {
            listener.hear(|heard| heard.result = Some(text));
            return Ok(());
        }
        match writeln!(io::stdout().lock(), "{}", text.trim_end()) {
            Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error.into()),
            _ => Ok(()),
        }
    }

    /// A line for somebody who watches; nothing with `-q`.
    pub fn note(&self, text: impl AsRef<str>) {
        if let Some(listener) = &self.listener {
            listener.hear(|heard| heard.notes.push(text.as_ref().to_owned()));
        } else if !self.quiet {
            eprintln!("{}", text.as_ref());
        }
    }

    /// A line with `-v` only.
    pub fn detail(&self, text: impl AsRef<str>) {
        if self.verbose {
            self.note(text);
        }
    }

    /// Something odd in the input that does not stop the work; shown even with `-q`.
    pub fn warning(&self, text: impl AsRef<str>) {
        match &self.listener {
            Some(listener) => listener.hear(|heard| heard.warnings.push(text.as_ref().to_owned())),
            None => eprintln!("warning: {}", text.as_ref()),
        }
    }

    /// Progress over `steps` steps with an estimate of the time left: a bar on a terminal, elsewhere a line for every tenth
    /// or every ten seconds, nothing with `-q`.
    #[must_use]
    pub fn progress(&self, steps: usize, label: &'static str) -> Progress {
        match &self.listener {
            Some(listener) => Progress::for_caller(Arc::clone(&listener.standing), steps, label),
            None if self.quiet => Progress::hidden(),
            None if io::stderr().is_terminal() => Progress::on_terminal(steps, label),
            None => Progress::in_log(steps, label),
        }
    }
}
