//! Writing `calibration.toml`.

use std::fmt::{Debug, Write as _};
use std::path::{Path, PathBuf};

use mba_tracker::geometry::{Distortion, PinholeCamera};

use super::depth_camera::section;
use super::{
    Calibration, CalibrationSources, CameraFact, ExposureSource, Knowledge, Response, Shutter, Vignetting,
    response_table,
};
use crate::FileError;
use crate::whole_file::write_together;

/// Writes a calibration that [`super::read_calibration`] gets back exactly. What is assumed is left out, so that it
/// is assumed again; a measured response goes into a file of its own beside it, named after it. Exposure times of
/// frames belong into `exposures.csv`, see [`super::write_exposure_times`].
///
/// # Errors
///
/// [`FileError`] if a file cannot be written.
pub fn write_calibration(path: &Path, calibration: &Calibration) -> Result<(), FileError> {
    let mut files: Vec<(PathBuf, String)> = Vec::new();
    let response = match &calibration.response {
        _ if calibration.sources.response == Knowledge::Assumed => None,
        Response::Srgb => Some("srgb".to_owned()),
        Response::Linear => Some("linear".to_owned()),
        Response::Table(table) => {
            let stem = path.file_stem().map_or("calibration".into(), |stem| stem.to_string_lossy());
            let name = format!("{stem}_response.csv");
            files.push((path.with_file_name(&name), response_table::to_text(table)));
            Some(name)
        }
    };
    let mut text = Lines::default();
    text.geometry(calibration);
    text.light(calibration, response);
    text.times(calibration);
    text.estimated(&calibration.sources);
    // A section ends where the next one begins: it comes last.
    text.0.extend(calibration.depth_camera.as_ref().map(section));
    files.push((path.to_owned(), text.0));
    write_together(&files)
}

/// The text of a calibration.
#[derive(Default)]
struct Lines(String);

impl Lines {
    /// Debug formatting of numbers and texts is TOML, and numbers read back as they were.
    fn add(&mut self, key: &str, value: impl Debug) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.0, "{key} = {value:?}");
    }

    fn geometry(&mut self, calibration: &Calibration) {
        let PinholeCamera { width, height, fx, fy, cx, cy } = calibration.camera;
        self.add("width", width);
        self.add("height", height);
        for (key, value) in [("fx", fx), ("fy", fy), ("cx", cx), ("cy", cy)] {
            self.add(key, value);
        }
        let Distortion { k1, k2, p1, p2, k3 } = calibration.distortion;
        if !calibration.distortion.is_none() {
            self.add("distortion", [k1, k2, p1, p2, k3]);
        }
        self.add("depth_scale", calibration.depth_scale);
        if let Some(rotation) = &calibration.imu_from_camera {
            // The columns of the transpose are the rows.
            self.add("imu_from_camera", rotation.matrix().transpose().as_slice());
        }
    }

    fn light(&mut self, calibration: &Calibration, response: Option<String>) {
        if let ExposureSource::Constant { seconds } = calibration.exposure {
            self.add("exposure_seconds", seconds);
        }
        if let Some(response) = response {
            self.add("response", response);
        }
        if calibration.sources.vignetting != Knowledge::Assumed {
            let Vignetting { a2, a4 } = calibration.vignetting;
            self.add("vignetting", [a2, a4]);
        }
    }

    fn times(&mut self, calibration: &Calibration) {
        self.add("frame_rate", calibration.frame_rate);
        match calibration.readout {
            _ if calibration.sources.readout == Knowledge::Assumed => (),
            Shutter::Global => self.add("readout", "global"),
            Shutter::Rolling { seconds } => {
                self.add("readout", "rolling");
                seconds.into_iter().for_each(|seconds| self.add("readout_seconds", seconds));
            }
        }
        if calibration.depth_readout_seconds != 0.0 {
            self.add("depth_readout_seconds", calibration.depth_readout_seconds);
        }
        if let Some(seconds) = calibration.depth_delay_seconds {
            self.add("depth_delay_seconds", seconds);
        } else if calibration.depth_clock_seconds != 0.0 {
            self.add("depth_clock_seconds", calibration.depth_clock_seconds);
        }
    }

    fn estimated(&mut self, sources: &CalibrationSources) {
        let is_estimated = |fact: &CameraFact| sources.of(*fact) == Knowledge::Estimated;
        let facts: Vec<_> = CameraFact::ALL.into_iter().filter(is_estimated).map(CameraFact::name).collect();
        if !facts.is_empty() {
            self.add("estimated", facts);
        }
    }
}

#[cfg(test)]
mod tests {
    use mba_tracker::photometric::InverseResponse;
    use nalgebra::{Rotation3, Vector3};

    use super::super::{DepthCamera, read_calibration};
    use super::*;

    fn written_and_read(calibration: &Calibration) -> Calibration {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("found.toml");
        write_calibration(&path, calibration).unwrap();
        read_calibration(&path).unwrap()
    }

    fn bare() -> Calibration {
        let camera =
            PinholeCamera { width: 640, height: 480, fx: 517.3, fy: 1.0 / 3e-3, cx: 318.6, cy: 255.3 };
        Calibration::of_geometry(camera, Distortion::default(), 5000.0, 29.97)
    }

    #[test]
    fn what_is_assumed_is_assumed_again() {
        assert_eq!(written_and_read(&bare()), bare());
        assert_eq!(written_and_read(&bare().rolling()), bare().rolling());
    }

    #[test]
    fn every_key_comes_back_exactly() {
        let table = std::array::from_fn(|code| (code as f32 / 255.0).powf(1.7) + 1e-4 * code as f32);
        let mut calibration = bare();
        calibration.distortion = Distortion { k1: 0.2624, k2: -0.4531, p1: -0.0054, p2: 0.1 + 0.2, k3: 1e-7 };
        calibration.exposure = ExposureSource::Constant { seconds: 1.0 / 61.0 };
        calibration.response = Response::Table(Box::new(InverseResponse::from_table(&table).unwrap()));
        calibration.readout = Shutter::Rolling { seconds: Some(-0.02 / 3.0) };
        calibration.depth_readout_seconds = 0.03 / 7.0;
        calibration.depth_delay_seconds = Some(-0.011);
        calibration.vignetting = Vignetting { a2: -0.35, a4: 0.05 };
        calibration.imu_from_camera = Some(Rotation3::new(Vector3::new(0.1, -2.0, 0.7)));
        calibration.sources = CalibrationSources {
            camera: Knowledge::Estimated,
            depth_scale: Knowledge::Recorded,
            exposure: Knowledge::Estimated,
            readout: Knowledge::Estimated,
            response: Knowledge::Recorded,
            vignetting: Knowledge::Estimated,
            depth_delay: Knowledge::Recorded,
        };
        assert_eq!(written_and_read(&calibration), calibration);
        calibration.readout = Shutter::Global;
        calibration.response = Response::Linear;
        calibration.depth_camera = Some(DepthCamera::same_view(&calibration.camera, (160, 120)));
        (calibration.depth_delay_seconds, calibration.depth_clock_seconds) = (None, -0.0207);
        calibration.sources.readout = Knowledge::Recorded;
        assert_eq!(written_and_read(&calibration), calibration);
    }
}
