//! Losses of one rendered exposure against what was captured, and their gradients by the rendered image.

use core::ops::Range;

use rayon::prelude::*;

use super::Ssim;
use crate::raster::RasterImage;
use crate::sensor::{DisplayCurve, Observation};

/// Weights of the terms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LossWeights {
    /// Of the mean absolute difference of display values.
    pub colour: f32,
    /// Of one minus the structural similarity.
    pub similarity: f32,
    /// Of the mean absolute difference of inverse depths, metres.
    pub depth: f32,
    /// Differences of inverse depth below this count quadratically, 1/metre.
    pub depth_noise: f32,
    /// Depth is compared where the map hides at least this share of what is behind it: elsewhere what shines through has a
    /// depth too.
    pub opaque: f32,
    /// Of the mean transparency where a depth was measured.
    pub alpha: f32,
}

/// Differences of display values below this count quadratically, 1 is full scale: about the noise of a camera.
pub const NOISE: f32 = 0.01;

/// Light of stored values this bright may have been clipped; more light is no error.
pub const CLIPPED: u8 = 254;

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
    rendered: [Vec<f32>; 3],
    /// Captured display values; the rendered ones where they do not count.
    captured: [Vec<f32>; 3],
    /// Slope of display value by light.
    slope: [Vec<f32>; 3],
    /// Gradient of the loss by the rendered display values.
    gradient: [Vec<f32>; 3],
}

/// One row of one channel, as [`DisplayPlanes`] has it.
struct Row<'a> {
    rendered: &'a mut [f32],
    captured: &'a mut [f32],
    slope: &'a mut [f32],
    gradient: &'a mut [f32],
}

impl Row<'_> {
    /// Compares the pixels in `columns`; the others count as equal. Returns the sums of smooth absolute and of squared
    /// differences.
    fn compare(
        &mut self,
        curve: &DisplayCurve,
        gain: f32,
        falloff: Option<&[f32]>,
        (light, bytes): (&[f32], &[u8]),
        columns: Range<usize>,
        weight: f32,
    ) -> [f32; 2] {
        let mut sums = [0.0_f32; 2];
        for (x, (&light, &byte)) in light.iter().zip(bytes).enumerate() {
            let gain = falloff.map_or(gain, |falloff| gain * falloff[x]);
            let [value, grad_light] = curve.at(gain * light);
            let target = f32::from(byte) * (1.0 / 255.0);
            let counts = columns.contains(&x) && !(byte >= CLIPPED && value > target);
            let target = if counts { target } else { value };
            let (loss, grad_value) = smooth_absolute(value - target, NOISE);
            (self.rendered[x], self.captured[x]) = (value, target);
            (self.slope[x], self.gradient[x]) = (grad_light * gain, weight * grad_value);
            sums[0] += loss;
            sums[1] += (value - target) * (value - target);
        }
        sums
    }
}

impl DisplayPlanes {
    /// Takes a rendered image to display values, with `gain` and the lens's fall-off on its light, and starts the gradient with the colour
    /// term. Returns that term and the mean squared difference. Image and observation have the same size.
    pub fn compare(
        &mut self,
        curve: &DisplayCurve,
        gain: f32,
        image: &RasterImage,
        seen: &Observation,
        weight: f32,
    ) -> LossTerms {
        let region = seen.region;
        // Mean over the pixels that count, three values each.
        let counted = region.right.saturating_sub(region.left) * region.bottom.saturating_sub(region.top) * 3;
        let share = 1.0 / counted.max(1) as f32;
        let columns = |y: usize| {
            let inside = (region.top..region.bottom).contains(&y);
            if inside { region.left..region.right } else { 0..0 }
        };
        let mut sums = [0.0_f64; 2];
        for channel in 0..3 {
            let rows = self.rows(channel, image.width, image.height);
            let (light, bytes) = (&image.colour[channel], &seen.colour[channel]);
            let given = (light.par_chunks(image.width), bytes.par_chunks(image.width));
            let rows = rows.zip(given).enumerate();
            // Rows are summed in their order, so that threads make no difference.
            let of_rows: Vec<[f32; 2]> = rows
                .map(|(y, (mut row, given))| {
                    let falloff = seen.falloff.as_ref();
                    let falloff = falloff.map(|plane| &plane[y * image.width..(y + 1) * image.width]);
                    row.compare(curve, gain, falloff, given, columns(y), weight * share)
                })
                .collect();
            for row in of_rows {
                sums.iter_mut().zip(row).for_each(|(sum, row)| *sum += f64::from(row));
            }
        }
        let [absolute, square] = sums.map(|sum| sum * f64::from(share));
        LossTerms { colour: f64::from(weight) * absolute, mean_square: square, ..LossTerms::default() }
    }

    /// The rows of a channel, with room for an image of that size.
    fn rows(
        &mut self,
        channel: usize,
        width: usize,
        height: usize,
    ) -> impl IndexedParallelIterator<Item = Row<'_>> {
        let planes = [&mut self.rendered, &mut self.captured, &mut self.slope, &mut self.gradient];
        let [rendered, captured, slope, gradient] = planes.map(|plane| {
            plane[channel].resize(width * height, 0.0);
            plane[channel].par_chunks_mut(width)
        });
        let zipped = (rendered, captured, slope, gradient).into_par_iter();
        zipped.map(|(rendered, captured, slope, gradient)| Row { rendered, captured, slope, gradient })
    }

    /// Adds the term of structural similarity, `weight` times one minus it, to the gradient and returns it.
    pub fn add_similarity(&mut self, ssim: &mut Ssim, size: [usize; 2], weight: f32) -> f64 {
        let [captured, rendered] = [&self.captured, &self.rendered].map(|p| p.each_ref().map(Vec::as_slice));
        let gradient = self.gradient.each_mut().map(Vec::as_mut_slice);
        f64::from(weight) * (1.0 - ssim.add_gradient(size, captured, rendered, -weight, gradient))
    }

    /// Takes the gradient from display values to linear light, and returns the gradient by the logarithm of the gain.
    pub fn gradient_by_light(&self, image: &RasterImage, out: &mut RasterImage) -> f64 {
        let mut grad_gain = 0.0;
        for channel in 0..3 {
            let planes = (
                out.colour[channel].par_chunks_mut(image.width),
                self.gradient[channel].par_chunks(image.width),
                self.slope[channel].par_chunks(image.width),
                image.colour[channel].par_chunks(image.width),
            );
            let of_row = |(out, gradient, slope, light): (&mut [f32], &[f32], &[f32], &[f32])| {
                let mut grad_gain = 0.0;
                for x in 0..out.len() {
                    // d/d(light) = d/d(display) * slope; light is proportional to the gain.
                    out[x] = gradient[x] * slope[x];
                    grad_gain += out[x] * light[x];
                }
                grad_gain
            };
            let of_rows: Vec<f32> = planes.into_par_iter().map(of_row).collect();
            grad_gain += of_rows.into_iter().map(f64::from).sum::<f64>();
        }
        grad_gain
    }
}

/// Depth and alpha terms; their gradients replace those by depth and alpha in `out`.
pub fn compare_depth(
    image: &RasterImage,
    seen: &Observation,
    weights: &LossWeights,
    out: &mut RasterImage,
) -> f64 {
    let share = 1.0 / (image.width * image.height) as f32;
    let rows = (
        out.depth.par_chunks_mut(image.width),
        out.alpha.par_chunks_mut(image.width),
        image.depth.par_chunks(image.width),
        image.alpha.par_chunks(image.width),
        seen.depth.par_chunks(image.width),
    );
    let of_row = |(grad_depth, grad_alpha, depth, alpha, measured): DepthRow<'_>| {
        let mut sum = 0.0;
        for x in 0..grad_depth.len() {
            (grad_depth[x], grad_alpha[x]) = (0.0, 0.0);
            if measured[x] <= 0.0 {
                continue;
            }
            sum += weights.alpha * share * (1.0 - alpha[x]);
            grad_alpha[x] = -weights.alpha * share;
            if alpha[x] < weights.opaque || depth[x] < 0.1 * alpha[x] {
                continue;
            }
            // Inverse depth A/D: the noise of sensors is uniform there.
            let inverse = alpha[x] / depth[x];
            let (loss, grad_inverse) = smooth_absolute(inverse - 1.0 / measured[x], weights.depth_noise);
            let scale = weights.depth * share;
            sum += scale * loss;
            grad_depth[x] = -scale * grad_inverse * inverse / depth[x];
            grad_alpha[x] += scale * grad_inverse / depth[x];
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
pub fn smooth_absolute(r: f32, noise: f32) -> (f32, f32) {
    let root = (r * r + noise * noise).sqrt();
    (root - noise, r / root)
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::PinholeCamera;
    use mba_tracker::image::PixelRectangle;
    use mba_tracker::photometric::InverseResponse;

    use super::*;
    use crate::exposure::RowTimes;

    const SIZE: [usize; 2] = [6, 5];
    const WEIGHTS: LossWeights =
        LossWeights { colour: 1.0, similarity: 0.0, depth: 3.0, depth_noise: 0.004, opaque: 0.9, alpha: 0.2 };

    fn fraction(i: usize) -> f32 {
        ((i * 7919 + 17) % 101) as f32 / 101.0
    }

    fn image() -> RasterImage {
        let mut image = RasterImage::zeros(SIZE[0], SIZE[1]);
        for pixel in 0..30 {
            (0..3).for_each(|c| image.colour[c][pixel] = 0.1 + 0.8 * fraction(3 * pixel + c));
            image.alpha[pixel] = 0.92 + 0.07 * fraction(pixel + 500);
            image.depth[pixel] = image.alpha[pixel] * (2.0 + fraction(pixel + 900));
        }
        image
    }

    fn observation() -> Observation {
        let [width, height] = SIZE;
        let plane = |c: usize| (0..30).map(|pixel| (20.0 + 200.0 * fraction(7 * pixel + c)) as u8).collect();
        Observation {
            camera: PinholeCamera { width, height, fx: 5.0, fy: 5.0, cx: 2.5, cy: 2.0 },
            colour: [plane(0), plane(1), plane(2)],
            depth: (0..30)
                .map(|pixel| if pixel % 7 == 0 { 0.0 } else { 2.0 + fraction(pixel + 77) })
                .collect(),
            region: PixelRectangle { left: 1, top: 0, right: 6, bottom: 4 },
            times: RowTimes::GLOBAL,
            falloff: None,
        }
    }

    /// Loss of an image and the gradient by it.
    fn loss(image: &RasterImage, gain: f32) -> (f64, RasterImage, f64) {
        let curve = DisplayCurve::new(&InverseResponse::linear());
        let (seen, mut planes) = (observation(), DisplayPlanes::default());
        let mut gradient = RasterImage::zeros(SIZE[0], SIZE[1]);
        let mut terms = planes.compare(&curve, gain, image, &seen, WEIGHTS.colour);
        let grad_log_gain = planes.gradient_by_light(image, &mut gradient);
        terms.depth = compare_depth(image, &seen, &WEIGHTS, &mut gradient);
        (terms.total(), gradient, grad_log_gain)
    }

    #[test]
    fn gradients_are_those_of_finite_differences() {
        let (step, image) = (2e-3_f32, image());
        let (_, gradient, grad_log_gain) = loss(&image, 1.1);
        let check = |what: &str, pixel: usize, analytic: f32, change: &dyn Fn(&mut RasterImage, f32)| {
            let moved = |by: f32| {
                let mut moved = image.clone();
                change(&mut moved, by);
                loss(&moved, 1.1).0
            };
            let numeric = (moved(step) - moved(-step)) / f64::from(2.0 * step);
            let error = (numeric - f64::from(analytic)).abs();
            assert!(error < 2e-4 + 0.03 * numeric.abs(), "{what} {pixel}: {analytic} instead of {numeric}");
        };
        for pixel in 0..30 {
            check("red", pixel, gradient.colour[0][pixel], &|image, by| image.colour[0][pixel] += by);
            check("blue", pixel, gradient.colour[2][pixel], &|image, by| image.colour[2][pixel] += by);
            check("depth", pixel, gradient.depth[pixel], &|image, by| image.depth[pixel] += by);
            check("alpha", pixel, gradient.alpha[pixel], &|image, by| image.alpha[pixel] += by);
        }
        let numeric = (loss(&image, 1.1 * 1.001).0 - loss(&image, 1.1 / 1.001).0) / (2.0 * 1.001_f64.ln());
        assert!(
            (numeric - grad_log_gain).abs() < 1e-3 + 0.02 * numeric.abs(),
            "{grad_log_gain}, not {numeric}"
        );
    }

    #[test]
    fn pixels_outside_of_the_region_and_clipped_light_do_not_count() {
        let curve = DisplayCurve::new(&InverseResponse::linear());
        let (mut image, mut seen) = (image(), observation());
        seen.colour.iter_mut().for_each(|plane| plane.fill(255));
        image.colour.iter_mut().for_each(|plane| plane.fill(3.0));
        let bright = DisplayPlanes::default().compare(&curve, 1.0, &image, &seen, 1.0);
        assert_eq!((bright.colour, bright.mean_square), (0.0, 0.0));
        image.colour.iter_mut().for_each(|plane| plane.fill(0.5));
        let grey = DisplayPlanes::default().compare(&curve, 1.0, &image, &seen, 1.0);
        assert!((grey.mean_square - 0.25).abs() < 1e-3, "20 of 30 pixels differ, and 20 are counted");
    }
}
