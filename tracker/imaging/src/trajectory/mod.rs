//! The camera's motion while the shutter is open.

mod bowed;
mod exposure;

pub use bowed::{BowedTrajectory, FrameTiming, PathPoint};
pub use exposure::{ExposureTrajectory, SampleRule, left_from_right};
