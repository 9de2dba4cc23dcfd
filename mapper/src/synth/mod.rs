//! Synthetic sequences: a ray caster for analytic, textured scenes with a camera in a shaking hand.
//!
//! Every frame is the mean of many sharp sub-frames in linear light, so its blur is real; the camera's path is
//! known exactly at every instant, so ground truth is too. Motion within an exposure is smooth but not exactly
//! linear, as it is in life.
//!
//! ```
//! use mba_mapper::synth::{CameraMotion, SynthConfig, SynthSequence};
//!
//! let config = SynthConfig { frames: 3, width: 32, height: 24, motion: CameraMotion::MeanBlur(2.0), ..Default::default() };
//! let sequence = SynthSequence::new(config)?;
//! let frame = sequence.render_frame(1);
//! assert_eq!((frame.rgb.len(), frame.depth.len()), (3 * 32 * 24, 32 * 24));
//! assert_eq!(frame.exposure, sequence.exposure(1));
//! # Ok::<(), mba_mapper::synth::SynthError>(())
//! ```

mod blur;
mod calibrate;
mod config;
mod depth;
mod error;
mod illumination;
mod noise;
mod output;
mod pattern;
mod render;
mod scene;
mod scenes;
mod sensor;
mod sequence;
mod shape;
#[cfg(test)]
mod tests;
mod texture;
mod trajectory;

pub use blur::BlurStatistics;
pub use config::{CameraMotion, DepthSensor, OutputResponse, SceneName, SensorNoise, SynthConfig};
pub use error::SynthError;
pub use output::{Summary, write_dataset};
pub use sequence::{SynthFrame, SynthSequence};
