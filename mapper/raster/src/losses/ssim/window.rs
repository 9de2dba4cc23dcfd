//! The window and sums weighted with it.

use fearless_simd::{f32x8, prelude::*};

use super::definition::{WINDOW, window_weights};

/// Pixels of a row of the window on either side of its middle.
pub(super) const RADIUS: usize = WINDOW / 2;

/// Values per vector.
pub(super) const LANES: usize = 8;

/// One vector in memory.
pub(super) type Chunk = [f32; LANES];

/// Weights by the distance from the middle, of a row or a column.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    pub(super) weights: [f32; RADIUS + 1],
}

impl Window {
    pub(super) fn new() -> Self {
        let weights = window_weights();
        Self { weights: core::array::from_fn(|distance| weights[RADIUS + distance] as f32) }
    }

    /// The weighted sum of eleven values.
    #[inline(always)]
    pub(super) fn sum<S: Simd>(&self, values: impl Fn(usize) -> f32x8<S>) -> f32x8<S> {
        let mut sum = values(RADIUS) * self.weights[0];
        for distance in 1..=RADIUS {
            let both = values(RADIUS - distance) + values(RADIUS + distance);
            sum = both.mul_add(self.weights[distance], sum);
        }
        sum
    }
}

/// The vectors of a row that start at every pixel of a window: element `[k][c]` starts at `8 c + k`.
#[inline(always)]
pub(super) fn shifted(row: &[f32], chunks: usize) -> [&[Chunk]; WINDOW] {
    let mut out: [&[Chunk]; WINDOW] = [&[]; WINDOW];
    for (k, shifted) in out.iter_mut().enumerate() {
        *shifted = row[k..k + LANES * chunks].as_chunks().0;
    }
    out
}
