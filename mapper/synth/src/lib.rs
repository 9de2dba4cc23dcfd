//! Synthetic RGB-D sequences with motion blur and exact ground truth.
//!
//! A ray caster films analytic scenes with a camera that sweeps slowly, or goes round, and shakes. Each frame is the mean, in
//! linear light, of many views within the exposure, so its blur is that of the true motion, which is smooth but
//! not linear. Then come fall-off, gain, noise, response and rounding. A [`SensorModel`] has rows that are exposed one
//! after the other, depth that comes late, exposure times of its own choice and an IMU. On one machine equal settings give equal sequences
//! bit for bit, for any number of threads.
//!
//! World y is up; camera x is right, y down, z forward; poses are `world_from_camera`; metres and seconds.
//!
//! ```
//! use mba_synth::{SynthConfig, SynthSequence};
//!
//! let config = SynthConfig { frames: 2, width: 64, height: 48, mean_blur_px: 1.0, ..SynthConfig::default() };
//! let sequence = SynthSequence::new(config)?;
//! let frame = sequence.render_frame(1);
//! assert_eq!(frame.rgb.len(), 3 * 64 * 48);
//! assert!(frame.depth.iter().all(|depth| (2500..35_000).contains(depth)), "half a metre to seven metres");
//! # Ok::<(), mba_synth::SynthError>(())
//! ```

mod auto_exposure;
mod blur;
mod config;
mod depth_sensor;
mod description;
mod develop;
mod error;
mod events;
mod heading;
mod heldout;
mod inertial;
mod motion;
mod random;
mod render;
mod round;
mod scene;
#[cfg(test)]
mod sensor_tests;
mod sequence;
#[cfg(test)]
mod sequence_tests;
mod summary;
mod surface;
mod timing;
mod truth;
mod view;
mod walk;
mod writer;

pub use blur::BlurFigure;
pub use config::{CameraMotion, DepthSensor, NoiseModel, ResponseCurve, SceneName, SensorModel, SynthConfig};
pub use error::SynthError;
pub use events::{Events, FrameRanges};
pub use sequence::{SynthFrame, SynthSequence};
pub use summary::SynthSummary;
pub use writer::{write_dataset, write_dataset_while};
