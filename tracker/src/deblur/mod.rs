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
        })
    }

    /// Remembers the image as captured, for [`Self::deblur`]; nothing if the memory is for no images at all.
    pub fn capture(&mut self, image: &[f32]) {
        if !self.captured.is_empty() {
            self.captured.copy_from_slice(image);
        }
    }

    /// Forgets the image as captured.
    pub(crate) fn forget(&mut self) {
        self.captured.fill(0.0);
    }

    /// Visits the image as captured; all else serves within a call.
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
    /// The result never explains the captured image worse than the captured image itself does: if it did, the
    /// motion was wrong and `sharp` is a copy of the captured image.
    pub fn deblur(
        &mut self,
        level: Level,
        longest: f32,
        iterations: usize,
        sharp: &mut [f32],
    ) -> DeblurReport {
        let views = tap_count(longest);
        sharp.copy_from_slice(self.captured);
        let residual_before = self.compare(level, views, sharp);
        let mut residual_after = residual_before;
        for _ in 0..iterations {
            // Richardson and Lucy: the ratio of captured to reblurred light, blurred once more, corrects every pixel.
            blur_along(level, self.reblurred, &self.flow, views, self.correction);
            for (light, factor) in sharp.iter_mut().zip(&*self.correction) {
                *light *= factor;
            }
            residual_after = self.compare(level, views, sharp);
        }
        let kept = residual_after < residual_before;
        if !kept {
            sharp.copy_from_slice(self.captured);
        }
        let taps = ((2 * iterations + 1) * views) as u64 * self.captured.len() as u64;
        DeblurReport { residual_before, residual_after, kept, taps }
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
