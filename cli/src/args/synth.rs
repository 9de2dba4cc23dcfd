//! Arguments of `mba synth`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use mba_mapper::FileError;
use mba_mapper::dataset::{Vignetting, read_response};
use mba_mapper::synth::{
    CameraMotion, DepthSensor, Events, FrameRanges, NoiseModel, ResponseCurve, SceneName, SensorModel,
    SynthConfig,
};

use super::values::{Switch, non_negative, size};

/// Arguments of `mba synth`.
#[derive(Debug, Args)]
#[command(after_help = "\
The data set has rgb/, depth/, lists, calibration.toml, groundtruth.txt and groundtruth_exposure.txt (poses \
at opening, middle and closing of the shutter). For judging results there are sharp/, every frame without blur \
and noise, and heldout_views/, such images from poses near the path, in poses.txt, that no frame has. Equal \
options give equal files.

A camera as they are in telephones has --readout, --depth-delay, --auto-exposure, --response with a file, \
--vignetting and --imu. The truth stays that of the middle of the image, and sharp/ has all rows at the same \
time. With --nothing-on-record, truth/ has what the calibration then lacks.

Examples:
  mba synth --out data
  mba synth --out hard --scene hall --blur 24 --exposure 0.028 --frames 60 --seed 7
  mba synth --out round --path loop --frames 240 --size 320x240 --blur 6
  mba synth --out flat --path walk --frames 2000 --size 320x240 --blur 6
  mba synth --out clean --response linear --noise off --depth exact
  mba synth --out telephone --readout 0.02 --depth-delay 0.011 --auto-exposure --vignetting=-0.35,0.05 --imu \
--nothing-on-record
  mba synth --out covered --black 10-15 --jump 40")]
pub struct Synth {
    /// New or empty folder for the data set
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// What the camera sees: room, hall or wall
    #[arg(long, value_name = "NAME", default_value_t = SynthConfig::default().scene)]
    pub scene: SceneName,
    /// Where the camera goes
    #[arg(long, value_enum, default_value_t)]
    pub path: PathName,
    /// Number of frames
    #[arg(long, value_name = "N", default_value_t = SynthConfig::default().frames)]
    pub frames: usize,
    /// Width and height of the images in pixels
    #[arg(long, value_name = "WxH", default_value = "640x480", value_parser = size)]
    pub size: (usize, usize),
    /// Mean blur length in pixels, that of the path included; 0 is without hand shake
    #[arg(long, value_name = "PX", default_value_t = 10.0, value_parser = non_negative)]
    pub blur: f64,
    /// Time the shutter is open, in seconds
    #[arg(long, value_name = "S", default_value_t = SynthConfig::default().exposure_seconds)]
    pub exposure: f64,
    /// Frames per second
    #[arg(long, value_name = "HZ", default_value_t = SynthConfig::default().frame_rate)]
    pub frame_rate: f64,
    /// How light becomes 8-bit values: srgb, linear or a .csv or .txt file (256 lights, or rows `light,value`)
    #[arg(long, value_name = "NAME|FILE", default_value = "srgb")]
    pub response: ResponseChoice,
    /// Photon and read noise of the colour images
    #[arg(long, value_enum, default_value_t)]
    pub noise: Switch,
    /// Depth as a structured-light sensor sees it, or exact
    #[arg(long, value_enum, default_value_t)]
    pub depth: DepthName,
    /// Seed of hand shake and noise
    #[arg(long, value_name = "N", default_value_t = SynthConfig::default().seed)]
    pub seed: u64,
    /// Time from the exposure of the first row to that of the last, in seconds; negative: the last row comes first
    #[arg(long, value_name = "S", default_value_t = 0.0, allow_negative_numbers = true)]
    pub readout: f64,
    /// How much later than colour depth is measured, in seconds
    #[arg(long, value_name = "S", default_value_t = 0.0, allow_negative_numbers = true)]
    pub depth_delay: f64,
    /// Time from the first row of depth to the last, in seconds; 0: all are measured together
    #[arg(long, value_name = "S", default_value_t = 0.0, allow_negative_numbers = true)]
    pub depth_readout: f64,
    /// Exposure times that follow the brightness of the frame before, 7/16 to 18/16 of --exposure; the gain stays
    #[arg(long)]
    pub auto_exposure: bool,
    /// Fall-off of light, 1 + A2 r^2 + A4 r^4 with r = 1 in the corner
    #[arg(long, value_name = "A2,A4", default_value = "0,0", value_parser = vignetting, allow_hyphen_values = true)]
    pub vignetting: Vignetting,
    /// Record angular velocity and specific force at 200 Hz, with the errors of a telephone's sensor, in imu.csv
    #[arg(long, conflicts_with = "jump")]
    pub imu: bool,
    /// Leave exposure times, readout, response and fall-off out of the calibration and put them into truth/
    #[arg(long)]
    pub nothing_on_record: bool,
    /// Frames with a covered lens, without colour and depth, e.g. 10-15,20
    #[arg(long, value_name = "FRAMES", default_value = "none", value_parser = frames)]
    pub black: FrameRanges,
    /// Frames with the sun in the lens: white, without depth
    #[arg(long, value_name = "FRAMES", default_value = "none", value_parser = frames)]
    pub saturated: FrameRanges,
    /// From this frame on the camera goes again where it went from the first frame on
    #[arg(long, value_name = "FRAME")]
    pub jump: Option<usize>,
}

impl Synth {
    /// The settings of the generator.
    ///
    /// # Errors
    /// [`FileError`] when the response cannot be read.
    pub fn config(&self) -> Result<SynthConfig, FileError> {
        let defaults = SynthConfig::default();
        Ok(SynthConfig {
            scene: self.scene,
            motion: match self.path {
                PathName::Shake => CameraMotion::Sweep,
                PathName::Loop => CameraMotion::Loop,
                PathName::Walk => CameraMotion::Walk,
            },
            frames: self.frames,
            width: self.size.0,
            height: self.size.1,
            frame_rate: self.frame_rate,
            exposure_seconds: self.exposure,
            mean_blur_px: self.blur,
            noise: (self.noise == Switch::On).then(NoiseModel::default),
            depth: match self.depth {
                DepthName::Sensor => DepthSensor::StructuredLight,
                DepthName::Exact => DepthSensor::Exact,
            },
            response: self.response.curve()?,
            seed: self.seed,
            sensor: SensorModel {
                readout_seconds: self.readout,
                depth_delay_seconds: self.depth_delay,
                depth_readout_seconds: self.depth_readout,
                auto_exposure: self.auto_exposure,
                vignetting: self.vignetting,
                imu: self.imu,
                is_on_record: !self.nothing_on_record,
            },
            events: Events { black: self.black.clone(), saturated: self.saturated.clone(), jump: self.jump },
            ..defaults
        })
    }
}

/// Values of `--path`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum PathName {
    /// Slowly to and fro over one side of the scene
    #[default]
    Shake,
    /// Once round the scene, within all frames, and back to where it began
    Loop,
    /// Through a row of rooms and back, a round in each, for as long as there are frames; of the room only
    Walk,
}

/// Values of `--response`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ResponseChoice {
    /// The sRGB transfer function.
    Srgb,
    /// Proportional to light.
    Linear,
    /// In a file.
    Measured(PathBuf),
}

impl FromStr for ResponseChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "srgb" => Ok(Self::Srgb),
            "linear" => Ok(Self::Linear),
            file if file.ends_with(".csv") || file.ends_with(".txt") => Ok(Self::Measured(file.into())),
            _ => Err("srgb, linear or the name of a .csv or .txt file is needed".to_owned()),
        }
    }
}

impl ResponseChoice {
    fn curve(&self) -> Result<ResponseCurve, FileError> {
        match self {
            Self::Srgb => Ok(ResponseCurve::Srgb),
            Self::Linear => Ok(ResponseCurve::Linear),
            Self::Measured(file) => Ok(ResponseCurve::Measured(Box::new(read_response(file)?))),
        }
    }
}

/// Values of `--depth`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum DepthName {
    /// Noise, steps and holes of a structured-light sensor
    #[default]
    Sensor,
    /// Exact and without holes
    Exact,
}

/// Two numbers with a comma between them.
fn vignetting(text: &str) -> Result<Vignetting, String> {
    let parsed =
        text.split_once(',').and_then(|(a2, a4)| Some((a2.trim().parse().ok()?, a4.trim().parse().ok()?)));
    let (a2, a4) = parsed.ok_or_else(|| "two numbers such as -0.35,0.05 are needed".to_owned())?;
    Ok(Vignetting { a2, a4 })
}

/// Ranges of frames, or `none`.
fn frames(text: &str) -> Result<FrameRanges, String> {
    if text == "none" {
        return Ok(FrameRanges::NONE);
    }
    text.parse().map_err(|_| "ranges such as 10-15,20 are needed".to_owned())
}
