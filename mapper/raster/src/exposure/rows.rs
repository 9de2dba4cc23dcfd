//! Virtual views of a picture whose rows are exposed one after the other.
//!
//! The views lie at equal steps of time from the opening of the first row to the closing of the last. A row is the mean
//! of the path over its own exposure: each view counts for the step of time around it, as far as the row was exposed
//! then. So rows share views, a view is rendered for those rows only that see it, and no step shows between rows.

use core::ops::Range;

use super::timing::RowTimes;
use crate::raster::TILE_HEIGHT;

/// Most bands of rows of a depth image; within one, depth counts as measured at once.
const DEPTH_BANDS: usize = 16;

/// Most views of all rows together: each takes memory.
const MOST_VIEWS: usize = 48;

/// A number of views is not one more because of rounding.
const ROUNDING: f64 = 1e-9;

/// Times and weights of the views of one picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowViews {
    times: RowTimes,
    height: usize,
    count: usize,
    /// Time between views and time of a row's exposure, at least that of a view.
    step: f64,
    window: f64,
}

impl RowViews {
    /// `views` views, at least one, of the exposure of a row of a picture of `height` rows; as far apart for all rows
    /// together.
    pub(super) fn new(times: RowTimes, views: usize, height: usize) -> Self {
        let (exposure, readout) = (times.exposure, times.readout.abs());
        let views = views.max(1);
        // Casts saturate: an exposure of no time asks for the most views.
        let wanted = (views as f64 * (1.0 + readout / exposure) - ROUNDING).ceil() as usize;
        let count = if readout > 0.0 { wanted.clamp(2, MOST_VIEWS.max(views)) } else { views };
        let step = (exposure + readout) / count as f64;
        // An exposure shorter than a step takes one: its row is between two views.
        let step = if step > exposure && readout > 0.0 { readout / (count - 1) as f64 } else { step };
        Self { times, height, count, step, window: exposure.max(step) }
    }

    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Path time of view `k`.
    pub(super) fn time(&self, k: usize) -> f64 {
        0.5 + (k as f64 - 0.5 * (self.count - 1) as f64) * self.step
    }

    /// Share of view `k` in row `v`; those of a row add up to 1.
    pub(super) fn weight(&self, k: usize, v: usize) -> f64 {
        if self.window <= 0.0 {
            return 1.0 / self.count as f64;
        }
        let middle = self.times.view_time(0.5, v as f64, self.height);
        let from = (middle - 0.5 * self.window).max(self.time(k) - 0.5 * self.step);
        let to = (middle + 0.5 * self.window).min(self.time(k) + 0.5 * self.step);
        (to - from).max(0.0) / self.window
    }

    /// Weights of view `k` in all rows.
    pub(super) fn weights(&self, k: usize) -> impl Iterator<Item = f32> {
        (0..self.height).map(move |v| self.weight(k, v) as f32)
    }

    /// The bands of rows of tiles of which depth is rendered together, and their path times.
    pub(super) fn depth_bands(&self) -> impl Iterator<Item = (Range<usize>, f64)> {
        let down = self.height.div_ceil(TILE_HEIGHT);
        let bands = if self.times.depth_readout == 0.0 { 1 } else { DEPTH_BANDS.min(down).max(1) };
        let (times, height) = (self.times, self.height);
        (0..bands).map(move |band| {
            let rows = band * down / bands..(band + 1) * down / bands;
            let last = (rows.end * TILE_HEIGHT).min(height);
            let middle = 0.5 * ((rows.start * TILE_HEIGHT + last) as f64 - 1.0);
            (rows, times.depth_time(middle, height))
        })
    }
}

/// The rows of tiles in which any weight is not zero.
pub(super) fn band_of(weights: &[f32]) -> Range<usize> {
    let counts = |weight: &f32| *weight > 0.0;
    match (weights.iter().position(counts), weights.iter().rposition(counts)) {
        (Some(first), Some(last)) => first / TILE_HEIGHT..last / TILE_HEIGHT + 1,
        _ => 0..0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(exposure: f64, readout: f64) -> RowTimes {
        RowTimes { exposure, readout, depth_offset: 0.2, depth_readout: 0.3 }
    }

    #[test]
    fn rows_are_means_over_their_own_exposure() {
        for (exposure, readout, of_row, count) in
            [(0.3, 0.7, 6, 20), (0.25, -0.75, 3, 12), (0.001, 0.999, 1, 48), (1.0, 0.0, 5, 5)]
        {
            let views = RowViews::new(times(exposure, readout), of_row, 40);
            assert_eq!(views.count(), count);
            for v in 0..40 {
                let weights: Vec<f64> = (0..views.count()).map(|k| views.weight(k, v)).collect();
                let mean: f64 = weights.iter().enumerate().map(|(k, w)| w * views.time(k)).sum();
                let expected = 0.5 + ((v as f64 + 0.5) / 40.0 - 0.5) * readout;
                assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-9, "row {v}: {weights:?}");
                // The mean of the views is that of the row, up to where within their steps the ends lie.
                assert!((mean - expected).abs() < 0.26 * views.step, "row {v}: {mean} instead of {expected}");
            }
        }
    }

    #[test]
    fn one_exposure_for_all_rows_has_views_of_equal_weight() {
        let views = RowViews::new(times(1.0, 0.0), 5, 8);
        for k in 0..5 {
            assert!((views.time(k) - (k as f64 + 0.5) / 5.0).abs() < 1e-15);
            assert!(views.weights(k).all(|weight| (weight - 0.2).abs() < 1e-7));
        }
    }

    #[test]
    fn bands_of_depth_cover_all_rows_at_their_time() {
        let views = RowViews::new(times(0.3, 0.7), 5, 100);
        let bands: Vec<_> = views.depth_bands().collect();
        // Seven rows of tiles, the last of four rows of pixels.
        assert_eq!(bands.len(), 7);
        assert!(bands.iter().enumerate().all(|(k, (rows, _))| *rows == (k..k + 1)));
        assert!((bands[0].1 - (0.7 + (8.0 / 100.0 - 0.5) * 0.3)).abs() < 1e-12);
        assert!((bands[6].1 - (0.7 + (98.0 / 100.0 - 0.5) * 0.3)).abs() < 1e-12);
    }
}
