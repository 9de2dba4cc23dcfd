//! Recognising places: which stored views look like this one.
//!
//! Views are compared as small blurry images (Klein and Murray, "Improving the agility of keyframe-based SLAM", 2008):
//! so small that motion blur, noise and a step aside change little. What is compared is their structure, not their
//! brightness, under every shift by a few thumbnail pixels; the best shift tells how the cameras are turned against each
//! other. A candidate is a hint, to be checked by alignment.
//!
//! ```
//! use mba_adjust::places::{PlaceDescriptor, PlaceIndex};
//! use mba_synth::{SynthConfig, SynthSequence};
//!
//! let config = SynthConfig { width: 160, height: 120, frames: 2, mean_blur_px: 1.0, ..SynthConfig::default() };
//! let sequence = SynthSequence::new(config)?;
//! let mut index = PlaceIndex::default();
//! index.push(7, PlaceDescriptor::new(&sequence.render_sharp(0), &sequence.camera())?);
//! let query = PlaceDescriptor::new(&sequence.render_frame(1).rgb, &sequence.camera())?;
//! let candidates = index.candidates(&query, 3, 0.8, |_| true);
//! assert_eq!(candidates[0].id, 7);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod correlation;
mod descriptor;
mod index;
#[cfg(test)]
mod tests;

pub use descriptor::{PlaceDescriptor, PlaceError};
pub use index::{PlaceCandidate, PlaceIndex};
