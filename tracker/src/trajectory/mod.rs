//! The camera's motion while the shutter is open.

mod exposure;

pub use exposure::{ExposureTrajectory, SampleRule, left_from_right};
