//! What a captured picture still knows and the map does not: detail for which there were too few Gaussians, or which they
//! have in the wrong place.
//!
//! The map's picture, blurred as the exposure was, should be the captured one. What is left over is brought back along the
//! motion, by Landweber iterations: detail that survives the blur returns whole, detail that the blur wiped out stays as the
//! map has it. Noise is held back where the left-over is no more than noise (Wiener's gain in a window). So a frame that was
//! captured sharp is not spoilt by the map, and the map decides where nothing else can.

use mba_io::dataset::RgbdFrame;
use mba_io::trajectory_file::TimedExposure;
use mba_tracker::deblur::{BLOCK_HEIGHT, BLOCK_WIDTH, BlurFlow, DeblurScratch, blur_along, tap_count};
use mba_tracker::keyframe::RectifyScratch;
use mba_tracker::workspace::Arena;

use super::keyframe::{DeblurError, DeblurMemory, FramePath, KeyframeDeblurrer, Surface};

/// Landweber iterations: one brings back what is hardly blurred, a second the first order of what is; more fit noise.
const ITERATIONS: usize = 2;

/// Pixels whose left-over is compared with noise together, to either side: 7 x 7.
const REACH: usize = 3;

/// Levels of brightness whose noise is measured apart, and fewest pixels that tell it.
const NOISE_LEVELS: usize = 16;
const FEWEST_PIXELS: usize = 200;

/// Step between the rows and columns that are looked at for it: a quarter of the pixels has the same noise.
const NOISE_STEP: usize = 2;

/// The quarter of the pixels with the least second differences has little but noise: as a share of its standard deviation
/// (the first quartile of the magnitude of a normal variable).
const QUARTILE: f32 = 0.3186;

/// Variance of noise over that of the measured one: texture has a part in the quietest quarter, too.
const NOISE_SHARE: f32 = 0.7;

/// Least standard deviation of noise, linear light: a tenth of a step of 8 bits in the dark.
const LEAST_NOISE: f32 = 3e-5;

/// Blur, pixels, up to which all detail counts and from which on none does: what a long blur leaves is little, and a small error
/// of its path shows as edges that are not there. Less where the blurred picture is not rendered: it is wrong at the edges
/// of near things.
const TRUSTED_BLUR: [f32; 2] = [4.0, LONGEST_BLUR];
const TRUSTED_FLOW: [f32; 2] = [2.0, 8.0];

/// Blur from which on there is no detail to bring back, pixels.
pub const LONGEST_BLUR: f32 = 16.0;

/// The map says nothing about a pixel of which it covers less.
const KNOWN_ALPHA: f32 = 0.6;

/// The picture of an exposure as a map explains it.
#[derive(Clone, Debug)]
pub struct Reblurred {
    /// Linear light of red, green and blue, as bright as the frame was captured, row by row.
    pub light: [Vec<f32>; 3],
    /// Share (0 to 1) of each pixel that the map covers.
    pub alpha: Vec<f32>,
}

impl KeyframeDeblurrer {
    /// Adds to `sharp`, the picture that a map shows at mid exposure (red, green, blue of each pixel as stored), what the
    /// captured `frame` knows besides. `reblurred` is that picture with the blur and the rows of the exposure; without it the
    /// picture is blurred along the flow, which rows that follow each other forbid: then it stays as it is.
    ///
    /// # Errors
    /// [`DeblurError::Size`], [`DeblurError::Buffer`] or [`DeblurError::Memory`].
    ///
    /// # Panics
    /// When `sharp` or `reblurred` have another size than the frame.
    pub fn with_detail(
        &self,
        frame: &RgbdFrame,
        exposure: &TimedExposure,
        sharp: Vec<u8>,
        reblurred: Option<&Reblurred>,
        memory: &mut DeblurMemory,
    ) -> Result<Vec<u8>, DeblurError> {
        self.check(frame)?;
        let pixels = frame.width * frame.height;
        let fits = |of: &Reblurred| of.light.iter().chain([&of.alpha]).all(|plane| plane.len() == pixels);
        assert_eq!(sharp.len(), 3 * pixels, "bytes of the map's picture");
        assert!(reblurred.is_none_or(fits), "the blurred picture has another size than the frame");
        if self.rolls() && reblurred.is_none() {
            return Ok(sharp);
        }
        // The blur of this exposure, from its path and the depth of the frame.
        let mut arena = Arena::new(&mut memory.0);
        let mut scratch = DeblurScratch::carve(&mut arena, frame.width, frame.height)?;
        let mut rectify =
            RectifyScratch::carve(&mut arena, &self.camera, self.surface_level, self.rolls(), self.rolls())?;
        let path = FramePath::new(frame, exposure, &self.readout);
        let surface = self.surface(frame, &path, &mut rectify, &mut arena)?;
        let longest = self.fill_flow(&path, &surface, &mut scratch);
        let blur = Blur {
            simd: self.simd,
            flow: &scratch.flow,
            views: tap_count(longest),
            trusted: if reblurred.is_some() { TRUSTED_BLUR } else { TRUSTED_FLOW },
        };
        let light = |rgb: &[u8], channel: usize| {
            let mut plane = vec![0.0; pixels];
            self.linearise(rgb, channel, &mut plane);
            plane
        };
        // What the captured picture has beyond the blurred one of the map: in light, where blur is linear.
        let captured = [0, 1, 2].map(|channel| light(&frame.rgb, channel));
        let shown = [0, 1, 2].map(|channel| light(&sharp, channel));
        let mut left_over = match reblurred {
            Some(Reblurred { light, alpha }) => differences(&captured, light, alpha),
            None => {
                let light = shown.each_ref().map(|plane| blur.along(plane));
                differences(&captured, &light, &vec![1.0; pixels])
            }
        };
        // Only what stands out of the noise comes back, against the blur, to where it lies at mid exposure.
        hold_back_noise(&mut left_over, &captured, &frame.rgb, frame.width);
        let mut rgb = sharp;
        for (channel, (mut shown, left_over)) in shown.into_iter().zip(left_over).enumerate() {
            let found = self.at_mid_exposure(blur.brought_back(&left_over), &path, &surface, &mut rectify);
            shown.iter_mut().zip(found).for_each(|(light, more)| *light += more);
            self.develop(&shown, channel, &mut rgb);
        }
        Ok(rgb)
    }

    /// Detail of rows that were exposed one after the other, as it lies at mid exposure.
    fn at_mid_exposure(
        &self,
        mut detail: Vec<f32>,
        path: &FramePath,
        surface: &Surface<'_>,
        rectify: &mut RectifyScratch<'_>,
    ) -> Vec<f32> {
        if self.rolls() {
            rectify.capture(&detail, surface.map.values);
            let FramePath { reference_from_camera, timing } = path;
            rectify.rectify_image(
                self.simd,
                reference_from_camera,
                timing,
                &self.camera,
                &mut detail,
                &surface.map,
            );
        }
        detail
    }
}

/// The mean of light along the motion of an exposure.
struct Blur<'a> {
    simd: mba_tracker::simd::Level,
    flow: &'a BlurFlow<'a>,
    views: usize,
    /// Lengths between which trust in detail fades, pixels.
    trusted: [f32; 2],
}

impl Blur<'_> {
    fn along(&self, image: &[f32]) -> Vec<f32> {
        let mut blurred = vec![0.0; image.len()];
        blur_along(self.simd, image, self.flow, self.views, &mut blurred);
        blurred
    }

    /// What, blurred, comes near to `left_over`: Landweber iterations from nothing, of which the first is the blur itself. The
    /// path lies symmetrically about the middle of the exposure, so that the blur is its own transpose.
    fn brought_back(&self, left_over: &[f32]) -> Vec<f32> {
        let mut found = self.along(left_over);
        for _ in 1..ITERATIONS {
            let rest: Vec<f32> = left_over
                .iter()
                .zip(self.along(&found))
                .map(|(left_over, known)| left_over - known)
                .collect();
            found.iter_mut().zip(self.along(&rest)).for_each(|(light, more)| *light += more);
        }
        self.fade(&mut found);
        found
    }

    /// Multiplies detail by how much of it counts, by the length of the blur of its block.
    fn fade(&self, detail: &mut [f32]) {
        let [whole, none] = self.trusted;
        let trust = |[x, y]: &[f32; 2]| ((none - x.hypot(*y)) / (none - whole)).clamp(0.0, 1.0);
        let trust: Vec<f32> = self.flow.displacement.iter().map(trust).collect();
        for (v, row) in detail.chunks_mut(self.flow.width).enumerate() {
            let blocks = &trust[v / BLOCK_HEIGHT * self.flow.blocks_per_row()..];
            for (block, trust) in row.chunks_mut(BLOCK_WIDTH).zip(blocks) {
                block.iter_mut().for_each(|light| *light *= trust);
            }
        }
    }
}

/// Captured light less the explained, which a sensor clips at full scale; 0 where the map says nothing.
fn differences(captured: &[Vec<f32>; 3], explained: &[Vec<f32>; 3], alpha: &[f32]) -> [Vec<f32>; 3] {
    let difference = |channel: usize| {
        let both = captured[channel].iter().zip(&explained[channel]).zip(alpha);
        both.map(|((seen, light), alpha)| if *alpha < KNOWN_ALPHA { 0.0 } else { seen - light.min(1.0) })
            .collect()
    };
    [0, 1, 2].map(difference)
}

/// Multiplies what is left over by the share of its variance that noise does not explain.
fn hold_back_noise(left_over: &mut [Vec<f32>; 3], captured: &[Vec<f32>; 3], rgb: &[u8], width: usize) {
    let level_of = |pixel: usize, channel: usize| usize::from(rgb[3 * pixel + channel]) * NOISE_LEVELS / 256;
    let sigmas = noise(captured, width, level_of);
    let ratio = |pixel: usize| {
        let of_channel =
            |channel: usize| (left_over[channel][pixel] / sigmas[level_of(pixel, channel)]).powi(2);
        (of_channel(0) + of_channel(1) + of_channel(2)) / 3.0
    };
    let ratios: Vec<f32> = (0..left_over[0].len()).map(ratio).collect();
    let ratios = window_mean(&ratios, width);
    for plane in left_over {
        for (light, ratio) in plane.iter_mut().zip(&ratios) {
            *light *= (1.0 - NOISE_SHARE / ratio.max(NOISE_SHARE)).max(0.0);
        }
    }
}

/// Standard deviation of the noise at each level of brightness, linear light, from second differences along both axes, which
/// planes and straight edges do not have (Immerkaer 1996); the quietest quarter of them, as the rest has texture.
fn noise(
    captured: &[Vec<f32>; 3],
    width: usize,
    level_of: impl Fn(usize, usize) -> usize,
) -> [f32; NOISE_LEVELS] {
    let mut magnitudes: [Vec<f32>; NOISE_LEVELS] = Default::default();
    for (channel, plane) in captured.iter().enumerate() {
        for row in (1..(plane.len() / width).saturating_sub(1)).step_by(NOISE_STEP) {
            for column in (1..width - 1).step_by(NOISE_STEP) {
                let at = row * width + column;
                let along = |at: usize| plane[at - 1] - 2.0 * plane[at] + plane[at + 1];
                let second = along(at - width) - 2.0 * along(at) + along(at + width);
                // The weights' squares sum up to 36.
                magnitudes[level_of(at, channel)].push(second.abs() / 6.0);
            }
        }
    }
    magnitudes.map(|mut magnitudes| {
        let quarter = magnitudes.len() / 4;
        if magnitudes.len() < FEWEST_PIXELS {
            return LEAST_NOISE;
        }
        (*magnitudes.select_nth_unstable_by(quarter, f32::total_cmp).1 / QUARTILE).max(LEAST_NOISE)
    })
}

/// Mean over a window of [`REACH`] pixels to either side, as far as it lies in the image: along rows, then along columns.
fn window_mean(image: &[f32], width: usize) -> Vec<f32> {
    let height = image.len() / width;
    let mut along = vec![0.0; image.len()];
    for (row, means) in image.chunks(width).zip(along.chunks_mut(width)) {
        for (u, mean) in means.iter_mut().enumerate() {
            let window = &row[u.saturating_sub(REACH)..(u + REACH + 1).min(width)];
            *mean = window.iter().sum::<f32>() / window.len() as f32;
        }
    }
    let mut means = vec![0.0; image.len()];
    for (v, means) in means.chunks_mut(width).enumerate() {
        let rows = v.saturating_sub(REACH)..(v + REACH + 1).min(height);
        let share = 1.0 / rows.len() as f32;
        for row in rows {
            let row = &along[row * width..][..width];
            means.iter_mut().zip(row).for_each(|(mean, value)| *mean += share * value);
        }
    }
    means
}

#[cfg(test)]
mod tests {
    use super::super::keyframe::tests::{deblurrer, sequence, timed};
    use super::*;
    use mba_eval::evaluation::psnr;

    /// A map that has lost half of the finest detail: each pixel is half the mean of nine.
    fn soft(truth: &[u8], width: usize) -> Vec<u8> {
        let height = truth.len() / 3 / width;
        let at = |u: usize, v: usize, c: usize| {
            u32::from(truth[3 * (v.min(height - 1) * width + u.min(width - 1)) + c])
        };
        let pixel = |k: usize| {
            let (u, v, c) = (k / 3 % width, k / 3 / width, k % 3);
            let rows = v.saturating_sub(1)..=v + 1;
            let sum: u32 = rows
                .flat_map(|y| (u.saturating_sub(1)..=u + 1).map(move |x| (x, y)))
                .map(|(x, y)| at(x, y, c))
                .sum();
            let count = ((u + 1) - u.saturating_sub(1) + 1) * ((v + 1) - v.saturating_sub(1) + 1);
            ((sum / count as u32 + u32::from(truth[k])) / 2) as u8
        };
        (0..truth.len()).map(pixel).collect()
    }

    #[test]
    fn detail_that_the_map_lacks_comes_back() {
        let sequence = sequence();
        let deblurrer = deblurrer(&sequence);
        let mut gain = 0.0;
        for index in 0..sequence.len() {
            let truth = sequence.render_sharp(index);
            let map = soft(&truth, 160);
            let frame = sequence.render_frame(index).into_captured(0);
            let mut memory = deblurrer.memory();
            let detailed = deblurrer
                .with_detail(&frame, &timed(&sequence.exposure(index)), map.clone(), None, &mut memory)
                .unwrap();
            let [captured, before, after] =
                [&frame.rgb, &map, &detailed].map(|image| psnr(&truth, image).unwrap());
            assert!(
                after > before && after > captured + 0.4,
                "frame {index}: captured {captured} dB, map {before} dB, with detail {after} dB"
            );
            gain += after - before;
        }
        // A long blur gives next to nothing, a short one a third of a decibel.
        assert!(gain > 0.4, "{gain} dB in three frames");
    }

    #[test]
    fn a_map_that_explains_the_picture_stays_nearly_as_it_is() {
        let sequence = sequence();
        let deblurrer = deblurrer(&sequence);
        let (truth, frame) = (sequence.render_sharp(0), sequence.render_frame(0).into_captured(0));
        let exposure = timed(&sequence.exposure(0));
        let detailed =
            deblurrer.with_detail(&frame, &exposure, truth.clone(), None, &mut deblurrer.memory()).unwrap();
        let psnr = psnr(&truth, &detailed).unwrap();
        // What the flow does not say about the edges of near things is left.
        assert!(psnr > 33.5, "{psnr} dB");
    }

    #[test]
    fn what_the_map_does_not_cover_stays() {
        let sequence = sequence();
        let deblurrer = deblurrer(&sequence);
        let frame = sequence.render_frame(0).into_captured(0);
        let pixels = frame.width * frame.height;
        let nothing = Reblurred { light: [0, 1, 2].map(|_| vec![0.0; pixels]), alpha: vec![0.0; pixels] };
        let exposure = timed(&sequence.exposure(0));
        let shown = sequence.render_sharp(0);
        let detailed = deblurrer
            .with_detail(&frame, &exposure, shown.clone(), Some(&nothing), &mut deblurrer.memory())
            .unwrap();
        assert_eq!(detailed, shown);
    }

    #[test]
    #[should_panic(expected = "bytes of the map's picture")]
    fn a_picture_of_another_size_is_a_mistake() {
        let sequence = sequence();
        let deblurrer = deblurrer(&sequence);
        let frame = sequence.render_frame(0).into_captured(0);
        let exposure = timed(&sequence.exposure(0));
        let _ = deblurrer.with_detail(&frame, &exposure, vec![0; 3], None, &mut deblurrer.memory());
    }

    #[test]
    fn noise_is_measured_by_brightness() {
        // Normal noise of 1 % of the light, as a sum of twelve even numbers, on a slope.
        let width = 64;
        let even = |k: usize| (k as f32 * 0.618_034).fract() - 0.5;
        let normal =
            |pixel: usize| (0..12).map(|k| even(pixel.wrapping_mul(7919) % 10007 * (2 * k + 3))).sum::<f32>();
        let plane: Vec<f32> = (0..width * 64)
            .map(|pixel| (0.2 + 0.01 * (pixel / width) as f32) * (1.0 + 0.01 * normal(pixel)))
            .collect();
        let captured = [plane.clone(), plane.clone(), plane];
        let found = noise(&captured, width, |pixel, _| usize::from(pixel / width >= 32));
        // Mean light of the halves: 0.355 and 0.675.
        assert!((found[0] - 0.00355).abs() < 0.001 && (found[1] - 0.00675).abs() < 0.002, "{found:?}");
        assert_eq!(found[2], LEAST_NOISE, "nothing there");
    }
}
