//! Bilinear interpolation with its exact gradient, one sample per SIMD lane.

use fearless_simd::prelude::*;

use super::LevelImage;

/// Largest image: linear indices are computed in f32, where whole numbers are exact up to here.
const MAX_PIXELS: usize = 1 << 24;

/// Interpolates one image, on the instruction set `S`; splatted constants are kept beside it.
///
/// Four neighbours are read as two pairs of adjacent floats, one 64-bit load each. The bounds check per pair was
/// measured to cost nothing: reading without it was not faster.
pub struct BilinearSampler<'a, S: Simd> {
    simd: S,
    /// All rows but the last, and all rows but the first: an index into one is the cell above or below.
    top: &'a [f32],
    bottom: &'a [f32],
    width: S::f32s,
    last_u: S::f32s,
    last_v: S::f32s,
    last_cell_u: S::f32s,
    last_cell_v: S::f32s,
}

/// Where a sample lies: the linear index of its top left pixel and the position between the four.
#[derive(Clone, Copy)]
pub struct Cell<S: Simd> {
    index: S::i32s,
    fraction_u: S::f32s,
    fraction_v: S::f32s,
}

impl<S: Simd> Cell<S> {
    /// The first cell of any image.
    #[inline(always)]
    pub fn first(simd: S) -> Self {
        let zero = S::f32s::splat(simd, 0.0);
        Self { index: S::i32s::splat(simd, 0), fraction_u: zero, fraction_v: zero }
    }
}

/// Interpolated intensities and, per pixel of displacement, their derivatives.
pub struct Sampled<S: Simd> {
    /// Intensities.
    pub value: S::f32s,
    /// Derivatives along a row.
    pub gradient_u: S::f32s,
    /// Derivatives along a column.
    pub gradient_v: S::f32s,
}

impl<'a, S: Simd> BilinearSampler<'a, S> {
    /// `None` if the image is narrower than one cell, larger than 2^24 pixels or shorter than it claims.
    #[inline(always)]
    pub fn new(simd: S, image: &LevelImage<'a>) -> Option<Self> {
        let (width, height) = (image.width, image.height);
        let count = width.checked_mul(height).filter(|&count| count <= MAX_PIXELS)?;
        let pixels = image.pixels.get(..count)?;
        if width < 2 || height < 2 {
            return None;
        }
        // Equal lengths, so that one bounds check serves both.
        let cells = count - width;
        let splat = |value: usize| S::f32s::splat(simd, value as f32);
        Some(Self {
            simd,
            top: &pixels[..cells],
            bottom: &pixels[width..][..cells],
            width: splat(width),
            last_u: splat(width - 1),
            last_v: splat(height - 1),
            last_cell_u: splat(width - 2),
            last_cell_v: splat(height - 2),
        })
    }

    /// Lanes within `[0, W-1] x [0, H-1]`; false for NaN.
    #[inline(always)]
    pub fn contains(&self, u: S::f32s, v: S::f32s) -> S::mask32s {
        (u.simd_ge(0.0) & u.simd_le(self.last_u)) & (v.simd_ge(0.0) & v.simd_le(self.last_v))
    }

    /// The cell that holds `(u, v)`; lanes outside the image get some cell of it.
    #[inline(always)]
    pub fn locate(&self, u: S::f32s, v: S::f32s) -> Cell<S> {
        // Truncation is floor for valid lanes. Clamping after it makes the cell valid whatever the lane holds.
        let cell_u = truncate::<S>(u).max(0.0).min(self.last_cell_u);
        let cell_v = truncate::<S>(v).max(0.0).min(self.last_cell_v);
        let index = cell_v.mul_add(self.width, cell_u).to_int::<S::i32s>();
        Cell { index, fraction_u: u - cell_u, fraction_v: v - cell_v }
    }

    /// Interpolates within a cell. Lanes outside the image return something unspecified, possibly NaN.
    #[inline(always)]
    pub fn sample(&self, cell: &Cell<S>) -> Sampled<S> {
        // Says to the compiler that the lengths are equal: what is in bounds of one is in bounds of the other.
        let bottom = &self.bottom[..self.top.len()];
        let (i00, i01) = self.pairs(self.top, &cell.index);
        let (i10, i11) = self.pairs(bottom, &cell.index);
        let (du_top, du_bottom) = (i01 - i00, i11 - i10);
        let t0 = du_top.mul_add(cell.fraction_u, i00);
        let t1 = du_bottom.mul_add(cell.fraction_u, i10);
        let gradient_v = t1 - t0;
        Sampled {
            value: gradient_v.mul_add(cell.fraction_v, t0),
            gradient_u: (du_bottom - du_top).mul_add(cell.fraction_v, du_top),
            gradient_v,
        }
    }

    /// The pixels at `index` and to the right of it.
    #[inline(always)]
    fn pairs(&self, rows: &[f32], index: &S::i32s) -> (S::f32s, S::f32s) {
        let index = index.as_slice();
        let half = S::f64s::LEN;
        let low: S::f32s = S::f64s::from_fn(self.simd, |k| pair(rows, index[k])).bitcast();
        let high: S::f32s = S::f64s::from_fn(self.simd, |k| pair(rows, index[half + k])).bitcast();
        (low.unzip_low(high), low.unzip_high(high))
    }
}

#[inline(always)]
fn truncate<S: Simd>(x: S::f32s) -> S::f32s {
    x.to_int::<S::i32s>().to_float()
}

/// Two adjacent pixels in one word; the caller clamps `index`, so the bounds check never fails.
#[inline(always)]
fn pair(rows: &[f32], index: i32) -> f64 {
    let start = index as u32 as usize;
    let cells = &rows[start..start + 2];
    bytemuck::cast([cells[0], cells[1]])
}
