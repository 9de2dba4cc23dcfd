//! How a data set is opened.

/// How a data set is opened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenOptions {
    /// Largest time difference between a colour image and its depth image, seconds; not negative. Default 0.02.
    pub association_tolerance: f64,
}

impl Default for OpenOptions {
    fn default() -> Self {
        Self { association_tolerance: 0.02 }
    }
}
