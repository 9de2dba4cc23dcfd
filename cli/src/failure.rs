//! From errors to one line, a hint and an exit code.

use std::error::Error;
use std::fmt;
use std::io;
use std::path::Path;

use mba_mapper::FileError;
use mba_mapper::checkpoint::CheckpointError;
use mba_mapper::output::OutputError;
use mba_mapper::run::RunError;

use crate::interrupt;

/// Exit code of wrong use or bad input.
pub const BAD_INPUT: u8 = 2;
/// Exit code of a failure that is not the input's fault.
pub const FAILED: u8 = 1;
/// Exit code of a group of a job that was stopped: whoever started it should try again (EX_TEMPFAIL of sysexits.h).
pub const TRY_AGAIN: u8 = 75;

/// An error that the user can repair, with advice.
#[derive(Debug)]
pub struct BadInput {
    source: Box<dyn Error + Send + Sync>,
    hint: String,
}

impl fmt::Display for BadInput {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.source)
    }
}

impl Error for BadInput {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.source.source()
    }
}

/// Marks errors as the input's fault.
pub trait OrBadInput<T> {
    /// Turns the error into [`BadInput`] with `hint` as advice.
    ///
    /// # Errors
    /// The marked error.
    fn or_bad_input(self, hint: impl Into<String>) -> anyhow::Result<T>;

    /// [`or_bad_input`](Self::or_bad_input) for errors about what a file holds that do not name the file.
    ///
    /// # Errors
    /// The marked error, after the name of the file.
    fn or_bad_content(self, of: &Path, hint: impl Into<String>) -> anyhow::Result<T>;
}

impl<T, E: Into<Box<dyn Error + Send + Sync>>> OrBadInput<T> for Result<T, E> {
    fn or_bad_input(self, hint: impl Into<String>) -> anyhow::Result<T> {
        self.map_err(|source| BadInput { source: source.into(), hint: hint.into() }.into())
    }

    fn or_bad_content(self, of: &Path, hint: impl Into<String>) -> anyhow::Result<T> {
        self.map_err(|source| bad_input(format!("{}: {}", of.display(), source.into()), hint))
    }
}

/// A command that stopped because a signal asked for it, with the command that goes on.
#[derive(Debug)]
pub struct Interrupted {
    what: String,
    hint: String,
    /// Exit code; that of the signal unless it is given.
    code: Option<u8>,
}

impl fmt::Display for Interrupted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)
    }
}

impl Error for Interrupted {}

/// An [`Interrupted`] after `what`.
pub fn interrupted(what: impl Into<String>, hint: impl Into<String>) -> anyhow::Error {
    Interrupted { what: what.into(), hint: hint.into(), code: None }.into()
}

/// As [`interrupted`], for what is started by a program that tries again after [`TRY_AGAIN`].
pub fn try_again(what: impl Into<String>, hint: impl Into<String>) -> anyhow::Error {
    Interrupted { what: what.into(), hint: hint.into(), code: Some(TRY_AGAIN) }.into()
}

/// A failure that is not a matter of wrong use, with advice.
#[derive(Debug)]
pub struct Failed {
    message: String,
    hint: String,
}

impl fmt::Display for Failed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl Error for Failed {}

/// A [`Failed`] with its advice.
pub fn failed(message: impl Into<String>, hint: impl Into<String>) -> anyhow::Error {
    Failed { message: message.into(), hint: hint.into() }.into()
}

/// A [`BadInput`] without an underlying error.
pub fn bad_input(message: impl Into<String>, hint: impl Into<String>) -> anyhow::Error {
    BadInput { source: message.into().into(), hint: hint.into() }.into()
}

/// Exit code of an error.
#[must_use]
pub fn exit_code(error: &anyhow::Error) -> u8 {
    if error.is::<BadInput>() {
        BAD_INPUT
    } else if let Some(interrupted) = error.downcast_ref::<Interrupted>() {
        interrupted.code.unwrap_or_else(interrupt::exit_code)
    } else {
        FAILED
    }
}

/// `error: ...` with its causes on one line and, where there is advice, `hint: ...` on the next.
#[must_use]
pub fn message(error: &anyhow::Error) -> String {
    let text = format!("error: {}", causes(error));
    match hint(error) {
        Some(hint) => format!("{text}\nhint: {hint}"),
        None => text,
    }
}

/// An error and what caused it, on one line.
#[must_use]
pub fn causes(error: &anyhow::Error) -> String {
    let mut text = String::new();
    let mut last = String::new();
    for cause in error.chain().map(|cause| cause.to_string().replace('\n', " ")) {
        // Many libraries repeat the cause inside their own message.
        if !last.contains(&cause) {
            if !last.is_empty() {
                text.push_str(": ");
            }
            text.push_str(&cause);
            last = cause;
        }
    }
    text
}

/// The advice of an error, where there is one.
#[must_use]
pub fn hint(error: &anyhow::Error) -> Option<&str> {
    if let Some(bad) = error.downcast_ref::<BadInput>() {
        return (!bad.hint.is_empty()).then_some(&bad.hint);
    }
    if let Some(interrupted) = error.downcast_ref::<Interrupted>() {
        return Some(&interrupted.hint);
    }
    if let Some(failed) = error.downcast_ref::<Failed>() {
        return Some(&failed.hint);
    }
    error
        .chain()
        .any(is_disk_full)
        .then_some("make room and start again; what had been finished before is still there")
}

/// Whether an error, leaving its causes aside, says that nothing more fits on the disk.
#[must_use]
pub fn is_disk_full(error: &(dyn Error + 'static)) -> bool {
    let is_full = |reason: &io::Error| reason.kind() == io::ErrorKind::StorageFull;
    let of_file =
        |error: &FileError| matches!(error, FileError::Unwritable { reason, .. } if is_full(reason));
    let of_output = |error: &OutputError| matches!(error, OutputError::File(error) if of_file(error));
    match error.downcast_ref() {
        Some(RunError::DiskFull { .. }) => return true,
        Some(RunError::Output(error)) => return of_output(error),
        _ => {}
    }
    if let Some(CheckpointError::File(error)) = error.downcast_ref() {
        return of_file(error);
    }
    error.downcast_ref().is_some_and(of_file)
        || error.downcast_ref().is_some_and(of_output)
        || error.downcast_ref().is_some_and(is_full)
}

#[cfg(test)]
mod tests {
    use anyhow::Context;

    use super::*;

    #[test]
    fn bad_input_has_a_hint_and_code_2() {
        let error = bad_input("rgb.txt:3: no such image", "remove the line");
        assert_eq!(exit_code(&error), 2);
        assert_eq!(message(&error), "error: rgb.txt:3: no such image\nhint: remove the line");
    }

    #[test]
    fn context_keeps_the_code() {
        let error =
            Err::<(), _>(bad_input("no calibration", "add one")).context("cannot open data").unwrap_err();
        assert_eq!(exit_code(&error), 2);
        assert_eq!(message(&error), "error: cannot open data: no calibration\nhint: add one");
    }

    #[test]
    fn other_errors_are_failures_on_one_line() {
        let error = anyhow::anyhow!("first\nsecond");
        assert_eq!(exit_code(&error), 1);
        assert_eq!(message(&error), "error: first second");
    }
}
