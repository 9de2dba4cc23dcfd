//! Similarity and gradient of a band of rows.
//!
//! Rows of the image pass by one after the other. The last eleven give the moments of one row of windows; from those
//! follow similarity and three factors per window. The gradient at a pixel is a weighted sum of the factors over the
//! windows that hold it; the sum along the row is taken at once, the one across rows when eleven rows of windows
//! have passed by. Everything in between stays in the cache.

use core::ops::Range;

use fearless_simd::{Level, dispatch, f32x8, prelude::*};

use super::definition::{STABILISERS, WINDOW};
use super::window::{Chunk, LANES, RADIUS, Window, shifted};

/// Values are taken relative to the middle of their range: variances are differences of squares, which lose the
/// fewer digits the smaller they are.
const MIDDLE: f32 = 0.5;

/// Zeros in front of the factors of a row: the first pixel lies in ten windows less than those in the middle.
const MARGIN: usize = WINDOW - 1;

/// What is known of eight pixels of reference and estimate, relative to [`MIDDLE`].
type PixelPair = [Chunk; 2];

/// Means of reference, estimate, sum of their squares, and product.
const MOMENTS: usize = 4;

/// What the similarity of a window changes by: with a pixel of weight one, with the pixel's estimate, with its
/// reference.
const FACTORS: usize = 3;

/// One band of one channel.
pub(super) struct BandJob<'a> {
    pub(super) size: [usize; 2],
    pub(super) first_row: usize,
    pub(super) reference: &'a [f32],
    pub(super) estimate: &'a [f32],
    /// What the gradient of the sum of similarities is multiplied with.
    pub(super) scale: f32,
    pub(super) window: &'a Window,
}

impl BandJob<'_> {
    fn pixel_chunks(&self) -> usize {
        self.size[0].div_ceil(LANES)
    }

    /// Windows per row.
    fn windows_across(&self) -> usize {
        self.size[0] - 2 * RADIUS
    }

    /// The rows in which windows that hold a pixel of `rows` have their middle.
    fn window_rows(&self, rows: &Range<usize>) -> Range<usize> {
        rows.start.saturating_sub(RADIUS).max(RADIUS)..(rows.end + RADIUS).min(self.size[1] - RADIUS)
    }
}

/// Memory of a band, and its result.
#[derive(Debug, Default)]
pub(super) struct Band {
    /// Sum of the similarities of the windows with their middle in the band.
    pub(super) sum: f64,
    /// The last eleven rows of the image.
    pixels: [Vec<PixelPair>; WINDOW],
    /// Of one row of windows, summed over their rows but not yet over their columns.
    moments: [Vec<f32>; MOMENTS],
    /// Of one row of windows.
    factors: [Vec<f32>; FACTORS],
    /// Factors of the last eleven rows of windows, summed along rows for every pixel.
    spread: [Vec<[Chunk; FACTORS]>; WINDOW],
    /// A row of windows outside of the image.
    nothing: Vec<[Chunk; FACTORS]>,
}

impl Band {
    /// Adds the gradient of a band to `gradient`, which has its rows, and leaves the sum of similarities.
    pub(super) fn add_gradient(&mut self, level: Level, job: &BandJob, gradient: &mut [f32]) {
        self.reset(job.pixel_chunks());
        dispatch!(level, simd => self.pass(simd, job, gradient));
    }

    fn reset(&mut self, chunks: usize) {
        self.sum = 0.0;
        self.pixels.iter_mut().for_each(|row| row.resize(chunks, Default::default()));
        self.moments.iter_mut().for_each(|row| row.resize(LANES * chunks + MARGIN, 0.0));
        let rows = self.spread.iter_mut().chain([&mut self.nothing]);
        rows.for_each(|row| row.resize(chunks, Default::default()));
        for row in &mut self.factors {
            // An earlier image may have been wider.
            row.clear();
            row.resize(LANES * chunks + 2 * MARGIN, 0.0);
        }
    }

    #[inline(always)]
    fn pass<S: Simd>(&mut self, simd: S, job: &BandJob, gradient: &mut [f32]) {
        let width = job.size[0];
        let rows = job.first_row..job.first_row + gradient.len() / width;
        let windows = job.window_rows(&rows);
        let mut finished = rows.start;
        for row in windows.start - RADIUS..windows.end + RADIUS {
            self.read_row(simd, job, row);
            let middle = row.saturating_sub(RADIUS);
            if middle < windows.start {
                continue;
            }
            self.sum_columns(simd, job.window, row);
            let similarity = self.compare(simd, job);
            if rows.contains(&middle) {
                self.sum += similarity;
            }
            self.spread_row(simd, job.window, middle);
            // At the lower border, a row has its last window further up.
            let complete =
                if middle + 1 == windows.end { rows.end } else { row.saturating_sub(2 * RADIUS) + 1 };
            for done in finished..complete.min(rows.end) {
                let from = (done - rows.start) * width;
                self.add_row(simd, job, &windows, done, &mut gradient[from..from + width]);
            }
            finished = finished.max(complete);
        }
    }

    /// Takes in a row of the image.
    #[inline(always)]
    fn read_row<S: Simd>(&mut self, simd: S, job: &BandJob, row: usize) {
        let width = job.size[0];
        let from = row * width;
        let [reference, estimate] = [job.reference, job.estimate].map(|plane| &plane[from..from + width]);
        for (chunk, pair) in self.pixels[row % WINDOW].iter_mut().enumerate() {
            for (values, source) in pair.iter_mut().zip([reference, estimate]) {
                (load(simd, source, LANES * chunk) - MIDDLE).store_slice(values);
            }
        }
    }

    /// Moments of the last eleven rows of the image, of which `last` is the lowest, for every column.
    #[inline(always)]
    fn sum_columns<S: Simd>(&mut self, simd: S, window: &Window, last: usize) {
        let count = self.nothing.len();
        let mut rows: [&[PixelPair]; WINDOW] = [&[]; WINDOW];
        for (k, row) in rows.iter_mut().enumerate() {
            *row = &self.pixels[(last + 1 + k) % WINDOW][..count];
        }
        let [first, second, squares, product] =
            self.moments.each_mut().map(|row| &mut row.as_chunks_mut::<LANES>().0[..count]);
        for chunk in 0..count {
            let mut sums = [f32x8::splat(simd, 0.0); MOMENTS];
            // The window is a product: here down the columns, along the row afterwards.
            for (k, row) in rows.iter().enumerate() {
                let weight = f32x8::splat(simd, window.weights[k.abs_diff(RADIUS)]);
                let [x, y] = row[chunk];
                let (x, y) = (f32x8::from_slice(simd, &x), f32x8::from_slice(simd, &y));
                sums[0] = x.mul_add(weight, sums[0]);
                sums[1] = y.mul_add(weight, sums[1]);
                // x^2 and y^2 are only needed together.
                sums[2] = x.mul_add(x, y * y).mul_add(weight, sums[2]);
                sums[3] = (x * y).mul_add(weight, sums[3]);
            }
            sums[0].store_slice(&mut first[chunk]);
            sums[1].store_slice(&mut second[chunk]);
            sums[2].store_slice(&mut squares[chunk]);
            sums[3].store_slice(&mut product[chunk]);
        }
    }

    /// Factors of a row of windows; returns the sum of their similarities.
    #[inline(always)]
    fn compare<S: Simd>(&mut self, simd: S, job: &BandJob) -> f64 {
        let across = job.windows_across();
        let chunks = across.div_ceil(LANES);
        let [first, second, squares, product] = self.moments.each_ref();
        let [first, second] = [shifted(first, chunks), shifted(second, chunks)];
        let [squares, product] = [shifted(squares, chunks), shifted(product, chunks)];
        let [constant, grad_estimate, grad_reference] =
            self.factors.each_mut().map(|row| &mut row[MARGIN..].as_chunks_mut::<LANES>().0[..chunks]);
        let lanes = f32x8::from_slice(simd, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        let zero = f32x8::splat(simd, 0.0);
        let mut sum = zero;
        for chunk in 0..chunks {
            let moment = |rows: &[&[Chunk]; WINDOW]| {
                job.window.sum(
                    #[inline(always)]
                    |k| f32x8::from_slice(simd, &rows[k][chunk]),
                )
            };
            // Similarity of the window, and the factors of 1, y and x in its gradient.
            let likeness =
                Likeness::new(simd, [moment(&first), moment(&second), moment(&squares), moment(&product)]);
            let inside = lanes.simd_lt((across - LANES * chunk) as f32);
            sum += inside.select(likeness.similarity, zero);
            inside.select(likeness.constant, zero).store_slice(&mut constant[chunk]);
            inside.select(likeness.grad_estimate, zero).store_slice(&mut grad_estimate[chunk]);
            inside.select(likeness.grad_reference, zero).store_slice(&mut grad_reference[chunk]);
        }
        f64::from(sum.reduce_sum())
    }

    /// Sums factors over the windows along the row that hold a pixel.
    #[inline(always)]
    fn spread_row<S: Simd>(&mut self, simd: S, window: &Window, middle: usize) {
        let out = &mut self.spread[middle % WINDOW];
        let rows = self.factors.each_ref().map(|row| shifted(row, out.len()));
        for (chunk, out) in out.iter_mut().enumerate() {
            for (rows, out) in rows.iter().zip(out) {
                let sum = window.sum(
                    #[inline(always)]
                    |k| f32x8::from_slice(simd, &rows[k][chunk]),
                );
                sum.store_slice(out);
            }
        }
    }

    /// Adds the gradient of row `row` of the image. `windows` are the rows of windows that have been seen.
    #[inline(always)]
    fn add_row<S: Simd>(
        &self,
        simd: S,
        job: &BandJob,
        windows: &Range<usize>,
        row: usize,
        gradient: &mut [f32],
    ) {
        let count = self.nothing.len();
        let mut rows: [&[[Chunk; FACTORS]]; WINDOW] = [&[]; WINDOW];
        for (k, factors) in rows.iter_mut().enumerate() {
            // Windows beyond the image are no windows.
            let middle = (row + k).checked_sub(RADIUS).filter(|middle| windows.contains(middle));
            *factors = &middle.map_or(&self.nothing, |middle| &self.spread[middle % WINDOW])[..count];
        }
        let from = row * job.size[0];
        let [reference, estimate] =
            [job.reference, job.estimate].map(|plane| &plane[from..from + job.size[0]]);
        for (chunk, gradient) in gradient.chunks_mut(LANES).enumerate() {
            let factor = |factor: usize| {
                job.window.sum(
                    #[inline(always)]
                    |k| f32x8::from_slice(simd, &rows[k][chunk][factor]),
                )
            };
            let first = LANES * chunk;
            let x = load(simd, reference, first) - MIDDLE;
            let y = load(simd, estimate, first) - MIDDLE;
            // d/dy = sum over the windows of w (a + b y + c x), in which x and y do not depend on the window.
            let change = factor(2).mul_add(x, factor(1).mul_add(y, factor(0)));
            add(simd, change * job.scale, gradient);
        }
    }
}

/// Similarity of eight windows and its derivatives.
struct Likeness<S: Simd> {
    similarity: f32x8<S>,
    constant: f32x8<S>,
    grad_estimate: f32x8<S>,
    grad_reference: f32x8<S>,
}

impl<S: Simd> Likeness<S> {
    /// From the means of x, y, x² + y² and x y, values relative to [`MIDDLE`].
    ///
    /// With S = A1 A2/(B1 B2), where A1 and B1 are the terms of the means and A2 and B2 those of the variances, the
    /// derivatives by the means of x y and y² are 2 A1/(B1 B2) and -S/B2; a pixel changes the former by its weight
    /// times x, the latter by its weight times 2 y.
    #[inline(always)]
    fn new(simd: S, [x, y, squares, product]: [f32x8<S>; MOMENTS]) -> Self {
        let [c1, c2] = STABILISERS.map(|k| (k * k) as f32);
        let (mean_x, mean_y) = (x + MIDDLE, y + MIDDLE);
        let means = mean_x * mean_y;
        let a1 = means + means + c1;
        let b1 = mean_x.mul_add(mean_x, mean_y.mul_add(mean_y, f32x8::splat(simd, c1)));
        let covariance = product - x * y;
        let a2 = covariance + covariance + c2;
        let b2 = squares - x.mul_add(x, y * y) + c2;
        let inverse = f32x8::splat(simd, 1.0) / (b1 * b2);
        let similarity = a1 * a2 * inverse;
        let twice = inverse + inverse;
        let grad_mean = mean_x * a2 - x * a1 - similarity * (mean_y * b2 - y * b1);
        Self {
            similarity,
            constant: grad_mean * twice,
            grad_estimate: -(similarity * b1 * twice),
            grad_reference: a1 * twice,
        }
    }
}

/// Eight values from `first`, zeros beyond the end.
#[inline(always)]
fn load<S: Simd>(simd: S, row: &[f32], first: usize) -> f32x8<S> {
    match row.get(first..first + LANES) {
        Some(whole) => f32x8::from_slice(simd, whole),
        None => {
            let rest = &row[first..];
            let mut padded = [0.0; LANES];
            padded[..rest.len()].copy_from_slice(rest);
            f32x8::from_slice(simd, &padded)
        }
    }
}

/// Adds to the first eight values, or to all if there are fewer.
#[inline(always)]
fn add<S: Simd>(simd: S, change: f32x8<S>, values: &mut [f32]) {
    match values.first_chunk_mut::<LANES>() {
        Some(whole) => (f32x8::from_slice(simd, whole) + change).store_slice(whole),
        None => {
            let mut changes = [0.0; LANES];
            change.store_slice(&mut changes);
            values.iter_mut().zip(changes).for_each(|(value, change)| *value += change);
        }
    }
}
