//! The commands of the program.

use std::ffi::OsString;
use std::sync::Arc;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use mba_cli::console::{Heard, Listener};
use mba_cli::failure::{Interrupted, causes};
use mba_cli::{embedded, interrupt, itself};
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError};
use pyo3::prelude::*;

use crate::errors;

/// Time between two looks at Python's signals while a command works.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Result as JSON, warnings and notes.
type Said = (Option<String>, Vec<String>, Vec<String>);

/// Runs a command in a thread of its own, with Python's lock released. Python's signal handlers run meanwhile; what they
/// raise stops the command, which saves what it has, and goes to the caller. `progress` is called with the share that is done
/// and what is being done.
#[pyfunction]
#[pyo3(signature = (arguments, progress = None, itself = None))]
pub(crate) fn call(
    py: Python<'_>,
    arguments: Vec<OsString>,
    progress: Option<&Bound<'_, PyAny>>,
    itself: Option<Vec<OsString>>,
) -> PyResult<Said> {
    itself.into_iter().for_each(itself::starts_with);
    let listener = Arc::new(Listener::default());
    let (sender, mut receiver) = mpsc::channel();
    let heard_by = Arc::clone(&listener);
    let work = move || sender.send(embedded::call(arguments, &heard_by));
    let worker = thread::Builder::new().name("mba".to_owned()).spawn(work)?;
    let mut raised: Option<PyErr> = None;
    let mut told = None;
    let outcome = loop {
        let receiver = &mut receiver;
        match py.detach(move || receiver.recv_timeout(LOOK_EVERY)) {
            Ok(outcome) => break Some(outcome),
            Err(RecvTimeoutError::Disconnected) => break None,
            Err(RecvTimeoutError::Timeout) if raised.is_some() => (),
            Err(RecvTimeoutError::Timeout) => {
                let looked = py.check_signals().and_then(|()| tell(&listener, &mut told, progress));
                if let Err(error) = looked {
                    interrupt::ask();
                    raised = Some(error);
                }
            }
        }
    };
    let joined = worker.join();
    if raised.is_some() {
        interrupt::withdraw();
    }
    let Some(outcome) = outcome.filter(|_| joined.is_ok()) else {
        return Err(PyRuntimeError::new_err("a fault inside mba; what it said is on the standard error"));
    };
    match (outcome, raised) {
        (Ok(()), None) => Ok(said(listener.take())),
        (Err(error), None) => Err(errors::of_command(py, &error)),
        (outcome, Some(raised)) => Err(stopped(py, outcome.err().as_ref(), raised)),
    }
}

/// Tells `progress` where the command stands, if that is news.
fn tell(
    listener: &Listener,
    told: &mut Option<mba_cli::progress::Standing>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<()> {
    let Some(progress) = progress else { return Ok(()) };
    let standing = listener.standing();
    if standing.message.is_empty() || told.as_ref() == Some(&standing) {
        return Ok(());
    }
    progress.call1((standing.share(), &standing.message))?;
    *told = Some(standing);
    Ok(())
}

/// What a signal handler raised; Ctrl-C says what became of the command.
fn stopped(py: Python<'_>, outcome: Option<&anyhow::Error>, raised: PyErr) -> PyErr {
    match outcome {
        Some(error) if error.is::<Interrupted>() && raised.is_instance_of::<PyKeyboardInterrupt>(py) => {
            PyKeyboardInterrupt::new_err(causes(error))
        }
        _ => raised,
    }
}

fn said(heard: Heard) -> Said {
    (heard.result, heard.warnings, heard.notes)
}

/// The program as a process: parses `arguments` (program name first) and returns the exit code. `itself` are the words that
/// start it again.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, arguments: Vec<OsString>, itself: Vec<OsString>) -> u8 {
    itself::starts_with(itself);
    py.detach(|| mba_cli::exit_code(arguments))
}
