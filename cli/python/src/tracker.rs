//! The tracker, frame by frame.

use std::sync::{Mutex, PoisonError};

use mba_tracker::photometric::Vignetting;
use mba_tracker::{
    Frame, GyroReading, Readout, ReferenceMode, ReferenceView, SimdLevel, TrackerConfig,
    geometry::RigidTransform, trajectory::ExposureTrajectory,
};
use nalgebra::Vector3;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use self_cell::{MutBorrow, self_cell};

use crate::images::{ColourImage, DepthImage};
use crate::poses::{PoseArgument, matrix, pose};
use crate::{camera, errors};

self_cell!(
    /// A tracker and the memory that it works in.
    struct OwnedTracker {
        owner: MutBorrow<Vec<u8>>,
        #[not_covariant]
        dependent: BorrowedTracker,
    }
);

type BorrowedTracker<'a> = mba_tracker::Tracker<'a>;

/// Follows a camera frame by frame.
#[pyclass(frozen, module = "mba")]
pub(crate) struct Tracker {
    tracker: Mutex<OwnedTracker>,
    camera: Py<PyAny>,
    depth_scale: f64,
}

#[pymethods]
impl Tracker {
    #[new]
    #[pyo3(signature = (
        camera, *, blur = true, virtual_views = None, reference = "deblurred", depth_term = true, readout = 0.0,
        depth_readout = 0.0, depth_apart = false, vignetting = (0.0, 0.0)
    ))]
    #[expect(clippy::too_many_arguments, reason = "they have names in Python")]
    fn new(
        py: Python<'_>,
        camera: &Bound<'_, PyAny>,
        blur: bool,
        virtual_views: Option<usize>,
        reference: &str,
        depth_term: bool,
        readout: f64,
        depth_readout: f64,
        depth_apart: bool,
        vignetting: (f64, f64),
    ) -> PyResult<Self> {
        let eye = camera::camera(camera)?;
        let response = eye.inverse_response().map_err(|error| errors::config(py, error))?;
        let mut config = TrackerConfig::new(eye.pinhole(), (1.0 / eye.depth_scale) as f32, response);
        config.reference = match reference {
            "deblurred" => ReferenceMode::Deblurred,
            "raw" => ReferenceMode::Raw,
            other => {
                return Err(errors::config(py, format!("reference = {other}: deblurred or raw is needed")));
            }
        };
        config.align.blur = blur;
        config.align.depth_term = depth_term;
        if virtual_views == Some(0) {
            return Err(errors::config(py, "virtual_views = 0: one or more are needed"));
        }
        config.align.max_views =
            virtual_views.map_or(config.align.max_views, |views| views.min(config.align.max_views));
        config.readout = Readout { colour: readout, depth: depth_readout, depth_apart, ..Readout::GLOBAL };
        config.vignetting = Vignetting { a2: vignetting.0, a4: vignetting.1 };
        config.validate().map_err(|error| errors::config(py, error))?;
        let memory = MutBorrow::new(vec![0; config.workspace_len()]);
        let tracker = OwnedTracker::try_new(memory, |memory| {
            mba_tracker::Tracker::new(&config, SimdLevel::new(), memory.borrow_mut())
        });
        let tracker = Mutex::new(tracker.map_err(|error| errors::config(py, error))?);
        Ok(Self { tracker, camera: camera.clone().unbind(), depth_scale: eye.depth_scale })
    }

    #[getter]
    fn camera(&self, py: Python<'_>) -> Py<PyAny> {
        self.camera.clone_ref(py)
    }

    #[pyo3(signature = (
        rgb, depth, timestamp, *, exposure, depth_timestamp = None, angular_velocity = None,
        angular_acceleration = None, turned_by = None
    ))]
    #[expect(clippy::too_many_arguments, reason = "they have names in Python")]
    fn track(
        &self,
        py: Python<'_>,
        rgb: &Bound<'_, PyAny>,
        depth: &Bound<'_, PyAny>,
        timestamp: f64,
        exposure: f64,
        depth_timestamp: Option<f64>,
        angular_velocity: Option<[f64; 3]>,
        angular_acceleration: Option<[f64; 3]>,
        turned_by: Option<[f64; 3]>,
    ) -> PyResult<FrameResult> {
        let colour = ColourImage::of("rgb", rgb)?;
        let depth = DepthImage::of("depth", depth, self.depth_scale)?;
        let gyro = angular_velocity.map(|velocity| GyroReading {
            angular_velocity: Vector3::from(velocity),
            angular_acceleration: Vector3::from(angular_acceleration.unwrap_or_default()),
        });
        let frame = Frame {
            timestamp,
            exposure,
            depth_timestamp: depth_timestamp.unwrap_or(timestamp),
            colour: colour.view().map_err(|error| errors::frame(py, error))?,
            depth: depth.view().map_err(|error| errors::frame(py, error))?,
            angular_velocity: turned_by.map(Vector3::from),
            gyro,
            expected_path: None,
        };
        let result = py.detach(|| self.with(|tracker| tracker.track(&frame)));
        FrameResult::of(py, &result.map_err(|error| errors::frame(py, error))?)
    }

    #[pyo3(signature = (rgb, depth, world_from_camera))]
    fn set_reference(
        &self,
        py: Python<'_>,
        rgb: &Bound<'_, PyAny>,
        depth: &Bound<'_, PyAny>,
        world_from_camera: PoseArgument<'_>,
    ) -> PyResult<()> {
        let colour = ColourImage::of("rgb", rgb)?;
        let depth = DepthImage::of("depth", depth, self.depth_scale)?;
        let view = ReferenceView {
            colour: colour.view().map_err(|error| errors::frame(py, error))?,
            depth: depth.view().map_err(|error| errors::frame(py, error))?,
            world_from_camera: pose(py, "world_from_camera", &world_from_camera)?,
        };
        let set = py.detach(|| self.with(|tracker| tracker.set_reference(&view)));
        set.map_err(|error| errors::frame(py, error))
    }

    fn reset(&self, py: Python<'_>) {
        py.detach(|| self.with(|tracker| tracker.reset()));
    }
}

impl Tracker {
    fn with<R>(&self, work: impl FnOnce(&mut mba_tracker::Tracker<'_>) -> R) -> R {
        // A panic within leaves a tracker that is lost, not one that is unsound.
        let mut tracker = self.tracker.lock().unwrap_or_else(PoisonError::into_inner);
        tracker.with_dependent_mut(|_, tracker| work(tracker))
    }
}

type Pose = Py<PyArray2<f64>>;

/// What is known about a frame after tracking.
#[pyclass(frozen, get_all, module = "mba")]
pub(crate) struct FrameResult {
    index: usize,
    timestamp: f64,
    status: &'static str,
    doubt: Option<&'static str>,
    opening: Pose,
    middle: Pose,
    closing: Pose,
    blur_px: f32,
    virtual_views: usize,
    iterations: usize,
    residual: f32,
    inliers: f32,
    disagreement: f64,
    gain: f32,
    offset: f32,
    information: Pose,
    is_keyframe: bool,
    reference_index: usize,
    revision: Option<Py<Revision>>,
}

/// A better estimate of an earlier frame.
#[pyclass(frozen, get_all, module = "mba")]
pub(crate) struct Revision {
    index: usize,
    opening: Pose,
    middle: Pose,
    closing: Pose,
    blur_px: f32,
}

/// Opening, middle and closing.
fn poses(py: Python<'_>, path: &ExposureTrajectory, mid: &RigidTransform) -> PyResult<[Pose; 3]> {
    Ok([matrix(py, &path.start)?, matrix(py, mid)?, matrix(py, &path.end)?])
}

impl FrameResult {
    fn of(py: Python<'_>, result: &mba_tracker::FrameResult) -> PyResult<Self> {
        let [opening, middle, closing] = poses(py, &result.world_from_camera, &result.world_from_mid)?;
        // Symmetric: the order of rows and columns does not matter.
        let information = PyArray1::from_slice(py, result.information.as_slice());
        let unknowns = result.information.nrows();
        Ok(Self {
            index: result.index,
            timestamp: result.timestamp,
            status: result.status.name(),
            doubt: result.doubt.map(mba_tracker::Doubt::name),
            opening,
            middle,
            closing,
            blur_px: result.blur,
            virtual_views: result.virtual_views,
            iterations: result.iterations,
            residual: result.residual,
            inliers: result.inliers,
            disagreement: result.disagreement,
            gain: result.brightness.gain,
            offset: result.brightness.offset,
            information: information.reshape([unknowns, unknowns])?.unbind(),
            is_keyframe: result.is_keyframe,
            reference_index: result.reference_index,
            revision: result.revision.as_ref().map(|revision| Revision::of(py, revision)).transpose()?,
        })
    }
}

#[pymethods]
impl FrameResult {
    fn __repr__(&self) -> String {
        let Self { index, timestamp, status, blur_px, .. } = self;
        format!("FrameResult(index={index}, timestamp={timestamp}, status='{status}', blur_px={blur_px:.2})")
    }
}

impl Revision {
    fn of(py: Python<'_>, revision: &mba_tracker::Revision) -> PyResult<Py<Self>> {
        let [opening, middle, closing] = poses(py, &revision.world_from_camera, &revision.world_from_mid)?;
        Py::new(py, Self { index: revision.index, opening, middle, closing, blur_px: revision.blur })
    }
}
