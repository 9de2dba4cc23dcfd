//! What is odd about a data set: times, sizes, images, its IMU.

use super::super::calibration::{ASSUMED_EXPOSURE_SHARE, LONGEST_ASSUMED_EXPOSURE, assumed_exposure_seconds};
use super::super::frame::{ImageHeader, header};
use super::super::image_source::size;
use super::super::{CameraFact, ExposureSource, Knowledge, Warning};
use super::{Dataset, FrameEntry, frames_per_second, median_interval};
use crate::imu;

impl Dataset {
    /// Finds again what is odd, and reads the IMU, whose axes the calibration decides.
    pub(super) fn collect_warnings(&mut self) {
        let sources = self.calibration.sources;
        let is_still_assumed = |fact: CameraFact| sources.of(fact) == Knowledge::Assumed;
        let still_holds = |warning: &&Warning| match warning {
            Warning::Assumed { key: "readout", .. } => is_still_assumed(CameraFact::Readout),
            Warning::Assumed { key: "response", .. } => is_still_assumed(CameraFact::Response),
            _ => true,
        };
        self.warnings = self.reader_warnings.iter().filter(still_holds).cloned().collect();
        self.warn_about_timing();
        self.warn_about_missing_images();
        self.warn_about_orientation();
        self.warn_about_depth_view();
        self.read_imu();
    }

    /// A damaged recording of the IMU is odd, but frames can do without.
    fn read_imu(&mut self) {
        match imu::read_folder(&self.folder, self.calibration.imu_from_camera.as_ref()) {
            Ok(imu) => self.imu = imu,
            Err(error) => self.warnings.push(Warning::ImuUnusable { problem: error.to_string() }),
        }
        let (first, last) = (self.entries.first(), self.entries.last());
        if let (Some(imu), Some(first), Some(last)) = (&self.imu, first, last)
            && !imu.overlaps(first.timestamp, last.timestamp)
        {
            self.warnings.push(Warning::ImuElsewhere);
            self.imu = None;
        }
    }

    fn warn_about_timing(&mut self) {
        let frame_rate = self.calibration.frame_rate;
        let interval = 1.0 / frame_rate;
        let times: Vec<f64> = self.entries.iter().map(|entry| entry.timestamp).collect();
        // A factor of two is no drift of a clock: one of the numbers is wrong.
        if let Some(measured) = frames_per_second(&times)
            && !(0.5..=2.0).contains(&(measured / frame_rate))
        {
            self.warnings.push(Warning::FrameRateDiffers { frame_rate, measured });
        }
        self.warnings.extend(find_gaps(&times));
        if let ExposureSource::Assumed { seconds } = self.calibration.exposure {
            let why = if seconds < assumed_exposure_seconds(frame_rate) {
                "every frame is taken for sharp".to_owned()
            } else if seconds < LONGEST_ASSUMED_EXPOSURE {
                format!("{ASSUMED_EXPOSURE_SHARE} of the frame interval")
            } else {
                "the longest that is assumed".to_owned()
            };
            let value = format!("{seconds:.4} s ({why})");
            self.warnings.push(Warning::Assumed { key: "exposure_seconds", value });
        }
        let exposure = self.entries.iter().map(|entry| self.entry_exposure(entry)).fold(0.0, f64::max);
        // A thousandth for what was rounded.
        if exposure > interval * 1.001 {
            self.warnings.push(Warning::ExposureTooLong { exposure, interval });
        }
    }

    /// One sentence for all images: a camera marks all of them alike, or as it was held.
    fn warn_about_orientation(&mut self) {
        let source = |entry: &FrameEntry| [entry.colour.clone(), entry.depth.clone()];
        let first = self.entries.first().map(source).into_iter().flatten();
        let sizes = [self.colour.size, self.depth.size];
        for (path, size) in first.zip(sizes) {
            if let Some(header) = header(&path).filter(ImageHeader::is_turned) {
                let as_shown = header.shown() == size;
                self.warnings.push(Warning::Orientation { path, as_shown });
            }
        }
    }

    fn warn_about_depth_view(&mut self) {
        let camera = &self.calibration.camera;
        if self.calibration.depth_camera.is_none() && self.depth.size != size(camera) {
            let pixel = camera.width as f64 / self.depth.size.0 as f64;
            let value = format!("the view of colour with pixels {pixel} times as wide");
            self.warnings.push(Warning::Assumed { key: "[depth] of the calibration", value });
        }
    }

    fn warn_about_missing_images(&mut self) {
        let images = self.entries.iter().flat_map(|entry| [&entry.colour, &entry.depth]);
        let mut missing = images.filter(|path| !path.is_file());
        if let Some(first) = missing.next().cloned() {
            self.warnings.push(Warning::MissingImages { count: 1 + missing.count(), first });
        }
    }
}

/// Intervals of more than one and a half times the median.
fn find_gaps(times: &[f64]) -> Option<Warning> {
    let limit = 1.5 * median_interval(times)?;
    let gaps = times.windows(2).map(|pair| (pair[1] - pair[0], pair[0])).filter(|(gap, _)| *gap > limit);
    let (longest, after) = gaps.clone().max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(Warning::Gaps { count: gaps.count(), longest, after })
}
