//! Sharp colour images of keyframes, for people to look at.
//!
//! The tracker deblurs the luminance of its keyframes for its own use. Here the same operator, the mean of light along
//! the motion that was estimated for the frame, is inverted for each colour after the run, when all estimates are
//! final and nobody waits. What a map shows of a keyframe gets back the detail that only the captured picture knows.

mod detail;
mod keyframe;

pub use detail::{LONGEST_BLUR, Reblurred};
pub use keyframe::{DeblurError, DeblurMemory, Deblurred, KeyframeDeblurrer};
