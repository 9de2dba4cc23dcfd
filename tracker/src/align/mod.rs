//! Alignment of one blurred frame with a sharp reference: both poses of the exposure, gain and offset.
//!
//! The objective is the sum of
//! * a photometric term: predicted against observed blurred patches ([`crate::transfer`]),
//! * a depth term: the current depth map against the keyframe's surface at mid exposure ([`depth_term`]),
//! * a motion prior that ties the exposure to the one before ([`MotionPrior`]).
//!
//! Each data term is divided by its own robust noise scale, measured at the current estimate, so exact depth
//! dominates where it is exact and a blurred reference loses weight where it does not fit.

mod damping;
mod depth_accumulate;
pub mod depth_term;
mod level;
mod measure;
mod objective;
mod placement;
mod prior;
mod scale;
mod settings;

pub use level::{Alignment, LevelOutcome, LevelPlan, StopReason};
pub use objective::{AlignScratch, FrameData, ReferenceData};
pub use placement::{blur_length, place_sites};
pub use prior::MotionPrior;
pub use settings::AlignSettings;

use nalgebra::SVector;

use crate::trajectory::ExposureTrajectory;
use crate::transfer::BrightnessModel;

/// Number of unknowns: centre motion (6), exposure motion (6), gain, offset.
pub const UNKNOWNS: usize = 14;

/// What an alignment estimates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// `keyframe_from_camera` at shutter opening and closing.
    pub keyframe_from_camera: ExposureTrajectory,
    /// Brightness of the frame relative to the reference.
    pub brightness: BrightnessModel,
}

impl Estimate {
    /// Applies a step in (centre, exposure motion, gain, offset) coordinates.
    #[must_use]
    pub fn stepped(&self, step: &SVector<f64, UNKNOWNS>) -> Self {
        let centre = step.fixed_rows::<6>(0).into_owned();
        let motion = step.fixed_rows::<6>(6).into_owned();
        Self {
            keyframe_from_camera: ExposureTrajectory {
                start: self.keyframe_from_camera.start.perturbed(&(centre - motion * 0.5)),
                end: self.keyframe_from_camera.end.perturbed(&(centre + motion * 0.5)),
            },
            brightness: BrightnessModel {
                gain: self.brightness.gain + step[12] as f32,
                offset: self.brightness.offset + step[13] as f32,
            },
        }
    }
}
