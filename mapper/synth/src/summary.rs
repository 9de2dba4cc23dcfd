//! What was written of a sequence.

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SynthSummary {
    /// Number of frames.
    pub frames: usize,
    /// Mean over the frames of their mean blur, pixels.
    pub mean_blur_px: f64,
    /// Largest 95th percentile of the blur of a frame, pixels.
    pub largest_p95_px: f64,
    /// Most sub-frames that were averaged into one frame.
    pub most_sub_frames: usize,
}
