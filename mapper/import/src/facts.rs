//! What a source tells of its cameras.

use mba_io::dataset::{Calibration, DepthCamera, ExposureSource, Knowledge, Response, Shutter, Vignetting};
use mba_tracker::geometry::{Distortion, PinholeCamera};
use nalgebra::Rotation3;

/// What a source tells of its cameras.
#[derive(Clone, Debug)]
pub(crate) struct Facts {
    /// Size and intrinsics of the stored colour images.
    pub(crate) camera: PinholeCamera,
    pub(crate) distortion: Distortion,
    /// None where depth is registered to colour, or has the same view.
    pub(crate) depth_camera: Option<DepthCamera>,
    /// Raw units per metre.
    pub(crate) depth_scale: f64,
    /// Frames per second; without it that of the times.
    pub(crate) frame_rate: Option<f64>,
    /// Of all frames.
    pub(crate) exposure_seconds: Option<f64>,
    /// How rows are read out, where that is on record.
    pub(crate) readout: Option<Shutter>,
    pub(crate) response: Option<Response>,
    pub(crate) vignetting: Option<Vignetting>,
    /// First row of depth to the last, seconds.
    pub(crate) depth_readout_seconds: f64,
    pub(crate) imu_from_camera: Option<Rotation3<f64>>,
}

impl Facts {
    /// A camera of which only geometry and depth scale are known.
    pub(crate) fn new(camera: PinholeCamera, depth_scale: f64) -> Self {
        Self {
            camera,
            distortion: Distortion::default(),
            depth_camera: None,
            depth_scale,
            frame_rate: None,
            exposure_seconds: None,
            readout: None,
            response: None,
            vignetting: None,
            depth_readout_seconds: 0.0,
            imu_from_camera: None,
        }
    }

    /// The camera of a telephone: rows are read out one after the other, colours are those of displays.
    pub(crate) fn telephone(mut self) -> Self {
        self.readout = Some(Shutter::Rolling { seconds: None });
        self.response = Some(Response::Srgb);
        self
    }

    /// The calibration of the data set, of which the times have `measured_rate` frames per second.
    pub(crate) fn calibration(&self, measured_rate: f64) -> Calibration {
        let rate = self.frame_rate.unwrap_or(measured_rate);
        let mut calibration = Calibration::of_geometry(self.camera, self.distortion, self.depth_scale, rate);
        calibration.depth_camera = self.depth_camera;
        if let Some(seconds) = self.exposure_seconds {
            calibration.exposure = ExposureSource::Constant { seconds };
            calibration.sources.exposure = Knowledge::Recorded;
        }
        if let Some(readout) = self.readout {
            calibration.readout = readout;
            calibration.sources.readout = Knowledge::Recorded;
        }
        if let Some(response) = &self.response {
            calibration.response = response.clone();
            calibration.sources.response = Knowledge::Recorded;
        }
        if let Some(vignetting) = self.vignetting {
            calibration.vignetting = vignetting;
            calibration.sources.vignetting = Knowledge::Recorded;
        }
        calibration.depth_readout_seconds = self.depth_readout_seconds;
        calibration.imu_from_camera = self.imu_from_camera;
        calibration
    }
}
