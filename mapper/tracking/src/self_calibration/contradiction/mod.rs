//! Where the motion that was found contradicts what is on record about the camera.
//!
//! A figure on record is taken for right, so nothing else would tell that it is not: half the exposure time gives half the
//! blur, and a gyroscope with wrong axes pulls at every pose, while every frame is called ok.

mod gyroscope;

use std::fmt;

use mba_io::dataset::{Dataset, Knowledge, survey};
use mba_io::imu::inertial_fit;
use mba_io::trajectory_file::TimedExposure;
use mba_tracker::trajectory::ExposureTrajectory;

use super::exposure::{PixelScale, factor, observations};
use super::metre::{MAX_SIGMA, longest_found, with_systematic};
use super::robust::median;
use super::window::{Guess, Recording, Tracked};
use crate::run::{FrameRecord, FrameStatus};
use crate::tracking::TrackingOptions;
pub use gyroscope::GyroscopeFault;

/// Frames whose depth is looked at.
const DEPTH_SAMPLES: usize = 8;

/// Logarithm of the factor on exposure times that is worth telling: motion tells them to 5 % on recordings that are as they
/// say.
const TELLING_EXPOSURE: f64 = 0.15;

/// Seconds below which the motion within an exposure is that of a frame that was taken for sharp, but for rounding: no
/// calibration may state as little.
const TAKEN_FOR_SHARP: f64 = 1e-6;

/// Share of the length of a metre that is worth telling.
const TELLING_METRE: f64 = 0.01;

/// Standard deviations by which a fact has to be missed.
const CERTAINTY: f64 = 4.0;

/// Something on record that the recording itself contradicts.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Contradiction {
    /// Exposures last another time than is on record.
    Exposure {
        /// Median on record, seconds.
        recorded: f64,
        /// What the motion says, seconds.
        found: f64,
        /// Its standard deviation.
        sigma: f64,
    },
    /// The gyroscope turns otherwise than the camera.
    Gyroscope(GyroscopeFault),
    /// The metre of depth is not that of the accelerometer.
    Metre {
        /// Depth units per metre on record.
        recorded: f64,
        /// What the accelerometer says.
        found: f64,
        /// Its standard deviation.
        sigma: f64,
    },
}

impl fmt::Display for Contradiction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Exposure { recorded, found, sigma } => write!(
                f,
                "the motion within exposures is that of {:.1} +- {:.1} ms, where {:.1} ms are on record; without them, \
                 exposure times are estimated",
                1e3 * found,
                1e3 * sigma,
                1e3 * recorded
            ),
            Self::Gyroscope(fault) => fault.fmt(f),
            Self::Metre { recorded, found, sigma } => write!(
                f,
                "by the accelerometer depth has {found:.0} +- {sigma:.0} units per metre, where {recorded} are on record; \
                 see mba calibrate"
            ),
        }
    }
}

/// What contradicts the poses of tracked frames: `exposures` and `records` by frame of the data set.
#[must_use]
pub fn contradictions(
    dataset: &Dataset,
    exposures: &[TimedExposure],
    records: &[FrameRecord],
) -> Vec<Contradiction> {
    let frames = exposures.iter().zip(records).enumerate();
    let tracked: Vec<Tracked> = frames
        .map(|(index, (exposure, record))| Tracked {
            index,
            timestamp: exposure.timestamp,
            is_found: record.status != FrameStatus::Lost,
            world_from_mid: exposure.mid,
            world_from_camera: ExposureTrajectory { start: exposure.start, end: exposure.end },
            reference: index,
            gain: record.gain,
            residual: record.residual,
        })
        .collect();
    of_tracked(dataset, &tracked)
}

/// The same of a lively stretch of a data set, which is tracked for that, at low resolution.
#[must_use]
pub fn quick_contradictions(dataset: &Dataset) -> Vec<Contradiction> {
    let has_facts = dataset.calibration().sources.exposure == Knowledge::Recorded || dataset.imu().is_some();
    if !has_facts || !dataset.has_images() {
        return Vec::new();
    }
    of_tracked(dataset, &lively_stretch(dataset))
}

/// What is wrong with the gyroscope of a data set, if there is one: against a lively stretch, tracked without it at low
/// resolution.
#[must_use]
pub fn gyroscope_fault(dataset: &Dataset) -> Option<GyroscopeFault> {
    let imu = dataset.imu().filter(|imu| dataset.has_images() && !imu.angular_velocities().is_empty())?;
    gyroscope::fault(imu, &lively_stretch(dataset))
}

fn lively_stretch(dataset: &Dataset) -> Vec<Tracked> {
    let options = TrackingOptions::default();
    Recording { dataset, options: &options }.liveliest(Guess::of(dataset)).1.tracked
}

fn of_tracked(dataset: &Dataset, tracked: &[Tracked]) -> Vec<Contradiction> {
    let gyroscope = dataset.imu().and_then(|imu| gyroscope::fault(imu, tracked));
    let found = [
        exposure(dataset, tracked),
        gyroscope.map(Contradiction::Gyroscope),
        // With wrong axes or times the accelerometer means nothing.
        if gyroscope.is_none() { metre(dataset, tracked) } else { None },
    ];
    found.into_iter().flatten().collect()
}

fn exposure(dataset: &Dataset, tracked: &[Tracked]) -> Option<Contradiction> {
    if dataset.calibration().sources.exposure != Knowledge::Recorded {
        return None;
    }
    let scale = PixelScale::new(&dataset.calibration().camera, survey(dataset, DEPTH_SAMPLES).median_depth?);
    let interval = 1.0 / dataset.calibration().frame_rate;
    let times: Vec<f64> = (0..dataset.len()).map(|index| dataset.exposure_seconds(index)).collect();
    let mut observations = observations(tracked, &scale, interval);
    // A frame that was taken for sharp, as all are where blur is not modelled, does not say how long its exposure was.
    observations.retain(|(_, seconds, _)| seconds.abs() >= TAKEN_FOR_SHARP);
    let found = factor(&observations, &times)?;
    let recorded = median(&times)?;
    let is_telling = found.median > 0.0
        && found.median.ln().abs() > TELLING_EXPOSURE
        && (found.median - 1.0).abs() > CERTAINTY * found.sigma;
    is_telling.then_some(Contradiction::Exposure {
        recorded,
        found: recorded * found.median,
        sigma: recorded * found.sigma,
    })
}

fn metre(dataset: &Dataset, tracked: &[Tracked]) -> Option<Contradiction> {
    let poses: Vec<_> =
        longest_found(tracked).iter().map(|frame| (frame.timestamp, frame.world_from_mid)).collect();
    let fit = with_systematic(inertial_fit(dataset.imu()?, &poses)?);
    let missed = (fit.metre - 1.0).abs();
    let is_telling =
        missed > TELLING_METRE && missed > CERTAINTY * fit.metre_sigma && fit.metre_sigma < MAX_SIGMA;
    let recorded = dataset.calibration().depth_scale;
    let found = recorded / fit.metre;
    is_telling.then_some(Contradiction::Metre { recorded, found, sigma: found * fit.metre_sigma })
}
