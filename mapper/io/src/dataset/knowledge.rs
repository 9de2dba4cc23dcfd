//! How each fact about a camera came to be known.

use serde::{Deserialize, Serialize};

/// Where a fact about the camera comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Knowledge {
    /// It stands in the files of the data set, or is published for the camera.
    Recorded,
    /// It is not on record; the usual value stands in.
    #[default]
    Assumed,
    /// It was found from the recording itself.
    Estimated,
}

impl Knowledge {
    /// The word for it in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Recorded => "recorded",
            Self::Assumed => "assumed",
            Self::Estimated => "estimated",
        }
    }
}

/// Facts about a camera whose origin is kept; the names are those of the list `estimated` in `calibration.toml`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CameraFact {
    /// Focal lengths, principal point and distortion.
    Camera,
    /// Raw depth units per metre.
    DepthScale,
    /// Exposure times.
    Exposure,
    /// Readout time of the colour image.
    Readout,
    /// How stored values follow from light.
    Response,
    /// Fall-off of light towards the corners.
    Vignetting,
    /// Time from a colour image to its depth image, and of the rows of depth. Assumed where only the timestamps tell.
    DepthDelay,
}

impl CameraFact {
    /// All facts.
    pub const ALL: [Self; 7] = [
        Self::Camera,
        Self::DepthScale,
        Self::Exposure,
        Self::Readout,
        Self::Response,
        Self::Vignetting,
        Self::DepthDelay,
    ];

    /// Name in `calibration.toml`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::DepthScale => "depth_scale",
            Self::Exposure => "exposure",
            Self::Readout => "readout",
            Self::Response => "response",
            Self::Vignetting => "vignetting",
            Self::DepthDelay => "depth_delay",
        }
    }
}

/// The origin of each fact about a camera; by default all are assumed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CalibrationSources {
    /// Of focal lengths, principal point and distortion.
    pub camera: Knowledge,
    /// Of the raw depth units per metre.
    pub depth_scale: Knowledge,
    /// Of the exposure times; assumed exactly when [`super::ExposureSource::Assumed`] says so.
    pub exposure: Knowledge,
    /// Of the readout time. A camera that is on record as rolling, without its time, is recorded.
    pub readout: Knowledge,
    /// Of the response.
    pub response: Knowledge,
    /// Of the fall-off of light.
    pub vignetting: Knowledge,
    /// Of the delay of depth; assumed where only the timestamps tell.
    pub depth_delay: Knowledge,
}

impl CalibrationSources {
    /// A camera of which only geometry and depth scale are on record.
    pub(super) const GEOMETRY_ONLY: Self = Self {
        camera: Knowledge::Recorded,
        depth_scale: Knowledge::Recorded,
        exposure: Knowledge::Assumed,
        readout: Knowledge::Assumed,
        response: Knowledge::Assumed,
        vignetting: Knowledge::Assumed,
        depth_delay: Knowledge::Assumed,
    };

    /// The origin of one fact.
    #[must_use]
    pub fn of(&self, fact: CameraFact) -> Knowledge {
        match fact {
            CameraFact::Camera => self.camera,
            CameraFact::DepthScale => self.depth_scale,
            CameraFact::Exposure => self.exposure,
            CameraFact::Readout => self.readout,
            CameraFact::Response => self.response,
            CameraFact::Vignetting => self.vignetting,
            CameraFact::DepthDelay => self.depth_delay,
        }
    }
}
