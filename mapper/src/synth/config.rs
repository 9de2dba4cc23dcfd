//! What to synthesise.

use std::fmt;
use std::str::FromStr;

use super::SynthError;

/// The built-in scenes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SceneName {
    /// A furnished room with pictures, books, a table and crates; depths from 0.8 to 6 m.
    #[default]
    Room,
    /// A stone hall with columns and statuary of simple solids; depths from 2 to 16 m.
    Hall,
    /// A crowded desk from nearby; depths from 0.4 to 2 m.
    Desk,
    /// One flat brick wall, 2 m away: the simplest case there is.
    Wall,
}

impl SceneName {
    /// All scenes.
    pub const ALL: [Self; 4] = [Self::Room, Self::Hall, Self::Desk, Self::Wall];

    /// The name by which the scene is selected.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Room => "room",
            Self::Hall => "hall",
            Self::Desk => "desk",
            Self::Wall => "wall",
        }
    }
}

impl fmt::Display for SceneName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl FromStr for SceneName {
    type Err = SynthError;

    fn from_str(name: &str) -> Result<Self, SynthError> {
        Self::ALL
            .into_iter()
            .find(|scene| scene.as_str() == name)
            .ok_or_else(|| SynthError::UnknownScene { name: name.to_owned() })
    }
}

/// How violently the camera moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CameraMotion {
    /// It rests.
    Still,
    /// A slow sweep and as much hand shake as gives this mean blur: the distance in pixels between the images of a
    /// surface point at shutter opening and closing, averaged over pixels and frames. Not negative, at most 200.
    MeanBlur(f64),
    /// A slow sweep and a hand shake of this root mean square angular rate (about the camera's x and y axes each)
    /// in rad/s; from 0 to 10.
    Shake(f64),
}

/// Photon and read noise of the colour sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorNoise {
    /// Electrons at linear light 1; positive.
    pub full_well_electrons: f64,
    /// Standard deviation of the read noise in electrons; not negative.
    pub read_noise_electrons: f64,
}

impl Default for SensorNoise {
    fn default() -> Self {
        Self { full_well_electrons: 12_000.0, read_noise_electrons: 5.0 }
    }
}

/// What the depth images look like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DepthSensor {
    /// Exact to the quantum of 0.2 mm, valid everywhere.
    #[default]
    Exact,
    /// Like a structured-light sensor: correlated disparity noise with a standard deviation of 0.0019 z² metres,
    /// millimetre steps, holes at depth edges, at grazing angles and beyond 8 m.
    StructuredLight,
}

/// How light becomes 8-bit values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OutputResponse {
    /// The sRGB transfer function.
    #[default]
    Srgb,
    /// Proportional to light.
    Linear,
}

impl OutputResponse {
    /// The value of `response` in `calibration.toml`.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Srgb => "srgb",
            Self::Linear => "linear",
        }
    }
}

/// Settings of a synthetic sequence. Equal settings give equal sequences, bit for bit.
#[derive(Clone, Debug, PartialEq)]
pub struct SynthConfig {
    /// Which scene.
    pub scene: SceneName,
    /// Number of frames, from 1 to 100 000.
    pub frames: usize,
    /// Image width in pixels, from 16 to 4096. The focal length is 500/640 of it.
    pub width: usize,
    /// Image height in pixels, from 16 to 4096.
    pub height: usize,
    /// Frames per second; positive.
    pub frame_rate: f64,
    /// Exposure time in seconds; positive and at most the frame interval.
    pub exposure_seconds: f64,
    /// Sweep and shake of the camera.
    pub motion: CameraMotion,
    /// Factor on the light before noise and response; positive. At 1 hardly anything saturates.
    pub gain: f64,
    /// Noise of the colour sensor, or none.
    pub noise: Option<SensorNoise>,
    /// The depth sensor.
    pub depth: DepthSensor,
    /// How light becomes 8-bit values.
    pub response: OutputResponse,
    /// Readings per second in `gyro.csv`, or none; positive.
    pub gyro_rate: Option<f64>,
    /// Seed of shake and noise; the scene is always the same.
    pub seed: u64,
}

impl Default for SynthConfig {
    fn default() -> Self {
        Self {
            scene: SceneName::Room,
            frames: 120,
            width: 640,
            height: 480,
            frame_rate: 30.0,
            exposure_seconds: 0.016,
            motion: CameraMotion::MeanBlur(10.0),
            gain: 1.0,
            noise: Some(SensorNoise::default()),
            depth: DepthSensor::StructuredLight,
            response: OutputResponse::Srgb,
            gyro_rate: Some(200.0),
            seed: 1,
        }
    }
}

/// The range of a setting, for messages.
struct Range {
    setting: &'static str,
    value: f64,
    valid: bool,
    expected: &'static str,
}

impl SynthConfig {
    /// Checks every number.
    pub(super) fn check(&self) -> Result<(), SynthError> {
        let interval = 1.0 / self.frame_rate;
        let within = |value: f64, low: f64, high: f64| value >= low && value <= high;
        let positive = |value: f64| value.is_finite() && value > 0.0;
        let range = |setting, value, valid, expected| Range { setting, value, valid, expected };
        let (blur, shake) = match self.motion {
            CameraMotion::Still => (0.0, 0.0),
            CameraMotion::MeanBlur(pixels) => (pixels, 0.0),
            CameraMotion::Shake(rate) => (0.0, rate),
        };
        let noise = self.noise.unwrap_or_default();
        let gyro_rate = self.gyro_rate.unwrap_or(1.0);
        let [width, height, frames] = [self.width, self.height, self.frames].map(|count| count as f64);
        let exposure = self.exposure_seconds;
        let exposure_fits = positive(exposure) && exposure <= interval * 1.000_001;
        let well = noise.full_well_electrons;
        let read = noise.read_noise_electrons;
        let ranges = [
            range("frames", frames, within(frames, 1.0, 1e5), "1 to 100000"),
            range("width", width, within(width, 16.0, 4096.0), "16 to 4096 pixels"),
            range("height", height, within(height, 16.0, 4096.0), "16 to 4096 pixels"),
            range(
                "frame rate",
                self.frame_rate,
                within(self.frame_rate, 0.1, 1e4),
                "0.1 to 10000 per second",
            ),
            range("exposure", exposure, exposure_fits, "seconds, above 0 and at most the frame interval"),
            range("mean blur", blur, within(blur, 0.0, 200.0), "0 to 200 pixels"),
            range("shake", shake, within(shake, 0.0, 10.0), "0 to 10 rad/s"),
            range("gain", self.gain, positive(self.gain), "a positive number"),
            range("full well", well, positive(well), "a positive number of electrons"),
            range("read noise", read, read >= 0.0 && read.is_finite(), "electrons, 0 or more"),
            range("gyro rate", gyro_rate, within(gyro_rate, 1e-3, 1e5), "0.001 to 100000 per second"),
        ];
        ranges.into_iter().find(|range| !range.valid).map_or(Ok(()), |bad| {
            Err(SynthError::Setting { setting: bad.setting, value: bad.value, expected: bad.expected })
        })
    }
}
