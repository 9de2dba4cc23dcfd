//! Frames of a data set as observations.

use std::sync::Arc;

use mba_io::dataset::Dataset;

use mba_raster::exposure::RowTiming;
use mba_raster::sensor::{ObservationPyramid, Sensor};

/// Resolutions of an observation: full and half.
const LEVELS: usize = 2;

/// How frames of the data set become observations.
#[must_use]
pub fn sensor(dataset: &Dataset) -> Sensor {
    let calibration = dataset.calibration();
    Sensor {
        camera: calibration.camera,
        inverse_response: calibration.response.inverse(),
        depth_scale: calibration.depth_scale,
        region: dataset.region_with_source(),
        rows: RowTiming {
            // Rows of unknown times count as exposed together.
            readout_seconds: calibration.readout.readout_seconds().unwrap_or(0.0),
            depth_readout_seconds: calibration.depth_readout_seconds,
        },
        falloff: dataset.light_falloff().map(Arc::from),
    }
}

/// Reads a frame.
pub(super) fn observation(
    dataset: &Dataset,
    sensor: &Sensor,
    index: usize,
) -> Result<ObservationPyramid, String> {
    observation_of(dataset, sensor, index, LEVELS)
}

/// Reads a frame at that many resolutions.
pub(super) fn observation_of(
    dataset: &Dataset,
    sensor: &Sensor,
    index: usize,
    levels: usize,
) -> Result<ObservationPyramid, String> {
    let frame = dataset.frame(index).map_err(|error| error.to_string())?;
    ObservationPyramid::new(sensor, &frame, levels).ok_or_else(|| "its size is not the camera's".to_owned())
}
