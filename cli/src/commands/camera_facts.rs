//! What a data set tells of the times and the light of its camera, and where it contradicts itself.

use mba_mapper::dataset::{CalibrationSources, Dataset, ExposureSource, Response, Shutter, Vignetting};
use mba_mapper::imu::{ImuRecording, TimedVector};
use serde::Serialize;

/// Largest rate of gyroscopes that people carry, rad/s: 2000 degrees per second.
const FASTEST_TURN: f64 = 35.0;

/// Median specific force, m/s^2, below which a recording is probably in units of gravity.
const LEAST_FORCE: f64 = 3.0;

/// Times and light, for people and programs.
#[derive(Serialize)]
pub(super) struct CameraFacts {
    response: &'static str,
    readout: &'static str,
    /// First row to last; null where it is unknown.
    readout_s: Option<f64>,
    exposure_source: &'static str,
    shortest_exposure_s: f64,
    longest_exposure_s: f64,
    /// Coefficients of r^2 and r^4.
    vignetting: [f64; 2],
    /// Median over the frames of how much later than colour depth is measured.
    depth_delay_s: f64,
    depth_readout_s: f64,
    gyroscope_hz: Option<f64>,
    accelerometer_hz: Option<f64>,
    /// Frames whose whole exposure the IMU covers.
    imu_share_of_frames: Option<f64>,
    sources: CalibrationSources,
}

impl CameraFacts {
    pub(super) fn of(dataset: &Dataset) -> Self {
        let calibration = dataset.calibration();
        let exposures = || (0..dataset.len()).map(|k| dataset.exposure_seconds(k));
        let delays = (0..dataset.len()).map(|k| dataset.depth_timestamp(k) - dataset.timestamp(k)).collect();
        let Vignetting { a2, a4 } = calibration.vignetting;
        let imu = dataset.imu();
        Self {
            response: match calibration.response {
                Response::Srgb => "srgb",
                Response::Linear => "linear",
                Response::Table(_) => "table",
            },
            readout: match calibration.readout {
                Shutter::Global => "global",
                Shutter::Rolling { .. } => "rolling",
            },
            readout_s: calibration.readout.readout_seconds(),
            exposure_source: match calibration.exposure {
                ExposureSource::Constant { .. } => "calibration",
                ExposureSource::PerFrame => "per frame",
                ExposureSource::Assumed { .. } => "assumed",
            },
            shortest_exposure_s: exposures().fold(f64::INFINITY, f64::min),
            longest_exposure_s: exposures().fold(0.0, f64::max),
            vignetting: [a2, a4],
            depth_delay_s: median(delays).unwrap_or(0.0),
            depth_readout_s: calibration.depth_readout_seconds,
            gyroscope_hz: imu.and_then(|imu| hertz(imu.angular_velocities())),
            accelerometer_hz: imu.and_then(|imu| hertz(imu.specific_forces())),
            imu_share_of_frames: imu.map(|imu| covered_share(dataset, imu)),
            sources: calibration.sources,
        }
    }

    /// Rows of the table for people.
    pub(super) fn rows(&self) -> Vec<(&'static str, String)> {
        let Self { sources, .. } = self;
        let readout = match (self.readout, self.readout_s) {
            ("rolling", Some(seconds)) => format!("rolling, {:.2} ms", 1e3 * seconds),
            ("rolling", None) => "rolling, time unknown".to_owned(),
            (name, _) => name.to_owned(),
        };
        let [a2, a4] = self.vignetting;
        let falloff = if self.vignetting == [0.0, 0.0] {
            "none".to_owned()
        } else {
            format!("1 + {a2} r^2 + {a4} r^4, {:.0} % of the light in the corner", 100.0 * (1.0 + a2 + a4))
        };
        let rolls = match self.depth_readout_s {
            0.0 => String::new(),
            seconds => format!(", rows read out in {:.2} ms", 1e3 * seconds),
        };
        vec![
            ("response", format!("{} ({})", self.response, sources.response.name())),
            ("fall-off of light", format!("{falloff} ({})", sources.vignetting.name())),
            ("readout", format!("{readout} ({})", sources.readout.name())),
            ("exposure", self.exposure()),
            ("depth after colour", format!("{:.2} ms{rolls}", 1e3 * self.depth_delay_s)),
            ("IMU", self.imu()),
        ]
    }

    fn exposure(&self) -> String {
        let (shortest, longest) = (1e3 * self.shortest_exposure_s, 1e3 * self.longest_exposure_s);
        let range = if shortest == longest {
            format!("{shortest:.2} ms")
        } else {
            format!("{shortest:.2} to {longest:.2} ms")
        };
        let source = match (self.exposure_source, self.sources.exposure.name()) {
            (source, "estimated") => format!("{source}, estimated"),
            (source, _) => source.to_owned(),
        };
        format!("{range} ({source})")
    }

    fn imu(&self) -> String {
        let sensors = [("gyroscope", self.gyroscope_hz), ("accelerometer", self.accelerometer_hz)];
        let named = |(name, hertz): (&str, Option<f64>)| hertz.map(|hertz| format!("{name} {hertz:.0} Hz, "));
        let sensors: String = sensors.into_iter().filter_map(named).collect();
        match self.imu_share_of_frames {
            Some(share) => format!("{sensors}covers {:.1} % of the frames", 100.0 * share),
            None => "none".to_owned(),
        }
    }

    /// What cannot all be true, or is unlikely to be.
    pub(super) fn contradictions(&self, dataset: &Dataset) -> Vec<String> {
        let interval = 1.0 / dataset.calibration().frame_rate;
        let mut found = Vec::new();
        if self.readout == "rolling" && self.readout_s.is_none() {
            found.push(
                "rows are exposed one after the other, but readout_seconds does not say in which time"
                    .to_owned(),
            );
        }
        for (key, seconds) in [
            ("readout_seconds", self.readout_s.unwrap_or(0.0)),
            ("depth_readout_seconds", self.depth_readout_s),
        ] {
            // A microsecond of slack for numbers that were rounded when written.
            if seconds.abs() > interval + 1e-6 {
                found.push(format!("{key} of {seconds} s is longer than the {interval:.6} s between frames"));
            }
        }
        if self.depth_delay_s.abs() > 0.5 * interval {
            found.push(format!(
                "depth is {:.6} s from colour, more than half of the {interval:.6} s between frames: another depth \
                 image is nearer",
                self.depth_delay_s
            ));
        }
        found.extend(dataset.imu().into_iter().flat_map(|imu| self.imu_contradictions(imu)));
        found
    }

    fn imu_contradictions(&self, imu: &ImuRecording) -> Vec<String> {
        let mut found = Vec::new();
        let lengths = |samples: &[TimedVector]| samples.iter().map(|sample| sample.value.norm()).collect();
        let fastest = Vec::<f64>::into_iter(lengths(imu.angular_velocities())).fold(0.0, f64::max);
        if fastest > FASTEST_TURN {
            found.push(format!(
                "the gyroscope turns with up to {fastest:.1} rad/s; is it in degrees per second?"
            ));
        }
        if let Some(force) = median(lengths(imu.specific_forces())).filter(|force| *force < LEAST_FORCE) {
            found.push(format!(
                "the accelerometer feels {force:.2} m/s^2 in the median, where gravity alone is 9.81; is it in units \
                 of gravity, or without it?"
            ));
        }
        if let Some(share) = self.imu_share_of_frames.filter(|share| *share < 1.0) {
            found.push(format!(
                "the IMU covers the exposure of only {:.1} % of the frames, or has gaps there",
                100.0 * share
            ));
        }
        found
    }
}

/// Share of the frames during whose exposure, of all rows, there are samples of the IMU.
fn covered_share(dataset: &Dataset, imu: &ImuRecording) -> f64 {
    let readout = dataset.calibration().readout.readout_seconds().unwrap_or(0.0).abs();
    let is_covered = |k: &usize| {
        let half = 0.5 * (dataset.exposure_seconds(*k) + readout);
        let (from, to) = (dataset.timestamp(*k) - half, dataset.timestamp(*k) + half);
        imu.mean_angular_velocity(from, to).or(imu.mean_specific_force(from, to)).is_some()
    };
    (0..dataset.len()).filter(is_covered).count() as f64 / dataset.len() as f64
}

/// Samples per second.
fn hertz(samples: &[TimedVector]) -> Option<f64> {
    median(samples.windows(2).map(|pair| pair[1].time - pair[0].time).collect()).map(|step| 1.0 / step)
}

/// The upper of the two middle values where there are two.
fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
