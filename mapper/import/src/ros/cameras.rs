//! What a recording says of its cameras, and what that makes of the data set's calibration.

use std::path::Path;

use mba_io::dataset::{DepthCamera, check_camera};
use mba_tracker::geometry::{PinholeCamera, RigidTransform};

use super::frames::Frames;
use super::messages::CameraInfo;
use super::pixels::UNITS_OF_INTEGERS;
use crate::ImportError;
use crate::destination::Destination;
use crate::facts::Facts;
use crate::lens;

/// What messages said of cameras and of the places of sensors.
#[derive(Debug, Default)]
pub(super) struct Cameras {
    pub(super) colour: Option<CameraInfo>,
    pub(super) depth: Option<CameraInfo>,
    /// Names of the frames of images and of the IMU.
    pub(super) colour_frame: Option<String>,
    pub(super) depth_frame: Option<String>,
    pub(super) imu_frame: Option<String>,
    pub(super) frames: Frames,
    /// Where RealSense says that its streams are.
    pub(super) colour_from_reference: Option<RigidTransform>,
    pub(super) depth_from_reference: Option<RigidTransform>,
    pub(super) imu_from_reference: Option<RigidTransform>,
    /// Raw units per metre, by an option of the camera.
    pub(super) depth_scale: Option<f64>,
    /// The same by the first depth image.
    pub(super) image_scale: Option<f64>,
}

impl Cameras {
    /// The calibration; whatever had to be assumed becomes a note.
    ///
    /// # Errors
    /// [`ImportError::Unusable`] when there is no camera of the colour images, or one that cannot be described.
    pub(super) fn facts(&self, destination: &mut Destination, path: &Path) -> Result<Facts, ImportError> {
        let Some(colour) = &self.colour else {
            return Err(ImportError::unusable(
                path,
                "it has no camera_info of the colour images",
                "record that topic, too: it has focal length and principal point",
            ));
        };
        let camera = pinhole(colour, destination.colour_size());
        let mut facts =
            Facts::new(camera, self.depth_scale.or(self.image_scale).unwrap_or(UNITS_OF_INTEGERS));
        facts.distortion = describe(colour, &camera, "colour", destination, path)?;
        facts.depth_camera = self.depth_camera(colour, destination, path)?;
        if !(destination.rates.is_empty() && destination.forces.is_empty()) {
            match self.imu_from_camera() {
                Some(place) => facts.imu_from_camera = Some(place.rotation.to_rotation_matrix()),
                None => destination.note(
                    "no transform tells how the IMU is turned; its axes are taken for those of the camera, \
                     imu_from_camera in calibration.toml says otherwise",
                ),
            }
        }
        Ok(facts)
    }

    /// The camera of depth, unless it is that of colour.
    fn depth_camera(
        &self,
        colour: &CameraInfo,
        destination: &mut Destination,
        path: &Path,
    ) -> Result<Option<DepthCamera>, ImportError> {
        let Some(depth) = &self.depth else {
            destination
                .note("it has no camera_info of the depth images, which are taken for registered to colour");
            return Ok(None);
        };
        if depth.intrinsics == colour.intrinsics && depth.size == colour.size {
            return Ok(None);
        }
        let camera = pinhole(depth, destination.depth_size());
        let colour_from_depth = self.colour_from_depth().unwrap_or_else(|| {
            destination.note(
                "no transform tells where the depth camera is; it is taken to be where that of colour is",
            );
            RigidTransform::identity()
        });
        let distortion = describe(depth, &camera, "depth", destination, path)?;
        Ok(Some(DepthCamera { camera, distortion, colour_from_depth }))
    }

    fn colour_from_depth(&self) -> Option<RigidTransform> {
        match (&self.colour_from_reference, &self.depth_from_reference) {
            (Some(colour), Some(depth)) => Some(colour.compose(&depth.inverse())),
            _ => self.frames.between(self.colour_frame.as_deref()?, self.depth_frame.as_deref()?),
        }
    }

    fn imu_from_camera(&self) -> Option<RigidTransform> {
        match (&self.colour_from_reference, &self.imu_from_reference) {
            (Some(colour), Some(imu)) => Some(imu.compose(&colour.inverse())),
            _ => self.frames.between(self.imu_frame.as_deref()?, self.colour_frame.as_deref()?),
        }
    }
}

/// The camera that a message describes; its size is that of the images.
fn pinhole(info: &CameraInfo, images: Option<(usize, usize)>) -> PinholeCamera {
    let ((width, height), [fx, fy, cx, cy]) = (images.unwrap_or(info.size), info.intrinsics);
    PinholeCamera { width, height, fx, fy, cx, cy }
}

/// The lens of a camera.
fn describe(
    info: &CameraInfo,
    camera: &PinholeCamera,
    kind: &str,
    destination: &mut Destination,
    path: &Path,
) -> Result<mba_tracker::geometry::Distortion, ImportError> {
    let unusable = |reason: String| {
        ImportError::unusable(
            path,
            format!("the camera_info of the {kind} images cannot be used: {reason}"),
            "record images without distortion (image_rect) with their camera_info",
        )
    };
    check_camera(camera).map_err(|invalid| unusable(invalid.to_string()))?;
    if info.size != (camera.width, camera.height) {
        let ([width, height], (known_width, known_height)) = ([camera.width, camera.height], info.size);
        return Err(unusable(format!(
            "images have {width} x {height} pixels, it says {known_width} x {known_height}"
        )));
    }
    let (lens, error) = lens::distortion(&info.model, &info.distortion, camera).map_err(unusable)?;
    if error > 0.0 {
        let model = &info.model;
        destination.note(format!("the {kind} lens of the model {model} is described to {error:.3} px"));
    }
    Ok(lens)
}
