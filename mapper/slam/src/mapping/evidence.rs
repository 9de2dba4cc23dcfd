//! What the frames of a data set show about two exposures.

use mba_adjust::continuity::{FramePicture, Mismatch, Suspicion, compare_exposures};
use mba_io::dataset::Dataset;
use mba_raster::exposure::RowTimes;
use mba_raster::sensor::{Observation, Sensor};
use mba_tracker::trajectory::ExposureTrajectory;

use super::observations::{observation_of, sensor};

/// Widest picture that is compared, pixels: misplaced frames are off by more than a pixel of it.
const WIDEST: usize = 320;

/// A corner that gets less of the light than this is not made brighter any more: there is hardly anything but noise.
const LEAST_SHARE: f32 = 0.05;

/// Compares exposures of the frames of a data set by what the frames show.
pub(super) struct FrameEvidence<'a> {
    dataset: &'a Dataset,
    sensor: Sensor,
    /// Halvings until the picture is small enough.
    level: usize,
}

impl<'a> FrameEvidence<'a> {
    pub(super) fn new(dataset: &'a Dataset) -> Self {
        let sensor = sensor(dataset);
        let level = (0..).find(|level| sensor.camera.width >> level <= WIDEST).unwrap_or(0);
        Self { dataset, sensor, level }
    }

    /// The word of the frame and its neighbours; `None` if they cannot be read or share too little.
    pub(super) fn compare(&self, suspicion: &Suspicion<'_>) -> Option<Mismatch> {
        let picture = self.picture(suspicion.frame)?;
        let references: Vec<(FramePicture, ExposureTrajectory)> =
            suspicion.references.iter().filter_map(|&(k, path)| Some((self.picture(k)?, path))).collect();
        let references: Vec<_> = references.iter().map(|(picture, path)| (picture, *path)).collect();
        compare_exposures(&picture, [suspicion.measured, suspicion.suggested], &references)
    }

    fn picture(&self, index: usize) -> Option<FramePicture> {
        let pyramid = observation_of(self.dataset, &self.sensor, index, self.level + 1).ok()?;
        let Observation { camera, colour, depth, falloff, .. } = pyramid.level(self.level);
        let [red, green, blue] = colour;
        let light = |byte: &u8| self.sensor.inverse_response.linear_light(*byte);
        let mean = |((red, green), blue): ((&u8, &u8), &u8)| (light(red) + light(green) + light(blue)) / 3.0;
        let mut light: Vec<f32> = red.iter().zip(green).zip(blue).map(mean).collect();
        if let Some(falloff) = falloff {
            light.iter_mut().zip(falloff.iter()).for_each(|(light, share)| *light /= share.max(LEAST_SHARE));
        }
        Some(FramePicture { camera: *camera, light, depth: depth.clone(), times: self.times(index) })
    }

    fn times(&self, index: usize) -> RowTimes {
        let seconds = self.dataset.exposure_seconds(index);
        let offset = self.dataset.depth_timestamp(index) - self.dataset.timestamp(index);
        self.sensor.rows.over(seconds, seconds, offset)
    }
}
