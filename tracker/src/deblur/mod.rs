//! Deblurring an image with its own, known motion.
//!
//! The blur of a frame whose exposure was estimated is a known linear operator: the mean over virtual views. Its
//! inverse is approached by Richardson-Lucy iterations, which keep light non-negative and conserved, and which
//! are the maximum-likelihood estimate under photon noise. Stopping early is the regularisation.

mod flow;
mod line_blur;

pub use flow::{BLOCK_HEIGHT, BLOCK_WIDTH, BlurFlow};
pub use line_blur::blur_along;

use fearless_simd::{Level, dispatch, f32x8, prelude::*};

use crate::math::sqrt_f32;
use crate::session::{Walk, are_finite};
use crate::transfer::MAX_VIRTUAL_VIEWS;
use crate::workspace::{Arena, WorkspaceError, slice_bytes};

/// Light added to both sides of the ratio, so that black pixels neither divide by zero nor dominate.
const RATIO_FLOOR: f32 = 0.01;

/// Largest factor on a pixel in one iteration: keeps noise in dark pixels from exploding.
const RATIO_LIMIT: f32 = 3.0;

/// Light from which a pixel counts as clipped: its true light is unknown and corrects nothing.
const SATURATION: f32 = 0.98;

/// Memory for deblurring images of one size.
#[derive(Debug)]
pub struct DeblurScratch<'m> {
    /// Blur path of every block.
    pub flow: BlurFlow<'m>,
    captured: &'m mut [f32],
    reblurred: &'m mut [f32],
    correction: &'m mut [f32],
    /// What has been begun and not concluded.
    progress: Option<Progress>,
}

/// How far a deblurring is.
#[derive(Clone, Copy, Debug)]
struct Progress {
    /// Samples of every blur path.
    views: usize,
    /// Blurs of the whole image that were done, and that are to be done.
    done: usize,
    of: usize,
    /// As in [`DeblurReport`].
    residual_before: f32,
    residual_after: f32,
}

/// How well an image explains its captured version before and after deblurring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeblurReport {
    /// Root mean square difference between captured and reblurred captured image, linear light.
    pub residual_before: f32,
    /// Root mean square difference between captured and reblurred sharp image, linear light.
    pub residual_after: f32,
    /// Whether the sharp image was kept; otherwise it is the captured one.
    pub kept: bool,
    /// Samples of blur paths that were taken.
    pub taps: u64,
}

impl<'m> DeblurScratch<'m> {
    /// Bytes of workspace for images of this size.
    #[must_use]
    pub const fn bytes(width: usize, height: usize) -> usize {
        BlurFlow::bytes(width, height) + 3 * slice_bytes::<f32>(width * height)
    }

    /// Takes the memory from `arena`.
    ///
    /// # Errors
    /// [`WorkspaceError`] when the arena is exhausted.
    pub fn carve(arena: &mut Arena<'m>, width: usize, height: usize) -> Result<Self, WorkspaceError> {
        Ok(Self {
            flow: BlurFlow::carve(arena, width, height)?,
            captured: arena.take(width * height)?,
            reblurred: arena.take(width * height)?,
            correction: arena.take(width * height)?,
            progress: None,
        })
    }

    /// Remembers the image as captured, for [`Self::deblur`], and forgets what has been begun; nothing if the memory is for no
    /// images at all.
    pub fn capture(&mut self, image: &[f32]) {
        self.progress = None;
        if !self.captured.is_empty() {
            self.captured.copy_from_slice(image);
        }
    }

    /// Forgets the image as captured, and what has been begun.
    pub(crate) fn forget(&mut self) {
        self.captured.fill(0.0);
        self.progress = None;
    }

    /// Visits the image as captured; all else serves until a deblurring is concluded.
    pub(crate) fn walk(&mut self, walk: &mut Walk<'_>) {
        walk.values(self.captured);
    }

    /// Whether what was restored can be worked with.
    pub(crate) fn is_sound(&self) -> bool {
        are_finite(self.captured)
    }

    /// Writes back the image as captured, if it is remembered.
    pub fn restore(&self, image: &mut [f32]) {
        if !self.captured.is_empty() {
            image.copy_from_slice(self.captured);
        }
    }

    /// Writes to `sharp` the remembered image deblurred along the flow, whose longest displacement is `longest`
    /// pixels.
    ///
    /// The result never explains the captured image worse than the captured image itself does: as soon as it does, the
    /// motion is wrong and `sharp` is a copy of the captured image.
    pub fn deblur(
        &mut self,
        level: Level,
        longest: f32,
        iterations: usize,
        sharp: &mut [f32],
    ) -> DeblurReport {
        self.begin(longest, iterations, sharp);
        let taps = self.advance(level, usize::MAX, sharp);
        let [residual_before, residual_after] = self.conclude(sharp).unwrap_or_default();
        DeblurReport { residual_before, residual_after, kept: residual_after < residual_before, taps }
    }

    /// Begins what [`Self::deblur`] does in one go; `sharp` and the memory are then left alone but for [`Self::advance`], until
    /// [`Self::conclude`].
    pub(crate) fn begin(&mut self, longest: f32, iterations: usize, sharp: &mut [f32]) {
        sharp.copy_from_slice(self.captured);
        self.progress = Some(Progress {
            views: tap_count(longest),
            done: 0,
            // One to compare with, two for each iteration.
            of: iterations.saturating_mul(2).saturating_add(1),
            residual_before: 0.0,
            residual_after: 0.0,
        });
    }

    /// Blurs of the whole image that are left of what has been begun, and the samples of blur paths that each takes.
    pub(crate) fn left(&self) -> (usize, u64) {
        self.progress.map_or((0, 0), |progress| (progress.of - progress.done, self.taps_of(&progress)))
    }

    fn taps_of(&self, progress: &Progress) -> u64 {
        progress.views as u64 * self.captured.len() as u64
    }

    /// Goes on with what has been begun by `blurs` of the whole image, or as many as are left; returns the samples of blur
    /// paths that were taken.
    pub(crate) fn advance(&mut self, level: Level, blurs: usize, sharp: &mut [f32]) -> u64 {
        let Some(mut progress) = self.progress else { return 0 };
        let first = progress.done;
        while progress.done < progress.of && progress.done - first < blurs {
            if progress.done % 2 == 0 {
                progress.residual_after = self.compare(level, progress.views, sharp);
                if progress.done == 0 {
                    progress.residual_before = progress.residual_after;
                }
            } else {
                // Richardson and Lucy: the ratio of captured to reblurred light, blurred once more, corrects every pixel.
                blur_along(level, self.reblurred, &self.flow, progress.views, self.correction);
                for (light, factor) in sharp.iter_mut().zip(&*self.correction) {
                    *light *= factor;
                }
            }
            progress.done += 1;
            // Iterations with a wrong motion get worse and worse: there is nothing to gain by the rest.
            let is_compared = progress.done % 2 == 1 && progress.done > 1;
            if is_compared && progress.residual_after >= progress.residual_before {
                progress.of = progress.done;
            }
        }
        self.progress = Some(progress);
        (progress.done - first) as u64 * self.taps_of(&progress)
    }

    /// Ends what has been begun and done; `sharp` is then as [`Self::deblur`] leaves it. Returns the residuals before and after,
    /// and nothing if nothing was begun.
    pub(crate) fn conclude(&mut self, sharp: &mut [f32]) -> Option<[f32; 2]> {
        let Progress { residual_before, residual_after, .. } = self.progress.take()?;
        let kept = residual_after < residual_before;
        if !kept {
            sharp.copy_from_slice(self.captured);
        }
        Some([residual_before, residual_after])
    }

    /// Blurs `sharp` and leaves the ratio of captured to blurred light; returns the root mean square difference.
    fn compare(&mut self, level: Level, views: usize, sharp: &[f32]) -> f32 {
        blur_along(level, sharp, &self.flow, views, self.reblurred);
        let squares = dispatch!(level, simd => ratios(simd, self.captured, self.reblurred));
        sqrt_f32((squares / self.captured.len().max(1) as f64) as f32)
    }
}

/// Distance between neighbouring taps along the longest path, pixels.
const TAP_SPACING: f32 = 1.5;

/// Samples of every blur path of an image whose longest has `longest` pixels, for [`blur_along`]: 3 to [`MAX_VIRTUAL_VIEWS`].
#[must_use]
pub fn tap_count(longest: f32) -> usize {
    // Casts saturate.
    ((longest / TAP_SPACING) as usize).saturating_add(2).clamp(3, MAX_VIRTUAL_VIEWS)
}

/// Replaces reblurred light by the ratio captured/reblurred; returns the sum of squared differences.
#[inline(always)]
fn ratios<S: Simd>(simd: S, captured: &[f32], reblurred: &mut [f32]) -> f64 {
    const RUN: usize = 512;
    let mut total = 0.0;
    for (captured, reblurred) in captured.chunks(RUN).zip(reblurred.chunks_mut(RUN)) {
        let mut sum = f32x8::splat(simd, 0.0);
        let split = captured.len() / 8 * 8;
        for (b, r) in captured.chunks_exact(8).zip(reblurred.chunks_exact_mut(8)) {
            let (light, modelled) = (f32x8::from_slice(simd, b), f32x8::from_slice(simd, r));
            let difference = light - modelled;
            sum = difference.mul_add(difference, sum);
            // Dark pixels would be ratios of noise, and no step changes a pixel by much.
            let ratio = (light + RATIO_FLOOR) / (modelled + RATIO_FLOOR);
            let ratio = ratio.max(1.0 / RATIO_LIMIT).min(RATIO_LIMIT);
            let one = f32x8::splat(simd, 1.0);
            // What is saturated says nothing about how much more there was.
            light.simd_gt(SATURATION).select(one, ratio).store_slice(r);
        }
        for (&light, modelled) in captured[split..].iter().zip(&mut reblurred[split..]) {
            let difference = light - *modelled;
            total += f64::from(difference * difference);
            let ratio = (light + RATIO_FLOOR) / (*modelled + RATIO_FLOOR);
            *modelled = if light > SATURATION { 1.0 } else { ratio.clamp(1.0 / RATIO_LIMIT, RATIO_LIMIT) };
        }
        total += f64::from(sum.as_slice().iter().sum::<f32>());
    }
    total
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::*;

    #[test]
    fn an_image_that_is_deblurred_step_by_step_is_the_same_bit_for_bit() {
        let (width, height, iterations) = (64, 40, 3);
        let captured: Vec<f32> =
            (0..width * height).map(|k| 0.4 + 0.3 * (0.9 * (k % width) as f32).sin()).collect();
        let mut memory = vec![0; DeblurScratch::bytes(width, height) + 64];
        let mut scratch = DeblurScratch::carve(&mut Arena::new(&mut memory), width, height).expect("memory");
        scratch.flow.displacement.fill([4.0, 1.0]);
        scratch.capture(&captured);
        let (mut at_once, mut in_steps) = (vec![0.0; width * height], vec![0.0; width * height]);
        let report = scratch.deblur(Level::new(), 4.2, iterations, &mut at_once);
        assert!(report.kept && at_once != captured);
        assert_eq!(scratch.conclude(&mut in_steps), None, "nothing is left of it");

        scratch.begin(4.2, iterations, &mut in_steps);
        let mut taps = 0;
        for (blurs, left) in [(0, 7), (2, 5), (1, 4), (9, 0)] {
            taps += scratch.advance(Level::new(), blurs, &mut in_steps);
            assert_eq!(scratch.left().0, left);
        }
        assert_eq!(scratch.conclude(&mut in_steps), Some([report.residual_before, report.residual_after]));
        assert_eq!(in_steps, at_once);
        // Seven blurs with four samples of every pixel.
        let of_blur = 4 * (width * height) as u64;
        assert_eq!((taps, report.taps), (7 * of_blur, taps));

        // Stripes that are sharp across the claimed motion, every other one clipped: what is not darkens what is. All that
        // is left after an iteration is given up.
        scratch.flow.displacement.fill([4.0, 0.0]);
        let stripes: Vec<f32> = (0..width * height).map(|k| if k % 2 == 0 { 0.2 } else { 1.0 }).collect();
        scratch.capture(&stripes);
        let report = scratch.deblur(Level::new(), 4.0, iterations, &mut at_once);
        assert!(!report.kept && at_once == stripes, "{report:?}");
        assert_eq!(report.taps, 3 * of_blur);
    }
}
