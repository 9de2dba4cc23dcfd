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
    /// All rows, and the pixels of each.
    pixels: &'a [f32],
    stride: usize,
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
            pixels,
            stride: width,
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

    /// The intensities at `(u, v)`, which lie inside of the image, as [`Self::sample`] interpolates them: for lanes that are
    /// about a pixel apart in a row, as those of an image that is bent a little.
    ///
    /// Where their cells follow each other but for a step of one pixel along each axis, nine loads of neighbours serve all
    /// lanes.
    #[inline(always)]
    pub fn sample_neighbours(&self, u: S::f32s, v: S::f32s) -> S::f32s {
        let one = S::f32s::splat(self.simd, 1.0);
        let ordinals = S::f32s::from_fn(self.simd, |lane| lane as f32);
        let cell_u = truncate::<S>(u).max(0.0).min(self.last_cell_u);
        let cell_v = truncate::<S>(v).max(0.0).min(self.last_cell_v);
        let columns = cell_u - ordinals;
        let ends = |x: &S::f32s| {
            let lanes = x.as_slice();
            lanes[0].min(lanes[S::f32s::LEN - 1])
        };
        let (left, top) = (ends(&columns), ends(&cell_v));
        let (right, below) = (columns - left, cell_v - top);
        let (is_right, is_below) = (right.simd_eq(one), below.simd_eq(one));
        let are_near = (is_right | right.simd_eq(0.0)) & (is_below | below.simd_eq(0.0));
        // Negative where lanes before the image's first column would be loaded.
        let first = top as usize * self.stride + left as usize;
        let fits = left >= 0.0 && left as usize + S::f32s::LEN + 2 <= self.stride;
        let rows = self.pixels.get(first..).and_then(|rows| rows.get(..2 * self.stride + S::f32s::LEN + 2));
        let (true, true, Some(rows)) = (are_near.all_true(), fits, rows) else {
            return self.sample(&self.locate(u, v)).value;
        };
        let pair = |row: usize| {
            let at = |shift: usize| {
                S::f32s::from_slice(self.simd, &rows[row * self.stride + shift..][..S::f32s::LEN])
            };
            let (first, second, third) = (at(0), at(1), at(2));
            (is_right.select(second, first), is_right.select(third, second))
        };
        let (first, second, third) = (pair(0), pair(1), pair(2));
        let choose = |below: S::f32s, above: S::f32s| is_below.select(below, above);
        let (i00, i01) = (choose(second.0, first.0), choose(second.1, first.1));
        let (i10, i11) = (choose(third.0, second.0), choose(third.1, second.1));
        let (fraction_u, fraction_v) = (u - cell_u, v - cell_v);
        let t0 = (i01 - i00).mul_add(fraction_u, i00);
        let t1 = (i11 - i10).mul_add(fraction_u, i10);
        (t1 - t0).mul_add(fraction_v, t0)
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

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use fearless_simd::{Level, dispatch};

    use super::*;
    use crate::simd::{level_name, levels_up_to};

    const SIZE: (usize, usize) = (61, 20);

    /// Samples a row of the image, shifted by `shift` of each column, in both ways; the bits of both.
    #[inline(always)]
    fn both<S: Simd>(simd: S, image: &LevelImage, shift: impl Fn(usize) -> [f32; 2]) -> Vec<[u32; 2]> {
        let sampler = BilinearSampler::new(simd, image).expect("a large enough image");
        let mut samples = Vec::new();
        for first in (0..SIZE.0 - 16).step_by(S::f32s::LEN) {
            let at = |axis: usize, start: f32, last: usize| {
                let place =
                    |lane| start + shift(first + lane)[axis] + if axis == 0 { lane as f32 } else { 0.0 };
                S::f32s::from_fn(simd, |lane| place(lane).clamp(0.0, last as f32))
            };
            let (u, v) = (at(0, first as f32, SIZE.0 - 1), at(1, 9.0, SIZE.1 - 1));
            let (alone, together) =
                (sampler.sample(&sampler.locate(u, v)).value, sampler.sample_neighbours(u, v));
            let pairs = alone.as_slice().iter().zip(together.as_slice());
            samples.extend(pairs.map(|(a, b)| [a.to_bits(), b.to_bits()]));
        }
        samples
    }

    #[test]
    fn neighbours_are_sampled_as_each_alone_wherever_they_lie() {
        let pixels: Vec<f32> = (0..SIZE.0 * SIZE.1).map(|k| (k * k % 97) as f32 / 97.0).collect();
        let image = LevelImage { pixels: &pixels, width: SIZE.0, height: SIZE.1 };
        // Straight, bent both ways, pulled apart, and beyond every border.
        let shifts: [fn(usize) -> [f32; 2]; 7] = [
            |_| [2.25, -1.5],
            |u| [0.04 * u as f32, 0.03 * u as f32],
            |u| [-0.05 * u as f32, -0.02 * u as f32],
            |u| [0.7 * u as f32, 0.4 * (u % 5) as f32],
            |u| [(u % 3) as f32 * -4.0, 0.0],
            |_| [-30.5, -9.0],
            |u| [30.5, 9.5 + 0.1 * u as f32],
        ];
        for level in levels_up_to(Level::new()) {
            for (k, shift) in shifts.iter().enumerate() {
                for [alone, together] in dispatch!(level, simd => both(simd, &image, shift)) {
                    assert_eq!(alone, together, "{}, shift {k}", level_name(level));
                }
            }
        }
    }
}
