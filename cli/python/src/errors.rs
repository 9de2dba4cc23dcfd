//! Errors as Python's exceptions, which `mba/_errors.py` defines.

use std::fmt::Display;

use mba_cli::failure::{BAD_INPUT, causes, exit_code, hint};
use pyo3::prelude::*;

/// The exception called `name`, with a message and perhaps advice.
fn exception(py: Python<'_>, name: &str, message: &str, hint: Option<&str>) -> PyErr {
    let made = py
        .import("mba._errors")
        .and_then(|module| module.getattr(name))
        .and_then(|class| class.call1((message, hint.unwrap_or_default())));
    match made {
        Ok(error) => PyErr::from_value(error),
        // The package is not whole.
        Err(error) => error,
    }
}

/// An `InputError`: what was given is wrong.
pub(crate) fn input(py: Python<'_>, message: impl Display) -> PyErr {
    exception(py, "InputError", &message.to_string(), None)
}

/// A `FrameError`: the tracker cannot use this frame.
pub(crate) fn frame(py: Python<'_>, message: impl Display) -> PyErr {
    exception(py, "FrameError", &message.to_string(), None)
}

/// A `ConfigError`: no tracker has such settings.
pub(crate) fn config(py: Python<'_>, message: impl Display) -> PyErr {
    exception(py, "ConfigError", &message.to_string(), None)
}

/// The error of a command.
pub(crate) fn of_command(py: Python<'_>, error: &anyhow::Error) -> PyErr {
    let name = if exit_code(error) == BAD_INPUT { "InputError" } else { "Error" };
    exception(py, name, &causes(error), hint(error))
}
