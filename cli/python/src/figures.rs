//! Figures of images.

use mba_mapper::evaluation;
use pyo3::prelude::*;

use crate::errors;
use crate::images::ColourImage;

/// Peak signal-to-noise ratio of two images, dB.
#[pyfunction]
pub(crate) fn psnr(
    py: Python<'_>,
    reference: &Bound<'_, PyAny>,
    estimate: &Bound<'_, PyAny>,
) -> PyResult<f64> {
    let (reference, estimate) = pair(reference, estimate)?;
    evaluation::psnr(reference.bytes(), estimate.bytes()).map_err(|error| errors::input(py, error))
}

/// Structural similarity of two colour images.
#[pyfunction]
pub(crate) fn ssim(
    py: Python<'_>,
    reference: &Bound<'_, PyAny>,
    estimate: &Bound<'_, PyAny>,
) -> PyResult<f64> {
    let (reference, estimate) = pair(reference, estimate)?;
    let (size, bytes) = (reference.size(), [reference.bytes(), estimate.bytes()]);
    let found = py.detach(|| evaluation::ssim(size.into(), bytes[0], bytes[1]));
    found.map_err(|error| errors::input(py, error))
}

/// Two images of the same size.
fn pair<'py>(
    reference: &Bound<'py, PyAny>,
    estimate: &Bound<'py, PyAny>,
) -> PyResult<(ColourImage<'py>, ColourImage<'py>)> {
    let py = reference.py();
    let (reference, estimate) =
        (ColourImage::of("reference", reference)?, ColourImage::of("estimate", estimate)?);
    if reference.size() != estimate.size() {
        let [a, b] = [&reference, &estimate].map(|image| format!("{} x {}", image.size().0, image.size().1));
        return Err(errors::input(py, format!("the reference has {a} pixels, the estimate {b}")));
    }
    Ok((reference, estimate))
}
