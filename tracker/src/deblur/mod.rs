//! Deblurring an image with its own, known motion.
//!
//! The blur of a frame whose exposure was estimated is a known linear operator: the mean over virtual views. Its
//! inverse is approached by Richardson-Lucy iterations, which keep light non-negative and conserved, and which
//! are the maximum-likelihood estimate under photon noise. Stopping early is the regularisation.

mod flow;
mod line_blur;

pub use flow::BlurFlow;
pub use line_blur::blur_along;

use fearless_simd::{Level, dispatch, prelude::*};

use crate::workspace::{Arena, WorkspaceError, slice_bytes};

/// Light added to both sides of the ratio, so that black pixels neither divide by zero nor dominate.
const RATIO_FLOOR: f32 = 0.01;

/// Largest change of a pixel in one iteration: keeps noise in dark pixels from exploding.
const RATIO_LIMIT: f32 = 3.0;

/// Encoded values above this light are clipped: their true light is unknown.
const SATURATION: f32 = 0.98;

/// Memory for deblurring images of one size.
#[derive(Debug)]
pub struct DeblurScratch<'m> {
    /// Blur path of every pixel.
    pub flow: BlurFlow<'m>,
    reblurred: &'m mut [f32],
    correction: &'m mut [f32],
}

impl<'m> DeblurScratch<'m> {
    /// Bytes of workspace for images of this size.
    #[must_use]
    pub const fn bytes(width: usize, height: usize) -> usize {
        4 * slice_bytes::<f32>(width * height)
    }

    /// Takes the memory from `arena`.
    ///
    /// # Errors
    /// [`WorkspaceError`] when the arena is exhausted.
    pub fn carve(arena: &mut Arena<'m>, width: usize, height: usize) -> Result<Self, WorkspaceError> {
        Ok(Self {
            flow: BlurFlow::carve(arena, width, height)?,
            reblurred: arena.take(width * height)?,
            correction: arena.take(width * height)?,
        })
    }

    /// One Richardson-Lucy iteration: improves `sharp` so that, blurred along the flow with `views` virtual
    /// views, it explains `captured`. Returns the root mean square residual before the iteration.
    pub fn iterate(&mut self, level: Level, views: usize, captured: &[f32], sharp: &mut [f32]) -> f32 {
        blur_along(level, sharp, &self.flow, views, self.reblurred);
        let mut sum = 0.0f64;
        for (row_captured, row_reblurred) in
            captured.chunks(self.flow.width).zip(self.reblurred.chunks_mut(self.flow.width))
        {
            sum += f64::from(dispatch!(level, simd => ratios(simd, row_captured, row_reblurred)));
        }
        blur_along(level, self.reblurred, &self.flow, views, self.correction);
        for (light, factor) in sharp.iter_mut().zip(&*self.correction) {
            *light = (*light * factor).min(1.5);
        }
        crate::math::sqrt((sum / captured.len().max(1) as f64).max(0.0)) as f32
    }
}

/// Replaces reblurred light by the ratio captured/reblurred; returns the sum of squared differences.
#[inline(always)]
fn ratios<S: Simd>(_simd: S, captured: &[f32], reblurred: &mut [f32]) -> f32 {
    let mut sum = 0.0;
    for (&b, r) in captured.iter().zip(reblurred) {
        let difference = b - *r;
        sum += difference * difference;
        let ratio = (b + RATIO_FLOOR) / (*r + RATIO_FLOOR);
        *r = if b > SATURATION { ratio.max(1.0).min(1.0) } else { ratio.clamp(1.0 / RATIO_LIMIT, RATIO_LIMIT) };
    }
    sum
}
