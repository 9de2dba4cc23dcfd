//! Tracking a recording from its end to its beginning.
//!
//! Time runs backwards: the last row is exposed first, depth that came late comes early, and the camera turns the other way.

use std::ops::ControlFlow;

use mba_io::dataset::Dataset;
use mba_io::trajectory_file::TimedExposure;
use mba_tracker::error::FrameError;
use mba_tracker::{ExpectedPath, Frame, FrameStatus, GyroReading, Tracker, TrackerConfig};

use crate::tracking::{
    Measured, TrackingError, TrackingOptions, add_gyroscope, timed_result, tracker_config, tracker_view,
};
use crate::uncertainty::Uncertainty;

/// What the way back says of one frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct SeenBackwards {
    pub(super) status: FrameStatus,
    /// In the world of the way back; opening comes before closing.
    pub(super) exposure: TimedExposure,
    /// Blur in pixels.
    pub(super) blur_px: f64,
    /// The frame that it was aligned with.
    pub(super) measured: Measured,
}

/// Tracks all frames of `dataset` from the last to the first; `expected` is how the camera moves around each.
pub(super) fn track_backwards(
    dataset: &Dataset,
    options: &TrackingOptions,
    expected: &[Option<ExpectedPath>],
    mut observe: impl FnMut() -> ControlFlow<()>,
) -> Result<Vec<Option<SeenBackwards>>, TrackingError> {
    let config = backwards(&tracker_config(dataset, options));
    let mut memory = vec![0; config.workspace_len()];
    let mut tracker = Tracker::new(&config, dataset.simd(), &mut memory).map_err(TrackingError::Camera)?;
    let mut uncertainty = Uncertainty::default();
    let mut given: Vec<usize> = Vec::new();
    let mut seen = vec![None; dataset.len()];
    for index in (0..dataset.len()).rev() {
        if observe().is_break() {
            return Err(TrackingError::Stopped);
        }
        // As on the way forwards, a frame that cannot be read or tracked is passed over.
        let Ok(image) = dataset.frame(index) else { continue };
        let Ok(frame) = tracker_view(&image) else { continue };
        let frame = reversed(frame, dataset, given.last().copied(), expected[index].as_ref());
        let Ok(result): Result<_, FrameError> = tracker.track(&frame) else { continue };
        given.push(index);
        uncertainty.add(&result);
        let measured = uncertainty.last_measured(&given);
        let exposure = timed_result(&result);
        // What closes the shutter when time runs backwards opens it.
        let (start, end) = (exposure.end, exposure.start);
        // The frame that came before, with what this one tells of it; its own record stays.
        if let Some(revision) = &result.revision {
            let revised: &mut Option<SeenBackwards> = &mut seen[given[revision.index]];
            if let Some(revised) = revised {
                let path = revision.world_from_camera;
                revised.exposure = TimedExposure {
                    start: path.end,
                    mid: revision.world_from_mid,
                    end: path.start,
                    ..revised.exposure
                };
                revised.blur_px = f64::from(revision.blur);
            }
        }
        seen[index] = Some(SeenBackwards {
            status: result.status,
            exposure: TimedExposure { timestamp: image.timestamp, start, end, ..exposure },
            blur_px: f64::from(result.blur),
            measured,
        });
    }
    Ok(seen)
}

/// The configuration for time that runs backwards.
fn backwards(config: &TrackerConfig) -> TrackerConfig {
    let mut config = config.clone();
    config.readout.colour = -config.readout.colour;
    config.readout.depth = -config.readout.depth;
    config
}

/// The frame as it comes after `previous` when time runs backwards.
fn reversed<'a>(
    mut frame: Frame<'a>,
    dataset: &Dataset,
    previous: Option<usize>,
    expected: Option<&ExpectedPath>,
) -> Frame<'a> {
    add_gyroscope(&mut frame, dataset, previous);
    Frame {
        // Time turns its sign, and with it whatever has an odd power of it: rates and jerks, not accelerations.
        timestamp: -frame.timestamp,
        depth_timestamp: -frame.depth_timestamp,
        angular_velocity: frame.angular_velocity.map(|rate| -rate),
        gyro: frame.gyro.map(|gyro| GyroReading { angular_velocity: -gyro.angular_velocity, ..gyro }),
        expected_path: expected.map(|path| ExpectedPath {
            velocity: -path.velocity,
            jerk: -path.jerk,
            ..*path
        }),
        ..frame
    }
}
