//! Blur-aware bundle adjustment: a sharp map and the trajectory of every exposure, from blurred frames.

pub mod adam;
mod adjustment;
pub mod density;
mod display;
mod keyframe;
mod loss;
mod pose_step;
mod seeding;

pub use adjustment::{BundleAdjustment, Keyframe, StepPlan};
pub use display::DisplayCurve;
pub use keyframe::{Observation, ObservationPyramid, Sensor};
pub use loss::{LossTerms, LossWeights};
pub use pose_step::{PoseMoments, PoseUnits};
