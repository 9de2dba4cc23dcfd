//! Continuity over the whole sequence: what one blurred frame cannot tell, its neighbours can.
//!
//! A blurred image looks the same when start and end of its exposure are swapped, and now and then a frame is aligned
//! to the wrong place or not at all. Between frames a camera cannot jump, so a smooth path through the exposures tells
//! which of them are wrong and what belongs in their place. The path is a uniform cubic B-spline of about two control
//! points per frame; its increments solve a second-order cone program (clarabel) with a Huber norm per frame, a bending
//! term whose strength follows from the sequence itself, and physical limits of acceleration and jerk. Before that,
//! positions and velocities around each frame tell which ones are misplaced: a path so flexible could follow them as it
//! has to follow a jolt of the hand.
//!
//! Smoothness is a prior, not a judge: a hand can jerk. A frame that looks misplaced is compared with others at both of
//! its poses ([`compare_exposures`]), and stays where it was measured unless what it shows speaks for the other pose.
//!
//! [`repair`] corrects swaps, outliers and lost frames and leaves every other frame as it was measured, bit for bit.
//! `repair_run` of the drivers is the same for the data of a RUN folder. [`predict_motions`] gives bundle adjustment the motion during
//! an exposure that the neighbours of a frame suggest.

mod direction;
mod error;
mod evidence;
mod fit;
mod frame;
mod measured;
mod picture;
mod prediction;
mod problem;
mod repair;
mod scales;
mod screening;
mod settings;
mod spline;

pub use error::ContinuityError;
pub use evidence::{Evidence, Mismatch, Suspicion};
pub use frame::{ContinuityFrame, PoseNoise};
pub use picture::{FramePicture, compare_exposures};
pub use prediction::{MotionPrediction, predict_motions};
pub use repair::{Continuity, ContinuityEnergy, FrameVerdict, repair, repair_by_evidence};
pub use settings::{ContinuitySettings, MotionLimits};
