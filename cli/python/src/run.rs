//! RUN folders.

use std::path::PathBuf;

use mba_mapper::run;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::dataset::exposure_arrays;
use crate::errors;

/// What a RUN folder holds, by the names of the attributes of Python's `Run`.
#[pyfunction]
pub(crate) fn read_run<'py>(py: Python<'py>, folder: PathBuf) -> PyResult<Bound<'py, PyDict>> {
    let run = py.detach(|| run::Run::open(&folder)).map_err(|error| errors::input(py, error))?;
    let summary = serde_json::to_string(&run.summary).map_err(|error| errors::input(py, error))?;
    let (timestamps, opening, poses, closing) = exposure_arrays(py, &run.exposures)?;
    let numbers = |value: fn(&run::FrameRecord) -> f64| PyArray1::from_iter(py, run.frames.iter().map(value));
    let held = PyDict::new(py);
    held.set_item("summary", summary)?;
    held.set_item("timestamps", timestamps)?;
    held.set_item("poses", poses)?;
    held.set_item("opening", opening)?;
    held.set_item("closing", closing)?;
    let statuses: Vec<&str> = run.frames.iter().map(|frame| frame.status.name()).collect();
    held.set_item("status", statuses)?;
    let is_keyframe = run.frames.iter().map(|frame| frame.keyframe != 0);
    held.set_item("is_keyframe", PyArray1::from_iter(py, is_keyframe))?;
    held.set_item("blur_px", numbers(|frame| frame.blur_px))?;
    held.set_item("milliseconds", numbers(|frame| frame.ms))?;
    held.set_item("sigma_m", numbers(|frame| frame.sigma_m.unwrap_or(f64::NAN)))?;
    Ok(held)
}
