//! Cameras between Python's `Camera` and the rest.

use mba_mapper::run::{RunCamera, RunResponse};
use numpy::{AllowTypeChange, PyArray1, PyArrayLike1};
use pyo3::prelude::*;

use crate::errors;

/// The camera that the attributes of a `Camera` describe.
///
/// # Errors
/// An `InputError` for values that no camera has.
pub(crate) fn camera(value: &Bound<'_, PyAny>) -> PyResult<RunCamera> {
    let refuse = |what: String| errors::input(value.py(), format!("camera: {what}"));
    let number = |name: &str| -> PyResult<f64> { value.getattr(name)?.extract() };
    let pixels = |name: &str| -> PyResult<usize> { value.getattr(name)?.extract() };
    let response = value.getattr("response")?;
    let response = match response.extract::<String>().as_deref() {
        Ok("srgb") => RunResponse::Srgb,
        Ok("linear") => RunResponse::Linear,
        Ok(name) => {
            return Err(refuse(format!("response = {name}: srgb, linear or 256 numbers are needed")));
        }
        Err(_) => {
            let table: PyArrayLike1<'_, f64, AllowTypeChange> = response.extract()?;
            RunResponse::Table(table.as_array().iter().map(|light| *light as f32).collect())
        }
    };
    let camera = RunCamera {
        width: pixels("width")?,
        height: pixels("height")?,
        fx: number("fx")?,
        fy: number("fy")?,
        cx: number("cx")?,
        cy: number("cy")?,
        depth_scale: number("depth_scale")?,
        response,
    };
    camera.check().map_err(|error| refuse(error.to_string()))?;
    Ok(camera)
}

/// Python's `Camera`.
pub(crate) fn to_python<'py>(py: Python<'py>, camera: &RunCamera) -> PyResult<Bound<'py, PyAny>> {
    let RunCamera { width, height, fx, fy, cx, cy, depth_scale, .. } = *camera;
    let class = py.import("mba._camera")?.getattr("Camera")?;
    let response = match &camera.response {
        RunResponse::Srgb => "srgb".into_pyobject(py)?.into_any(),
        RunResponse::Linear => "linear".into_pyobject(py)?.into_any(),
        RunResponse::Table(table) => PyArray1::from_slice(py, table).into_any(),
    };
    class.call1((width, height, fx, fy, cx, cy, depth_scale, response))
}
