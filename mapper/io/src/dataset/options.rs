//! How a data set is opened.

use mba_tracker::SimdLevel;

/// How a data set is opened.
#[derive(Clone, Copy, Debug)]
pub struct OpenOptions {
    /// Largest time difference between a colour image and its depth image, seconds; not negative. Default 0.02.
    pub association_tolerance: f64,
    /// Instructions that all work on the data set is done with, see [`Dataset::simd`](super::Dataset::simd). Default: the best
    /// that the machine has.
    pub simd: SimdLevel,
}

impl Default for OpenOptions {
    fn default() -> Self {
        Self { association_tolerance: 0.02, simd: SimdLevel::new() }
    }
}
