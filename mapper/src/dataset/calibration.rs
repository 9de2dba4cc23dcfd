//! What has to be known about the camera, and checks that it makes sense.

use mba_tracker::geometry::{Distortion, PinholeCamera};
use mba_tracker::photometric::InverseResponse;

/// Everything known about the camera of a data set.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Intrinsics of the frames as delivered, i.e. after undistortion.
    pub camera: PinholeCamera,
    /// Distortion of the stored images; it is removed on reading.
    pub distortion: Distortion,
    /// Raw depth units per metre, positive.
    pub depth_scale: f64,
    /// Where the exposure times come from.
    pub exposure: ExposureSource,
    /// Frames per second, positive.
    pub frame_rate: f64,
    /// How the stored values follow from light.
    pub response: Response,
    /// How the sensor is read out.
    pub readout: Readout,
}

/// Where the exposure times come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ExposureSource {
    /// One recorded exposure time for all frames.
    Constant {
        /// Seconds, positive.
        seconds: f64,
    },
    /// A recorded exposure time for each frame.
    PerFrame,
    /// Not recorded: [`ASSUMED_EXPOSURE_SHARE`] of the frame interval.
    Assumed {
        /// Seconds, positive.
        seconds: f64,
    },
}

/// Share of the frame interval that is assumed as exposure time when none is recorded.
///
/// A shutter cannot be open for longer than the whole interval. Consumer depth cameras in rooms come near that
/// in the evening and to a fifth of it in daylight; half is wrong by a factor of about two at most either way.
pub const ASSUMED_EXPOSURE_SHARE: f64 = 0.5;

/// How the stored 8-bit values follow from light.
#[derive(Clone, Debug, PartialEq)]
pub enum Response {
    /// The sRGB transfer function.
    Srgb,
    /// Proportional to light.
    Linear,
    /// Measured.
    Table(Box<InverseResponse>),
}

impl Response {
    /// Linear light of each stored value, as the tracker wants it.
    #[must_use]
    pub fn inverse(&self) -> InverseResponse {
        match self {
            Self::Srgb => InverseResponse::srgb(),
            Self::Linear => InverseResponse::linear(),
            Self::Table(table) => table.as_ref().clone(),
        }
    }
}

/// How the sensor is read out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Readout {
    /// All rows are exposed at the same time.
    Global,
    /// Rows are exposed one after the other.
    Rolling,
}

/// A value outside its valid range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key} is {value}, expected {expected}")]
pub struct InvalidValue {
    /// What has the value.
    pub key: &'static str,
    /// The value.
    pub value: String,
    /// What it should be.
    pub expected: &'static str,
}

/// Largest plausible focal length in image widths: narrower than 0.6 degrees of view.
const MAX_FOCAL_IN_WIDTHS: f64 = 100.0;

/// Largest plausible image side in pixels, so that absurd sizes do not ask for absurd memory.
const MAX_SIDE: usize = 16_384;

impl Calibration {
    /// Exposure time of a frame that has none of its own, seconds.
    pub(super) fn fallback_exposure_seconds(&self) -> f64 {
        match self.exposure {
            ExposureSource::Constant { seconds } | ExposureSource::Assumed { seconds } => seconds,
            ExposureSource::PerFrame => ASSUMED_EXPOSURE_SHARE / self.frame_rate,
        }
    }

    /// Checks every number.
    pub(super) fn check(&self) -> Result<(), InvalidValue> {
        check_camera(&self.camera)?;
        let Distortion { k1, k2, p1, p2, k3 } = self.distortion;
        if let Some(bad) = [k1, k2, p1, p2, k3].into_iter().find(|k| !k.is_finite()) {
            return Err(invalid("distortion", bad, "finite numbers"));
        }
        check_positive("depth_scale", self.depth_scale, "a positive number of raw units per metre")?;
        check_positive("frame_rate", self.frame_rate, "a positive number of frames per second")?;
        match self.exposure {
            ExposureSource::Constant { seconds } | ExposureSource::Assumed { seconds } => {
                check_positive("exposure_seconds", seconds, "a positive number of seconds")
            }
            ExposureSource::PerFrame => Ok(()),
        }
    }
}

/// Checks size, focal lengths and principal point.
pub(crate) fn check_camera(camera: &PinholeCamera) -> Result<(), InvalidValue> {
    for (key, side) in [("width", camera.width), ("height", camera.height)] {
        if side == 0 || side > MAX_SIDE {
            return Err(invalid(key, side, "a size from 1 to 16384 pixels"));
        }
    }
    let (width, height) = (camera.width as f64, camera.height as f64);
    for (key, focal) in [("fx", camera.fx), ("fy", camera.fy)] {
        if !(focal > 0.0 && focal <= MAX_FOCAL_IN_WIDTHS * width) {
            return Err(invalid(
                key,
                focal,
                "a focal length in pixels, above 0 and at most 100 image widths",
            ));
        }
    }
    for (key, centre, side) in [("cx", camera.cx, width), ("cy", camera.cy, height)] {
        if !(centre >= -side && centre <= 2.0 * side) {
            return Err(invalid(key, centre, "a principal point in pixels, in or near the image"));
        }
    }
    Ok(())
}

/// Checks that `value` is finite and above zero.
pub(crate) fn check_positive(
    key: &'static str,
    value: f64,
    expected: &'static str,
) -> Result<(), InvalidValue> {
    if value.is_finite() && value > 0.0 { Ok(()) } else { Err(invalid(key, value, expected)) }
}

fn invalid(key: &'static str, value: impl ToString, expected: &'static str) -> InvalidValue {
    InvalidValue { key, value: value.to_string(), expected }
}
