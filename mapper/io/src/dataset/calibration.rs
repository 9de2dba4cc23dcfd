//! What has to be known about the camera, and checks that it makes sense.

use mba_tracker::geometry::{Distortion, PinholeCamera};
use mba_tracker::photometric::{InverseResponse, Vignetting};
use nalgebra::Rotation3;

use super::depth_camera::DepthCamera;
use super::knowledge::{CalibrationSources, CameraFact, Knowledge};
use super::validity::{InvalidValue, ROTATION, check_camera, invalid, is_rotation};

/// Everything known about the camera of a data set.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Intrinsics of the frames as delivered, i.e. after undistortion.
    pub camera: PinholeCamera,
    /// Distortion of the stored images; it is removed on reading.
    pub distortion: Distortion,
    /// The camera of the stored depth images. Without it they are registered to colour pixel by pixel, or show the same
    /// view with larger or smaller pixels.
    pub depth_camera: Option<DepthCamera>,
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

/// Frames per second that a calibration may have: from a picture in a quarter of an hour to more than any camera takes.
const FRAME_RATES: std::ops::RangeInclusive<f64> = 1e-3..=1e5;

impl Calibration {
    /// A camera of which nothing is known but its geometry, depth scale and frame rate: exposure and response are
    /// assumed, the shutter is taken for global, and nothing falls off or comes late.
    #[must_use]
    pub fn of_geometry(
        camera: PinholeCamera,
        distortion: Distortion,
        depth_scale: f64,
        frame_rate: f64,
    ) -> Self {
        Self {
            camera,
            distortion,
            depth_camera: None,
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
        self.depth_camera.iter().try_for_each(DepthCamera::check)?;
        // Written so that NaN is refused.
        if !(self.depth_scale > 1.0 && self.depth_scale <= MAX_DEPTH_SCALE) {
            let expected = "a positive number of raw units per metre, above 1 and at most 1000000 (millimetres are 1000)";
            return Err(invalid("depth_scale", self.depth_scale, expected));
        }
        if !FRAME_RATES.contains(&self.frame_rate) {
            return Err(invalid("frame_rate", self.frame_rate, "frames per second, 0.001 to 100000"));
        }
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
        // One says how wrong timestamps are, the other what to have instead of them.
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
        let is_lens = [a2, a4].iter().all(|part| part.abs() <= MAX_VIGNETTING);
        if !(is_lit && is_lens) {
            return Err(InvalidValue {
                key: "vignetting",
                value: format!("[{a2}, {a4}]"),
                expected: "[a2, a4], each from -10 to 10, with 1 + a2 r^2 + a4 r^4 above 0 for r from 0 to 1",
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

/// Largest coefficient of a fall-off: the light of a lens that has lost all but a tenth in its corners needs 2.
const MAX_VIGNETTING: f64 = 10.0;

/// Checks an exposure time.
pub(super) fn check_exposure(seconds: f64) -> Result<(), InvalidValue> {
    if EXPOSURES.contains(&seconds) {
        return Ok(());
    }
    Err(invalid("exposure_seconds", seconds, "a positive number of seconds, 0.000001 to 1 (16 ms are 0.016)"))
}
