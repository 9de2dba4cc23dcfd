//! What a synthetic sequence is made of.

use std::fmt;
use std::str::FromStr;

use mba_io::dataset::Vignetting;
use mba_tracker::geometry::PinholeCamera;
use mba_tracker::photometric::InverseResponse;

use super::{Events, SynthError};

/// Settings of a synthetic sequence; the same settings give the same sequence, bit for bit.
#[derive(Clone, Debug, PartialEq)]
pub struct SynthConfig {
    /// The world that is filmed.
    pub scene: SceneName,
    /// Where the camera goes.
    pub motion: CameraMotion,
    /// Number of frames, 1 to 100 000.
    pub frames: usize,
    /// Image width in pixels, 16 to 4096.
    pub width: usize,
    /// Image height in pixels, 16 to 4096.
    pub height: usize,
    /// Frames per second, 1 to 1000.
    pub frame_rate: f64,
    /// Time the shutter is open, seconds; above 0 and at most the frame interval.
    pub exposure_seconds: f64,
    /// Mean over pixels and frames of the distance in pixels between where a surface point is imaged at shutter
    /// opening and at closing. The hand shake is scaled to meet it; 0 is a camera that does not shake, and stands
    /// still unless it goes a [`CameraMotion::Loop`]. At most an eighth of the width.
    pub mean_blur_px: f64,
    /// Factor on the light before the response, above 0; 1 exposes the scenes well.
    pub gain: f64,
    /// How the stored values follow from light.
    pub response: ResponseCurve,
    /// Noise of the colour images; none for clean images.
    pub noise: Option<NoiseModel>,
    /// How depth is measured.
    pub depth: DepthSensor,
    /// Seed of hand shake and noise. The scenes are always the same.
    pub seed: u64,
    /// In what the camera differs from one with a global shutter and everything on record.
    pub sensor: SensorModel,
    /// What goes wrong on the way.
    pub events: Events,
}

/// In what a camera differs from an ideal one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorModel {
    /// Time from the exposure of the first row to that of the last, seconds; negative when the last comes first, 0 for
    /// a global shutter. At most 0.1 and the frame interval. Row v is exposed around the timestamp plus
    /// `((v + 1/2) / height - 1/2)` of it.
    pub readout_seconds: f64,
    /// How much later than the middle of the colour image the middle row of depth is measured, seconds; from -0.2 to
    /// 0.2.
    pub depth_delay_seconds: f64,
    /// Time from the first row of depth to the last, seconds, in the limits of that of colour; 0 if all are measured
    /// together.
    pub depth_readout_seconds: f64,
    /// Whether exposure times follow the brightness of the frame before, between 7/16 and 18/16 of the one that is
    /// set. The gain stays, so a longer exposure is a brighter picture.
    pub auto_exposure: bool,
    /// How light falls off towards the corners; above 0 everywhere.
    pub vignetting: Vignetting,
    /// Whether an IMU records, at the camera's centre and in its axes.
    pub imu: bool,
    /// Whether exposure times, readout time, response and fall-off are on record.
    pub is_on_record: bool,
}

impl SensorModel {
    /// A global shutter of constant exposure, depth at the same time, no fall-off, no IMU, everything on record.
    pub const IDEAL: Self = Self {
        readout_seconds: 0.0,
        depth_delay_seconds: 0.0,
        depth_readout_seconds: 0.0,
        auto_exposure: false,
        vignetting: Vignetting::NONE,
        imu: false,
        is_on_record: true,
    };
}

impl Default for SensorModel {
    fn default() -> Self {
        Self::IDEAL
    }
}

impl Default for SynthConfig {
    fn default() -> Self {
        Self {
            scene: SceneName::Room,
            motion: CameraMotion::Sweep,
            frames: 90,
            width: 640,
            height: 480,
            frame_rate: 30.0,
            exposure_seconds: 0.016,
            mean_blur_px: 8.0,
            gain: 1.0,
            response: ResponseCurve::Srgb,
            noise: None,
            depth: DepthSensor::Exact,
            seed: 1,
            sensor: SensorModel::IDEAL,
            events: Events::NONE,
        }
    }
}

/// The worlds that can be filmed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SceneName {
    /// A furnished room, surfaces 0.8 to 6 m away.
    Room,
    /// A hall with rows of columns, surfaces 1.5 to 13 m away.
    Hall,
    /// One flat textured wall 2.5 m away: degenerate for depth alignment.
    Wall,
}

/// Where the camera goes; the hand shakes in any case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraMotion {
    /// Slowly to and fro over one side of the scene, for as long as there are frames.
    Sweep,
    /// Once round the scene, all frames together: the last one looks from the place of the first the same way, and
    /// half way there is nothing in view that the first one sees. The shake comes on top, so the blur asked for
    /// cannot be less than that of the way alone.
    Loop,
    /// Through a row of rooms, for as long as there are frames: once round a room, through a door and round the next one, back
    /// and round the first one again, and so on one room further. A round takes 7 to 10 seconds, a way between two rooms 6. Of
    /// the scenes only the room has doors.
    Walk,
}

/// How the stored 8-bit values follow from light.
#[derive(Clone, Debug, PartialEq)]
pub enum ResponseCurve {
    /// The sRGB transfer function (IEC 61966-2-1).
    Srgb,
    /// Proportional to light.
    Linear,
    /// The response of a real camera, given by the light of each code; straight lines in between.
    Measured(Box<InverseResponse>),
}

/// How depth is measured, all pixels at one time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DepthSensor {
    /// The true depth, rounded to the file's 0.2 mm.
    Exact,
    /// As a structured-light camera measures it: errors of constant size in disparity, correlated over a few
    /// pixels, whole millimetres, holes at depth edges, at grazing angles and beyond 8 m.
    StructuredLight,
}

/// Shot noise and read noise of an image sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseModel {
    /// Electrons of a pixel at full scale, above 0.
    pub full_well: f64,
    /// Standard deviation of the read noise in electrons, not negative.
    pub read_noise: f64,
}

impl Default for NoiseModel {
    /// A small-pixel video camera: 12 000 electrons full well, 5 electrons read noise.
    fn default() -> Self {
        Self { full_well: 12_000.0, read_noise: 5.0 }
    }
}

impl SynthConfig {
    /// The camera: focal length 500/640 of the width, principal point in the middle of the image.
    #[must_use]
    pub fn camera(&self) -> PinholeCamera {
        let focal = 500.0 * self.width as f64 / 640.0;
        PinholeCamera {
            width: self.width,
            height: self.height,
            fx: focal,
            fy: focal,
            cx: (self.width as f64 - 1.0) / 2.0,
            cy: (self.height as f64 - 1.0) / 2.0,
        }
    }

    /// Checks every number.
    pub(super) fn check(&self) -> Result<(), SynthError> {
        let interval = 1.0 / self.frame_rate;
        // More blur than an eighth of the image leaves nothing to track.
        let longest_blur = self.width as f64 / 8.0;
        let well = self.noise.map_or(1.0, |noise| noise.full_well);
        let read = self.noise.map_or(0.0, |noise| noise.read_noise);
        let checks = [
            ("frames", self.frames as f64, 1.0..=1e5, "1 to 100000"),
            ("width", self.width as f64, 16.0..=4096.0, "16 to 4096 pixels"),
            ("height", self.height as f64, 16.0..=4096.0, "16 to 4096 pixels"),
            ("frame rate", self.frame_rate, 1.0..=1000.0, "1 to 1000 frames per second"),
            ("exposure", self.exposure_seconds, 1e-6..=interval, "1e-6 seconds to the frame interval"),
            (
                "mean blur",
                self.mean_blur_px,
                0.0..=longest_blur,
                "0 to an eighth of the image width in pixels",
            ),
            ("gain", self.gain, 1e-6..=1e6, "1e-6 to 1e6"),
            ("full well", well, 1.0..=1e9, "1 to 1e9 electrons"),
            ("read noise", read, 0.0..=1e9, "0 to 1e9 electrons"),
        ];
        if self.motion == CameraMotion::Walk && self.scene != SceneName::Room {
            return Err(SynthError::NoDoors { scene: self.scene.name() });
        }
        self.check_sensor()?;
        self.check_events()?;
        match checks.into_iter().find(|(_, value, range, _)| !range.contains(value)) {
            Some((setting, value, _, expected)) => Err(SynthError::Setting { setting, value, expected }),
            None => Ok(()),
        }
    }

    /// Checks what differs from an ideal camera.
    fn check_sensor(&self) -> Result<(), SynthError> {
        let SensorModel { readout_seconds, depth_delay_seconds, depth_readout_seconds, vignetting, .. } =
            self.sensor;
        // Rows of one frame are read before those of the next, and a tenth of a second is no camera.
        let longest_readout = (1.0 / self.frame_rate).min(0.1);
        let readouts = -longest_readout..=longest_readout;
        let of_at_most = "seconds of at most 0.1 and the frame interval, either way";
        let checks = [
            ("readout", readout_seconds, readouts.clone(), of_at_most),
            ("depth readout", depth_readout_seconds, readouts, of_at_most),
            ("depth delay", depth_delay_seconds, -0.2..=0.2, "-0.2 to 0.2 seconds"),
            ("least light of the fall-off", vignetting.least(), 1e-3..=1.0, "0.001 to 1"),
        ];
        match checks.into_iter().find(|(_, value, range, _)| !range.contains(value)) {
            Some((setting, value, _, expected)) => Err(SynthError::Setting { setting, value, expected }),
            None => Ok(()),
        }
    }

    /// Checks that what goes wrong does so within the sequence.
    fn check_events(&self) -> Result<(), SynthError> {
        let Events { black, saturated, jump } = &self.events;
        let beyond = |index: &usize| *index >= self.frames;
        let outside = |setting, index: usize, expected| {
            Err(SynthError::Setting { setting, value: index as f64, expected })
        };
        // Ranges are in order: the last index is the largest.
        for (setting, ranges) in [("black frame", black), ("saturated frame", saturated)] {
            if let Some(index) = ranges.last().filter(beyond) {
                return outside(setting, index, "frames of the sequence, counted from 0");
            }
        }
        match *jump {
            Some(index) if index == 0 || beyond(&index) => {
                outside("jump at frame", index, "a frame of the sequence after the first")
            }
            // A jump has no acceleration that an IMU could have measured.
            Some(index) if self.sensor.imu => {
                outside("jump at frame", index, "none with an IMU, which would have to feel it")
            }
            _ => Ok(()),
        }
    }
}

impl ResponseCurve {
    /// Name as in `calibration.toml`; a measured response is in the file of this name.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Srgb => "srgb",
            Self::Linear => "linear",
            Self::Measured(_) => "response_table.csv",
        }
    }
}

impl SceneName {
    /// All scenes.
    pub const ALL: [Self; 3] = [Self::Room, Self::Hall, Self::Wall];

    /// Name in lower case, as [`FromStr`] reads it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Room => "room",
            Self::Hall => "hall",
            Self::Wall => "wall",
        }
    }
}

impl fmt::Display for SceneName {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

impl FromStr for SceneName {
    type Err = SynthError;

    fn from_str(name: &str) -> Result<Self, SynthError> {
        let known = Self::ALL.into_iter().find(|scene| scene.name() == name);
        known.ok_or_else(|| SynthError::UnknownScene { name: name.to_owned() })
    }
}
