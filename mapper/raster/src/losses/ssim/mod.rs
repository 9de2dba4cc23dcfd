//! Structural similarity (Wang et al. 2004) and its gradient.
//!
//! Bands of rows of one channel are the pieces of work. Each computes all windows that reach into it, also those of
//! its neighbours, so that bands share nothing; how the image is cut depends on its size only.

mod band;
mod definition;
mod window;

use mba_tracker::simd::Level;
use rayon::prelude::*;

use self::band::{Band, BandJob};
pub use self::definition::{WINDOW, mean_ssim};
use self::window::{RADIUS, Window};

/// Rows of a band. Ten more rows of windows are computed for it: fewer rows cost time, more leave threads idle.
const BAND_ROWS: usize = 80;

/// Mean structural similarity of two images for training, with its gradient.
#[derive(Debug)]
pub struct Ssim {
    level: Level,
    window: Window,
    /// Those of the first channel from the top, then those of the second and third.
    bands: Vec<Band>,
}

impl Ssim {
    /// Similarity with the instruction set `level`; levels differ by rounding only.
    #[must_use]
    pub fn new(level: Level) -> Self {
        Self { level, window: Window::new(), bands: Vec::new() }
    }

    /// Mean SSIM over three channels and all windows inside the image, at most 1. Adds `weight` times the gradient
    /// of that mean by `estimate` to `gradient`.
    ///
    /// `size` is width and height in pixels; a channel is a plane of values in `[0, 1]`, row by row. The window is
    /// a Gaussian of 11x11 pixels with a standard deviation of 1.5, the constants are 0.01 and 0.03, as in the
    /// paper. The memory is kept for the next image of that size. Results do not depend on the number of threads.
    ///
    /// An image of which a side is below 11 pixels has no window: the result is 1 and nothing is added.
    ///
    /// # Panics
    /// If a plane has another length than `size` says.
    pub fn add_gradient(
        &mut self,
        size: [usize; 2],
        reference: [&[f32]; 3],
        estimate: [&[f32]; 3],
        weight: f32,
        gradient: [&mut [f32]; 3],
    ) -> f64 {
        let [width, height] = size;
        let given = reference.iter().chain(&estimate).map(|plane| plane.len());
        for length in given.chain(gradient.iter().map(|plane| plane.len())) {
            assert!(
                width.checked_mul(height) == Some(length),
                "a plane of {length} values is no image of {width} x {height} pixels"
            );
        }
        if width < WINDOW || height < WINDOW {
            return 1.0;
        }
        // The loss is the mean over all windows of the three channels.
        let windows = (width - 2 * RADIUS) * (height - 2 * RADIUS);
        let count = 3.0 * windows as f64;
        let scale = (f64::from(weight) / count) as f32;
        let per_channel = height.div_ceil(BAND_ROWS);
        self.bands.resize_with(3 * per_channel, Band::default);

        // Bands are fixed, whatever the number of threads, and are summed in order.
        let channels = self.bands.par_chunks_mut(per_channel).zip(gradient).enumerate();
        channels.for_each(|(channel, (bands, gradient))| {
            let pieces = bands.par_iter_mut().zip(gradient.par_chunks_mut(BAND_ROWS * width)).enumerate();
            pieces.for_each(|(piece, (band, gradient))| {
                let job = BandJob {
                    size,
                    first_row: piece * BAND_ROWS,
                    reference: reference[channel],
                    estimate: estimate[channel],
                    scale,
                    window: &self.window,
                };
                band.add_gradient(self.level, &job, gradient);
            });
        });
        self.bands.iter().map(|band| band.sum).sum::<f64>() / count
    }
}

#[cfg(test)]
mod tests;
