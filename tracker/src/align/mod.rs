//! Alignment of one blurred frame with a sharp reference: both poses of the exposure, gain and offset.
//!
//! The objective is the sum of
//! * a photometric term: predicted against observed blurred patches ([`crate::transfer`]),
//! * a depth term: the current depth map against the keyframe's surface at mid exposure ([`depth_term`]),
//! * a motion prior that ties the exposure to the one before ([`MotionPrior`]).
//!
//! Each data term is divided by its own robust noise scale, measured at the current estimate, so exact depth
//! dominates where it is exact and a blurred reference loses weight where it does not fit.

mod bands;
mod damping;
mod depth_accumulate;
mod depth_problem;
mod depth_samples;
pub mod depth_term;
mod level;
mod measure;
mod objective;
mod placement;
mod prior;
mod problem;
mod scale;
mod settings;

pub use level::{Alignment, LevelOutcome, LevelPlan, StopReason};
pub use placement::{blur_length, place_sites};
pub use prior::{FollowsCentre, MotionPrior};
pub use problem::{AlignScratch, FrameData, ReferenceData};
pub use settings::AlignSettings;

use nalgebra::{SVector, Vector6};

use crate::trajectory::{BowedTrajectory, ExposureTrajectory};
use crate::transfer::BrightnessModel;

/// Number of unknowns of a frame whose pixels are all exposed at the same time: centre motion (6), exposure motion (6),
/// gain, offset.
pub const UNKNOWNS: usize = 14;

/// Number of unknowns where rows or depth have other times: the same, then the bow of the path (6).
pub const BOWED_UNKNOWNS: usize = UNKNOWNS + 6;

/// What an alignment estimates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// `keyframe_from_camera` at both ends of the time that the path spans: for a global shutter those of the exposure.
    pub keyframe_from_camera: ExposureTrajectory,
    /// What the path has beyond linear motion; zero for a global shutter.
    pub bow: Vector6<f64>,
    /// The cubic part of the path, which is no unknown: it is what was expected.
    pub jerk: Vector6<f64>,
    /// Brightness of the frame relative to the reference.
    pub brightness: BrightnessModel,
}

impl Estimate {
    /// An estimate without bow and with the brightness of the reference.
    #[must_use]
    pub fn linear(keyframe_from_camera: ExposureTrajectory) -> Self {
        let brightness = BrightnessModel::default();
        Self { keyframe_from_camera, bow: Vector6::zeros(), jerk: Vector6::zeros(), brightness }
    }

    /// The path as a function of time.
    #[must_use]
    pub fn path(&self) -> BowedTrajectory {
        BowedTrajectory { linear: self.keyframe_from_camera, bow: self.bow, jerk: self.jerk }
    }

    /// Applies a step in (centre, exposure motion, gain, offset, bow) coordinates.
    #[must_use]
    pub fn stepped(&self, step: &SVector<f64, BOWED_UNKNOWNS>) -> Self {
        let centre = step.fixed_rows::<6>(0).into_owned();
        let motion = step.fixed_rows::<6>(6).into_owned();
        Self {
            keyframe_from_camera: ExposureTrajectory {
                start: self.keyframe_from_camera.start.perturbed(&(centre - motion * 0.5)),
                end: self.keyframe_from_camera.end.perturbed(&(centre + motion * 0.5)),
            },
            bow: self.bow + step.fixed_rows::<6>(UNKNOWNS),
            jerk: self.jerk,
            brightness: BrightnessModel {
                gain: self.brightness.gain + step[12] as f32,
                offset: self.brightness.offset + step[13] as f32,
            },
        }
    }
}
