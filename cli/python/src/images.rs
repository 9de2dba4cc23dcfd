//! Images of numpy as the tracker takes them, without a copy where their rows lie one after the other.

use mba_tracker::image::{ColourView, DepthView, ExtentError, PixelFormat};
use numpy::{
    Element, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::errors;

/// Values of an array in the order of its indices.
enum Values<'py, T: Element> {
    Lent(PyReadonlyArrayDyn<'py, T>),
    Copied(Vec<T>),
}

impl<'py, T: Element + Copy> Values<'py, T> {
    fn of(array: PyReadonlyArrayDyn<'py, T>) -> Self {
        // Columns after each other, as Fortran has them, are contiguous as well.
        if array.is_c_contiguous() {
            Self::Lent(array)
        } else {
            Self::Copied(array.as_array().iter().copied().collect())
        }
    }

    fn as_slice(&self) -> &[T] {
        match self {
            // It was looked at when it was lent.
            Self::Lent(array) => array.as_slice().unwrap_or_default(),
            Self::Copied(values) => values,
        }
    }
}

/// What an array is, for messages.
fn described(value: &Bound<'_, PyAny>) -> String {
    match value.cast::<PyUntypedArray>() {
        Ok(array) => format!("{} of shape {:?}", array.dtype(), array.shape()),
        Err(_) => value.get_type().to_string(),
    }
}

/// A colour or grey image.
pub(crate) struct ColourImage<'py> {
    values: Values<'py, u8>,
    size: (usize, usize),
    format: PixelFormat,
}

impl<'py> ColourImage<'py> {
    /// An array of bytes with rows, columns and, unless it is grey, red, green and blue.
    pub(crate) fn of(name: &str, value: &Bound<'py, PyAny>) -> PyResult<Self> {
        let refuse = || {
            let needed = "bytes of shape (height, width, 3) or (height, width) are needed";
            errors::input(value.py(), format!("{name}: {needed}, not {}", described(value)))
        };
        let array: PyReadonlyArrayDyn<'py, u8> = value.extract().map_err(|_| refuse())?;
        let (size, format) = match *array.shape() {
            [height, width] => ((width, height), PixelFormat::Grey8),
            [height, width, 3] => ((width, height), PixelFormat::Rgb8),
            _ => return Err(refuse()),
        };
        Ok(Self { values: Values::of(array), size, format })
    }

    /// Columns and rows.
    pub(crate) fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Its bytes.
    pub(crate) fn bytes(&self) -> &[u8] {
        self.values.as_slice()
    }

    /// As the tracker takes it.
    pub(crate) fn view(&self) -> Result<ColourView<'_>, ExtentError> {
        let (width, height) = self.size;
        ColourView::new(self.values.as_slice(), width, height, self.format.bytes() * width, self.format)
    }
}

/// A depth image in raw units.
pub(crate) struct DepthImage<'py> {
    values: Values<'py, u16>,
    size: (usize, usize),
}

impl<'py> DepthImage<'py> {
    /// An array of raw units, 16 bit, or of metres as floating-point numbers, of which `scale` units are one.
    pub(crate) fn of(name: &str, value: &Bound<'py, PyAny>, scale: f64) -> PyResult<Self> {
        let refuse = || {
            let needed =
                "uint16 (raw units) or floating-point numbers (metres) of shape (height, width) are needed";
            errors::input(value.py(), format!("{name}: {needed}, not {}", described(value)))
        };
        let size = |shape: &[usize]| match *shape {
            [height, width] => Ok((width, height)),
            _ => Err(refuse()),
        };
        if let Ok(array) = value.extract::<PyReadonlyArrayDyn<'py, u16>>() {
            return Ok(Self { size: size(array.shape())?, values: Values::of(array) });
        }
        // What is not finite, behind the camera or too far for 16 bits is missing.
        let raw = |metres: f64| {
            let units = (metres * scale).round();
            if units >= 0.0 && units < f64::from(u16::MAX) { units as u16 } else { 0 }
        };
        if let Ok(array) = value.extract::<PyReadonlyArrayDyn<'py, f32>>() {
            let values = array.as_array().iter().map(|metres| raw(f64::from(*metres))).collect();
            return Ok(Self { size: size(array.shape())?, values: Values::Copied(values) });
        }
        let array: PyReadonlyArrayDyn<'py, f64> = value.extract().map_err(|_| refuse())?;
        let values = array.as_array().iter().map(|metres| raw(*metres)).collect();
        Ok(Self { size: size(array.shape())?, values: Values::Copied(values) })
    }

    /// As the tracker takes it.
    pub(crate) fn view(&self) -> Result<DepthView<'_>, ExtentError> {
        let (width, height) = self.size;
        DepthView::new(self.values.as_slice(), width, height, width)
    }
}

/// A colour image for Python, which takes the memory over.
pub(crate) fn colour_array(
    py: Python<'_>,
    rgb: Vec<u8>,
    [width, height]: [usize; 2],
) -> PyResult<Py<PyArray3<u8>>> {
    Ok(PyArray1::from_vec(py, rgb).reshape([height, width, 3])?.unbind())
}

/// A depth image for Python, which takes the memory over.
pub(crate) fn depth_array<T: Element>(
    py: Python<'_>,
    depth: Vec<T>,
    [width, height]: [usize; 2],
) -> PyResult<Py<PyArray2<T>>> {
    Ok(PyArray1::from_vec(py, depth).reshape([height, width])?.unbind())
}
