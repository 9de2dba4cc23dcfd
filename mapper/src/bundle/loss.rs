//! Losses of one rendered exposure against what was captured, and their gradients by the rendered image.

use rayon::prelude::*;

use super::display::DisplayCurve;
use super::keyframe::Observation;
use crate::raster::RasterImage;

/// Weights of the terms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LossWeights {
    /// Of the mean absolute difference of display values.
    pub colour: f32,
    /// Of one minus the structural similarity.
    pub similarity: f32,
    /// Of the mean absolute difference of inverse depths, metres.
    pub depth: f32,
    /// Of the mean transparency where a depth was measured.
    pub alpha: f32,
}

/// Differences of display values below this count quadratically, 1 is full scale: about the noise of a camera.
const NOISE: f32 = 0.01;

/// Differences of inverse depth below this count quadratically, 1/metre.
const DEPTH_NOISE: f32 = 0.004;

/// Depth is compared where the map is opaque to this degree: elsewhere what shines through has a depth too.
const OPAQUE: f32 = 0.9;

/// Light of stored values this bright may have been clipped; more light is no error.
const CLIPPED: u8 = 254;

/// The terms of the loss of one exposure, weighted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LossTerms {
    /// Colour.
    pub colour: f64,
    /// Structural similarity.
    pub similarity: f64,
    /// Depth.
    pub depth: f64,
    /// Mean squared difference of display values, not weighted: for the PSNR.
    pub mean_square: f64,
}

impl LossTerms {
    /// The whole loss.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.colour + self.similarity + self.depth
    }
}

/// Display values of a rendered image and the gradient by them.
#[derive(Debug, Default)]
pub struct DisplayPlanes {
    /// Rendered display values.
    pub rendered: [Vec<f32>; 3],
    /// Captured display values; the rendered ones where they do not count.
    pub captured: [Vec<f32>; 3],
    /// Slope of display value by light.
    slope: [Vec<f32>; 3],
    /// Gradient of the loss by the rendered display values.
    pub gradient: [Vec<f32>; 3],
}

impl DisplayPlanes {
    /// Takes a rendered image to display values, with `gain` on its light, and starts the gradient with the colour
    /// term. Returns that term and the mean squared difference.
    pub fn compare(
        &mut self,
        curve: &DisplayCurve,
        gain: f32,
        image: &RasterImage,
        seen: &Observation,
        weight: f32,
    ) -> LossTerms {
        let pixels = image.width * image.height;
        let width = image.width;
        let region = seen.region;
        let counted = (region.right - region.left) * (region.bottom - region.top) * 3;
        let share = 1.0 / counted.max(1) as f32;
        let mut sums = [0.0_f64; 2];
        for channel in 0..3 {
            let [rendered, captured, slope, gradient] = [
                &mut self.rendered[channel],
                &mut self.captured[channel],
                &mut self.slope[channel],
                &mut self.gradient[channel],
            ]
            .map(|plane| {
                plane.resize(pixels, 0.0);
                plane
            });
            let rows = (
                rendered.par_chunks_mut(width),
                captured.par_chunks_mut(width),
                slope.par_chunks_mut(width),
                gradient.par_chunks_mut(width),
                image.colour[channel].par_chunks(width),
                seen.colour[channel].par_chunks(width),
            );
            let of_row = |(y, (rendered, captured, slope, gradient, light, bytes)): (usize, RowOf<'_>)| {
                let mut sums = [0.0_f32; 2];
                let inside_rows = (region.top..region.bottom).contains(&y);
                for x in 0..width {
                    let [value, by_light] = curve.at(gain * light[x]);
                    let byte = bytes[x];
                    let target = f32::from(byte) * (1.0 / 255.0);
                    let counts = inside_rows
                        && (region.left..region.right).contains(&x)
                        && !(byte >= CLIPPED && value > target);
                    let target = if counts { target } else { value };
                    let (loss, by_value) = smooth_absolute(value - target, NOISE);
                    rendered[x] = value;
                    captured[x] = target;
                    slope[x] = by_light * gain;
                    gradient[x] = weight * share * by_value;
                    sums[0] += loss;
                    sums[1] += (value - target) * (value - target);
                }
                sums
            };
            let of_rows: Vec<[f32; 2]> = rows.into_par_iter().enumerate().map(of_row).collect();
            for row in of_rows {
                sums.iter_mut().zip(row).for_each(|(sum, row)| *sum += f64::from(row));
            }
        }
        let [absolute, square] = sums.map(|sum| sum * f64::from(share));
        LossTerms { colour: f64::from(weight) * absolute, mean_square: square, ..LossTerms::default() }
    }

    /// Takes the gradient from display values to linear light, and returns the gradient by the logarithm of the gain.
    pub fn gradient_by_light(&self, gain: f32, image: &RasterImage, out: &mut RasterImage) -> f64 {
        let mut by_gain = 0.0;
        for channel in 0..3 {
            let planes = (
                out.colour[channel].par_chunks_mut(image.width),
                self.gradient[channel].par_chunks(image.width),
                self.slope[channel].par_chunks(image.width),
                image.colour[channel].par_chunks(image.width),
            );
            let of_row = |(out, gradient, slope, light): (&mut [f32], &[f32], &[f32], &[f32])| {
                let mut by_gain = 0.0;
                for x in 0..out.len() {
                    out[x] = gradient[x] * slope[x];
                    by_gain += out[x] * light[x];
                }
                by_gain
            };
            let of_rows: Vec<f32> = planes.into_par_iter().map(of_row).collect();
            by_gain += of_rows.into_iter().map(f64::from).sum::<f64>();
        }
        let _ = gain;
        by_gain
    }
}

/// Rows of the planes of one channel.
type RowOf<'a> =
    (&'a mut [f32], &'a mut [f32], &'a mut [f32], &'a mut [f32], &'a [f32], &'a [u8]);

/// Depth and alpha terms; their gradients replace those by depth and alpha in `out`.
pub fn compare_depth(image: &RasterImage, seen: &Observation, weights: &LossWeights, out: &mut RasterImage) -> f64 {
    let share = 1.0 / (image.width * image.height) as f32;
    let rows = (
        out.depth.par_chunks_mut(image.width),
        out.alpha.par_chunks_mut(image.width),
        image.depth.par_chunks(image.width),
        image.alpha.par_chunks(image.width),
        seen.depth.par_chunks(image.width),
    );
    let of_row = |(by_depth, by_alpha, depth, alpha, measured): DepthRow<'_>| {
        let mut sum = 0.0;
        for x in 0..by_depth.len() {
            (by_depth[x], by_alpha[x]) = (0.0, 0.0);
            if measured[x] <= 0.0 {
                continue;
            }
            sum += weights.alpha * share * (1.0 - alpha[x]);
            by_alpha[x] = -weights.alpha * share;
            if alpha[x] < OPAQUE || depth[x] < 0.1 * alpha[x] {
                continue;
            }
            // Inverse depth A/D: the noise of sensors is uniform there.
            let inverse = alpha[x] / depth[x];
            let (loss, by_inverse) = smooth_absolute(inverse - 1.0 / measured[x], DEPTH_NOISE);
            let scale = weights.depth * share;
            sum += scale * loss;
            by_depth[x] = -scale * by_inverse * inverse / depth[x];
            by_alpha[x] += scale * by_inverse / depth[x];
        }
        sum
    };
    let of_rows: Vec<f32> = rows.into_par_iter().map(of_row).collect();
    of_rows.into_iter().map(f64::from).sum()
}

/// Rows of the planes of the depth term.
type DepthRow<'a> = (&'a mut [f32], &'a mut [f32], &'a [f32], &'a [f32], &'a [f32]);

/// `sqrt(r^2 + noise^2) - noise` and its slope: absolute for large r, quadratic near zero.
#[inline]
fn smooth_absolute(r: f32, noise: f32) -> (f32, f32) {
    let root = (r * r + noise * noise).sqrt();
    (root - noise, r / root)
}
