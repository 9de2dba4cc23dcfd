//! What has to be known about the camera, and checks that it makes sense.

use std::fmt::Display;

use mba_tracker::geometry::{Distortion, PinholeCamera};
use mba_tracker::photometric::{InverseResponse, Vignetting};
use nalgebra::{Matrix3, Rotation3};

use super::knowledge::{CalibrationSources, CameraFact, Knowledge};

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
    /// How the colour sensor is read out.
    pub readout: Shutter,
    /// Time from the exposure of the first row of depth to that of the last, seconds; negative when the last row
    /// comes first, 0 when all are measured together.
    pub depth_readout_seconds: f64,
    /// When depth is measured: its time minus that of the colour image, seconds. Without it, depth images keep
    /// the timestamps they have.
    pub depth_delay_seconds: Option<f64>,
    /// What is added to the timestamps of depth images to get the time of their middle row, seconds; 0 where
    /// [`Self::depth_delay_seconds`] stands in for the timestamps.
    pub depth_clock_seconds: f64,
    /// How light falls off towards the corners of the stored colour images.
    pub vignetting: Vignetting,
    /// Takes vectors in the camera's axes to those of the IMU. Without it the usual axes of the IMU's file hold
    /// (see [`crate::imu`]).
    pub imu_from_camera: Option<Rotation3<f64>>,
    /// How each of these facts came to be known.
    pub sources: CalibrationSources,
}

/// Where the exposure times come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ExposureSource {
    /// One exposure time for all frames.
    Constant {
        /// Seconds, positive.
        seconds: f64,
    },
    /// An exposure time for each frame.
    PerFrame,
    /// Not recorded: [`assumed_exposure_seconds`].
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

/// Longest exposure time that is assumed, seconds.
///
/// Frames that are half a second apart were picked from a video or taken by hand, and neither says that the shutter
/// was open for longer than a video camera's can be.
pub const LONGEST_ASSUMED_EXPOSURE: f64 = 1.0 / 30.0;

/// The exposure time in seconds that is assumed at this frame rate (per second):
/// [`ASSUMED_EXPOSURE_SHARE`] of the frame interval, at most [`LONGEST_ASSUMED_EXPOSURE`].
#[must_use]
pub fn assumed_exposure_seconds(frame_rate: f64) -> f64 {
    (ASSUMED_EXPOSURE_SHARE / frame_rate).min(LONGEST_ASSUMED_EXPOSURE)
}

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

/// How a sensor is read out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shutter {
    /// All rows are exposed at the same time.
    Global,
    /// Rows are exposed one after the other; the timestamp is that of the middle of the image.
    Rolling {
        /// Time from the exposure of the first row to that of the last; negative when the last row comes first.
        /// Unknown where it is not on record.
        seconds: Option<f64>,
    },
}

impl Shutter {
    /// Time from the exposure of the first row to that of the last, seconds, 0 for a global shutter; none for rows
    /// that are exposed one after the other in an unknown time.
    #[must_use]
    pub fn readout_seconds(self) -> Option<f64> {
        match self {
            Self::Global => Some(0.0),
            Self::Rolling { seconds } => seconds,
        }
    }
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

/// Most pixels of an image: eight times those of the largest depth cameras.
pub(crate) const MAX_PIXELS: usize = 64_000_000;

/// Most raw units of depth per metre: 16 bits then reach to 6 cm.
const MAX_DEPTH_SCALE: f64 = 1e6;

/// Distances from the centre at which a lens is checked.
const LENS_SAMPLES: u32 = 64;

/// Longest readout of a sensor, seconds either way: three times that of slow telephones.
const MAX_READOUT: f64 = 0.1;

/// Longest time between a colour image and its depth image, seconds either way.
const MAX_DEPTH_DELAY: f64 = 0.2;

/// Exposure times that a video camera can have, seconds.
const EXPOSURES: std::ops::RangeInclusive<f64> = 1e-6..=1.0;

impl Calibration {
    /// A camera of which nothing is known but its geometry, depth scale and frame rate: exposure and response are
    /// assumed, the shutter is taken for global, and nothing falls off or comes late.
    pub(super) fn of_geometry(
        camera: PinholeCamera,
        distortion: Distortion,
        depth_scale: f64,
        frame_rate: f64,
    ) -> Self {
        Self {
            camera,
            distortion,
            depth_scale,
            exposure: ExposureSource::Assumed { seconds: assumed_exposure_seconds(frame_rate) },
            frame_rate,
            response: Response::Srgb,
            readout: Shutter::Global,
            depth_readout_seconds: 0.0,
            depth_delay_seconds: None,
            depth_clock_seconds: 0.0,
            vignetting: Vignetting::NONE,
            imu_from_camera: None,
            sources: CalibrationSources::GEOMETRY_ONLY,
        }
    }

    /// The same camera with a rolling shutter that is on record without its time.
    pub(super) fn rolling(mut self) -> Self {
        self.readout = Shutter::Rolling { seconds: None };
        self.sources.readout = Knowledge::Recorded;
        self
    }

    /// Takes over one fact, and how it came to be known, from another calibration of the same camera. Exposure times of
    /// single frames are not part of a calibration.
    pub fn take(&mut self, fact: CameraFact, other: &Self) {
        let sources = &other.sources;
        match fact {
            CameraFact::Camera => {
                (self.camera, self.distortion) = (other.camera, other.distortion);
                self.sources.camera = sources.camera;
            }
            CameraFact::DepthScale => {
                (self.depth_scale, self.sources.depth_scale) = (other.depth_scale, sources.depth_scale);
            }
            CameraFact::Exposure => {
                (self.exposure, self.sources.exposure) = (other.exposure, sources.exposure);
            }
            CameraFact::Readout => (self.readout, self.sources.readout) = (other.readout, sources.readout),
            CameraFact::Response => {
                (self.response, self.sources.response) = (other.response.clone(), sources.response);
            }
            CameraFact::Vignetting => {
                (self.vignetting, self.sources.vignetting) = (other.vignetting, sources.vignetting);
            }
            CameraFact::DepthDelay => {
                self.depth_delay_seconds = other.depth_delay_seconds;
                self.depth_clock_seconds = other.depth_clock_seconds;
                self.depth_readout_seconds = other.depth_readout_seconds;
                self.sources.depth_delay = sources.depth_delay;
            }
        }
    }

    /// Exposure time of a frame that has none of its own, seconds.
    pub(super) fn fallback_exposure_seconds(&self) -> f64 {
        match self.exposure {
            ExposureSource::Constant { seconds } | ExposureSource::Assumed { seconds } => seconds,
            ExposureSource::PerFrame => assumed_exposure_seconds(self.frame_rate),
        }
    }

    /// Settles where exposure times come from, once it is known whether there is one for each frame.
    pub(super) fn settle_exposure(&mut self, is_listed: bool) {
        if is_listed {
            self.exposure = ExposureSource::PerFrame;
            if self.sources.exposure == Knowledge::Assumed {
                self.sources.exposure = Knowledge::Recorded;
            }
        } else if let ExposureSource::Assumed { .. } = self.exposure {
            self.sources.exposure = Knowledge::Assumed;
        }
    }

    /// Checks every number.
    pub(super) fn check(&self) -> Result<(), InvalidValue> {
        check_camera(&self.camera)?;
        let Distortion { k1, k2, p1, p2, k3 } = self.distortion;
        if let Some(bad) = [k1, k2, p1, p2, k3].into_iter().find(|k| !k.is_finite()) {
            return Err(invalid("distortion", bad, "finite numbers"));
        }
        self.check_lens()?;
        // Written so that NaN is refused.
        if !(self.depth_scale > 1.0 && self.depth_scale <= MAX_DEPTH_SCALE) {
            let expected = "a positive number of raw units per metre, above 1 and at most 1000000 (millimetres are 1000)";
            return Err(invalid("depth_scale", self.depth_scale, expected));
        }
        check_positive("frame_rate", self.frame_rate, "a positive number of frames per second")?;
        if let ExposureSource::Constant { seconds } | ExposureSource::Assumed { seconds } = self.exposure {
            check_exposure(seconds)?;
        }
        self.check_times()?;
        self.check_optics()
    }

    /// Checks that the lens maps directions further out to pixels further out, as far as its edges: where it folds
    /// over, a pixel has two directions. Corners may, as polynomials of low order do there.
    fn check_lens(&self) -> Result<(), InvalidValue> {
        let PinholeCamera { width, height, fx, fy, cx, cy } = self.camera;
        let Distortion { k1, k2, k3, .. } = self.distortion;
        let reach = |centre: f64, side: usize, focal: f64| {
            centre.abs().max((side as f64 - 1.0 - centre).abs()) / focal
        };
        let farthest = reach(cx, width, fx).max(reach(cy, height, fy));
        let folds = |step: u32| {
            let r2 = (farthest * f64::from(step) / f64::from(LENS_SAMPLES)).powi(2);
            // The derivative of r (1 + k1 r^2 + k2 r^4 + k3 r^6).
            1.0 + r2 * (3.0 * k1 + r2 * (5.0 * k2 + r2 * 7.0 * k3)) <= 0.0
        };
        if (0..=LENS_SAMPLES).any(folds) {
            let value = format!("[{k1}, {k2}, .., {k3}]");
            let expected = "k1 k2 p1 p2 k3 of a lens that does not fold the image over";
            return Err(InvalidValue { key: "distortion", value, expected });
        }
        Ok(())
    }

    /// Checks readout and delay.
    fn check_times(&self) -> Result<(), InvalidValue> {
        let readouts = [
            ("readout_seconds", self.readout.readout_seconds().unwrap_or(0.0)),
            ("depth_readout_seconds", self.depth_readout_seconds),
        ];
        for (key, seconds) in readouts {
            if !(-MAX_READOUT..=MAX_READOUT).contains(&seconds) {
                return Err(invalid(key, seconds, "seconds from the first row to the last, -0.1 to 0.1"));
            }
        }
        let clock = self.depth_clock_seconds;
        if !(-MAX_DEPTH_DELAY..=MAX_DEPTH_DELAY).contains(&clock) {
            return Err(invalid(
                "depth_clock_seconds",
                clock,
                "seconds to add to depth's timestamps, -0.2 to 0.2",
            ));
        }
        if clock != 0.0 && self.depth_delay_seconds.is_some() {
            let expected = "0 or nothing beside depth_delay_seconds, which replaces the timestamps";
            return Err(invalid("depth_clock_seconds", clock, expected));
        }
        match self.depth_delay_seconds {
            Some(seconds) if !(-MAX_DEPTH_DELAY..=MAX_DEPTH_DELAY).contains(&seconds) => {
                Err(invalid("depth_delay_seconds", seconds, "seconds from colour to depth, -0.2 to 0.2"))
            }
            _ => Ok(()),
        }
    }

    /// Checks fall-off and the axes of the IMU.
    fn check_optics(&self) -> Result<(), InvalidValue> {
        let Vignetting { a2, a4 } = self.vignetting;
        // Written so that NaN is refused.
        let is_lit = self.vignetting.least() > 0.0;
        if !is_lit {
            return Err(InvalidValue {
                key: "vignetting",
                value: format!("[{a2}, {a4}]"),
                expected: "[a2, a4] with 1 + a2 r^2 + a4 r^4 above 0 for r from 0 to 1",
            });
        }
        match self.imu_from_camera {
            Some(rotation) if !is_rotation(&rotation) => {
                let value = format!("{:?}", rotation.matrix().transpose().as_slice());
                Err(InvalidValue { key: "imu_from_camera", value, expected: ROTATION })
            }
            _ => Ok(()),
        }
    }
}

/// What the nine numbers of a rotation must be.
pub(super) const ROTATION: &str =
    "the 9 numbers of a rotation, row by row, columns orthogonal and of length 1";

/// Largest element of `R R^T - I` of a rotation that is kept as it is.
const ROUNDING: f64 = 1e-12;

/// Whether the matrix is finite, orthonormal to rounding and right-handed.
fn is_rotation(rotation: &Rotation3<f64>) -> bool {
    let matrix = rotation.matrix();
    let deviation = matrix * matrix.transpose() - Matrix3::identity();
    // Written so that NaN is refused.
    deviation.iter().all(|element| element.abs() <= ROUNDING) && matrix.determinant() > 0.0
}

/// The rotation of nine numbers, row by row, that may be rounded to two decimals; none if they are no rotation.
pub(super) fn rotation_of(rows: &[f64; 9]) -> Option<Rotation3<f64>> {
    let exact = Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(rows));
    if is_rotation(&exact) {
        return Some(exact);
    }
    let matrix = exact.matrix();
    let deviation = matrix * matrix.transpose() - Matrix3::identity();
    let is_near = deviation.iter().all(|element| element.abs() <= 0.02) && matrix.determinant() > 0.0;
    if !is_near {
        return None;
    }
    // The nearest rotation: the singular values, all near 1, become 1.
    let parts = matrix.svd(true, true);
    Some(Rotation3::from_matrix_unchecked(parts.u? * parts.v_t?))
}

/// Checks an exposure time.
pub(super) fn check_exposure(seconds: f64) -> Result<(), InvalidValue> {
    if EXPOSURES.contains(&seconds) {
        return Ok(());
    }
    Err(invalid("exposure_seconds", seconds, "a positive number of seconds, 0.000001 to 1 (16 ms are 0.016)"))
}

/// Checks size, focal lengths and principal point.
pub fn check_camera(camera: &PinholeCamera) -> Result<(), InvalidValue> {
    for (key, side) in [("width", camera.width), ("height", camera.height)] {
        if side == 0 || side > MAX_SIDE {
            return Err(invalid(key, side, "a size from 1 to 16384 pixels"));
        }
    }
    if camera.width * camera.height > MAX_PIXELS {
        return Err(invalid("width", camera.width, "a size of at most 64 million pixels"));
    }
    // The comparisons are written so that NaN is refused.
    let (width, height) = (camera.width as f64, camera.height as f64);
    for (key, focal) in [("fx", camera.fx), ("fy", camera.fy)] {
        if !(focal > 1.0 && focal <= MAX_FOCAL_IN_WIDTHS * width) {
            return Err(invalid(
                key,
                focal,
                "a focal length in pixels, above 1 and at most 100 image widths",
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
pub fn check_positive(key: &'static str, value: f64, expected: &'static str) -> Result<(), InvalidValue> {
    if value.is_finite() && value > 0.0 { Ok(()) } else { Err(invalid(key, value, expected)) }
}

fn invalid(key: &'static str, value: impl Display, expected: &'static str) -> InvalidValue {
    let mut value = value.to_string();
    // Numbers of hundreds of digits are read best with an exponent.
    if value.len() > LONGEST_VALUE
        && let Ok(number) = value.parse::<f64>()
    {
        value = format!("{number:e}");
    }
    InvalidValue { key, value, expected }
}

/// Characters of a number that is shown digit by digit.
const LONGEST_VALUE: usize = 24;
