//! Data sets.

use std::ffi::OsString;
use std::path::PathBuf;

use mba_mapper::dataset::{self, TimedExposure};
use mba_mapper::run::RunCamera;
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

use crate::images::{colour_array, depth_array};
use crate::poses::matrices;
use crate::{camera, errors};

/// Times and poses.
pub(crate) type Trajectory = (Py<PyArray1<f64>>, Py<PyArray3<f64>>);

/// Times, and poses at opening, middle and closing.
pub(crate) type Exposures = (Py<PyArray1<f64>>, Py<PyArray3<f64>>, Py<PyArray3<f64>>, Py<PyArray3<f64>>);

/// A recorded RGB-D sequence.
#[pyclass(frozen, module = "mba")]
pub(crate) struct Dataset {
    dataset: dataset::Dataset,
}

#[pymethods]
impl Dataset {
    #[new]
    fn new(py: Python<'_>, folder: PathBuf) -> PyResult<Self> {
        let dataset = py.detach(|| dataset::open(&folder)).map_err(|error| errors::input(py, error))?;
        Ok(Self { dataset })
    }

    fn __len__(&self) -> usize {
        self.dataset.len()
    }

    fn __getitem__(&self, py: Python<'_>, index: isize) -> PyResult<RgbdFrame> {
        let count = self.dataset.len();
        let position = if index < 0 { index.checked_add_unsigned(count) } else { Some(index) };
        let position = position.and_then(|position| usize::try_from(position).ok()).filter(|at| *at < count);
        let position = position
            .ok_or_else(|| PyIndexError::new_err(format!("frame {index} of {count} does not exist")))?;
        let frame = py.detach(|| self.dataset.frame(position)).map_err(|error| errors::input(py, error))?;
        RgbdFrame::of(py, frame)
    }

    fn __repr__(&self) -> String {
        format!("Dataset('{}'): {} frames", self.dataset.folder().display(), self.dataset.len())
    }

    fn __fspath__(&self) -> OsString {
        self.dataset.folder().into()
    }

    #[getter]
    fn folder(&self) -> PathBuf {
        self.dataset.folder().to_owned()
    }

    #[getter]
    fn camera<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        camera::to_python(py, &RunCamera::from(self.dataset.calibration()))
    }

    #[getter]
    fn frame_rate(&self) -> f64 {
        self.dataset.calibration().frame_rate
    }

    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.dataset.warnings().iter().map(ToString::to_string).collect()
    }

    #[getter]
    fn timestamps(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        let times = (0..self.dataset.len()).map(|index| self.dataset.timestamp(index));
        PyArray1::from_iter(py, times).unbind()
    }

    #[getter]
    fn exposure_seconds(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        let times = (0..self.dataset.len()).map(|index| self.dataset.exposure_seconds(index));
        PyArray1::from_iter(py, times).unbind()
    }

    #[getter]
    fn ground_truth(&self, py: Python<'_>) -> PyResult<Option<Trajectory>> {
        let poses = self.dataset.ground_truth();
        if poses.is_empty() {
            return Ok(None);
        }
        let times = PyArray1::from_iter(py, poses.iter().map(|pose| pose.timestamp)).unbind();
        Ok(Some((times, matrices(py, poses.iter().map(|pose| pose.world_from_camera))?.unbind())))
    }

    #[getter]
    fn ground_truth_exposures(&self, py: Python<'_>) -> PyResult<Option<Exposures>> {
        let exposures = self.dataset.ground_truth_exposures();
        (!exposures.is_empty()).then(|| exposure_arrays(py, exposures)).transpose()
    }
}

/// Exposures as four arrays.
pub(crate) fn exposure_arrays(py: Python<'_>, exposures: &[TimedExposure]) -> PyResult<Exposures> {
    let times = PyArray1::from_iter(py, exposures.iter().map(|exposure| exposure.timestamp)).unbind();
    let opening = matrices(py, exposures.iter().map(|exposure| exposure.start))?.unbind();
    let middle = matrices(py, exposures.iter().map(|exposure| exposure.mid))?.unbind();
    let closing = matrices(py, exposures.iter().map(|exposure| exposure.end))?.unbind();
    Ok((times, opening, middle, closing))
}

/// One frame of a data set.
#[pyclass(frozen, get_all, module = "mba")]
pub(crate) struct RgbdFrame {
    index: usize,
    timestamp: f64,
    depth_timestamp: f64,
    exposure_seconds: f64,
    rgb: Py<PyArray3<u8>>,
    depth: Py<PyArray2<u16>>,
}

impl RgbdFrame {
    fn of(py: Python<'_>, frame: dataset::RgbdFrame) -> PyResult<Self> {
        let size = [frame.width, frame.height];
        Ok(Self {
            index: frame.index,
            timestamp: frame.timestamp,
            depth_timestamp: frame.depth_timestamp,
            exposure_seconds: frame.exposure_seconds,
            rgb: colour_array(py, frame.rgb, size)?,
            depth: depth_array(py, frame.depth, size)?,
        })
    }
}
