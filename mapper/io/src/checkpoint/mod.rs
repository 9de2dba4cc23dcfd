//! Checkpoints of long runs: written atomically, checked when read.
//!
//! All numbers are little-endian.
//!
//! | bytes | content |
//! |---|---|
//! | 8 | `MBACKPT` and a line feed |
//! | 4 | version of this layout, now 2 |
//! | 40 | [`Identity`] of the run: fingerprints of program, data set, trajectory, settings and SIMD level |
//! | 8 | length of the payload |
//! | 4 | CRC-32 (IEEE) of identity, length and payload |
//! | | payload: the value in the postcard format |
//!
//! A checkpoint that was cut, damaged, written by another version or for another run is refused with the reason; a
//! value comes back exactly as it was saved. Large arrays of `f32` should use [`exact_floats`], which keeps every bit
//! and is as fast as copying.

mod container;
mod error;
pub mod exact_floats;
pub mod exact_poses;
mod identity;

pub use container::{load, save};
pub use error::CheckpointError;
pub use identity::{Difference, Fingerprint, Identity};
