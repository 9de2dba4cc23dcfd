//! Maps and their views.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use mba_mapper::gaussians::{COLOUR, LOG_SCALE, MEAN, OPACITY_LOGIT, ROTATION};
use mba_mapper::map::StoredMap;
use mba_mapper::rendering::{Behind, ViewRenderer};
use mba_mapper::run::{self, RunCamera};
use mba_tracker::SimdLevel;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use self_cell::self_cell;

use crate::images::{colour_array, depth_array};
use crate::poses::{PoseArgument, pose};
use crate::{camera, errors};

self_cell!(
    /// A renderer, which keeps its memory from view to view, and the map that it renders.
    struct OwnedRenderer {
        owner: Arc<StoredMap>,
        #[not_covariant]
        dependent: ViewRenderer,
    }
);

/// The map of a run.
#[pyclass(frozen, module = "mba")]
pub(crate) struct Map {
    map: Arc<StoredMap>,
    camera: Option<RunCamera>,
    /// For the camera that was used last.
    renderer: Mutex<Option<(RunCamera, OwnedRenderer)>>,
}

#[pymethods]
impl Map {
    #[staticmethod]
    fn load(py: Python<'_>, run: PathBuf) -> PyResult<Self> {
        let refuse = |error: &dyn std::fmt::Display| errors::input(py, error);
        let camera = run::Run::open(&run).map_err(|error| refuse(&error))?.summary.settings.camera;
        let Some(path) = StoredMap::path(&run) else {
            return Err(refuse(&format!("{} has no map", run.display())));
        };
        let map = py.detach(|| StoredMap::read(&path)).map_err(|error| refuse(&error))?;
        Ok(Self { map: Arc::new(map), camera, renderer: Mutex::new(None) })
    }

    #[getter]
    fn kind(&self) -> &'static str {
        match *self.map {
            StoredMap::Gaussians(_) => "gaussians",
            StoredMap::Field(_) => "triplane",
        }
    }

    #[getter]
    fn camera<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.camera.as_ref().map(|camera| camera::to_python(py, camera)).transpose()
    }

    fn __len__(&self) -> usize {
        self.map.gaussians()
    }

    fn __repr__(&self) -> String {
        match *self.map {
            StoredMap::Gaussians(ref map) => format!("Map of {} Gaussians", map.len()),
            StoredMap::Field(_) => "Map that is a tri-plane field".to_owned(),
        }
    }

    #[pyo3(signature = (world_from_camera, camera = None, *, fill = true))]
    fn render(
        &self,
        py: Python<'_>,
        world_from_camera: PoseArgument<'_>,
        camera: Option<&Bound<'_, PyAny>>,
        fill: bool,
    ) -> PyResult<View> {
        let pose = pose(py, "world_from_camera", &world_from_camera)?;
        let eye = match (camera, &self.camera) {
            (Some(camera), _) => camera::camera(camera)?,
            (None, Some(camera)) => camera.clone(),
            (None, None) => return Err(errors::input(py, "the run does not tell its camera; give one")),
        };
        let behind = if fill { Behind::Surroundings } else { Behind::Black };
        let response = eye.inverse_response().map_err(|error| errors::input(py, error))?;
        let scale = eye.depth_scale;
        let view = py.detach(|| {
            let mut kept = self.renderer.lock().unwrap_or_else(PoisonError::into_inner);
            if kept.as_ref().is_none_or(|(camera, _)| *camera != eye) {
                let renderer = OwnedRenderer::new(Arc::clone(&self.map), |map| {
                    let camera = eye.pinhole();
                    ViewRenderer::new(SimdLevel::new(), &**map, camera, &response, eye.depth_scale)
                });
                *kept = Some((eye, renderer));
            }
            let renderer = kept.as_mut().map(|(_, renderer)| renderer);
            renderer.map(|owned| owned.with_dependent_mut(|_, renderer| renderer.render(&pose, behind)))
        });
        let view = view.ok_or_else(|| errors::input(py, "there is no renderer"))?;
        let depth = view.depth.iter().map(|units| (f64::from(*units) / scale) as f32).collect();
        Ok(View {
            rgb: colour_array(py, view.rgb, view.size)?,
            depth: depth_array(py, depth, view.size)?,
            solid: view.solid,
        })
    }

    fn gaussians<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let StoredMap::Gaussians(map) = &*self.map else {
            return Err(errors::input(py, "a tri-plane field has no Gaussians"));
        };
        // Parameters lie in planes; numpy wants those of a Gaussian side by side.
        let columns = |first: usize, count: usize, of: fn(f32) -> f32| {
            let planes: Vec<&[f32]> =
                (first..first + count).map(|index| map.planes()[index].as_slice()).collect();
            let values: Vec<f32> =
                (0..map.len()).flat_map(|row| planes.iter().map(move |plane| of(plane[row]))).collect();
            PyArray1::from_vec(py, values).reshape([map.len(), count])
        };
        let held = PyDict::new(py);
        held.set_item("means", columns(MEAN, 3, |value| value)?)?;
        held.set_item("scales", columns(LOG_SCALE, 3, f32::exp)?)?;
        held.set_item("quaternions_wxyz", columns(ROTATION, 4, |value| value)?)?;
        let opacities = columns(OPACITY_LOGIT, 1, |logit| 1.0 / (1.0 + (-logit).exp()))?;
        held.set_item("opacities", opacities.reshape([map.len()])?)?;
        held.set_item("linear_rgb", columns(COLOUR, 3, |value| value)?)?;
        Ok(held)
    }
}

/// A rendered view.
#[pyclass(frozen, get_all, module = "mba")]
pub(crate) struct View {
    rgb: Py<PyArray3<u8>>,
    depth: Py<PyArray2<f32>>,
    solid: f64,
}
