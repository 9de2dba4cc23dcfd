//! Compositing of the splats at one pixel, front to back, and its derivative.

use nalgebra::{Vector2, Vector3};

use super::projection::Splat;
use super::{Cutoff, SplatGradient};
use crate::raster::constants::{MAX_ALPHA, MIN_ALPHA, MIN_TRANSMITTANCE};

/// A splat at a pixel.
struct Contribution {
    /// Index into the splats.
    splat: usize,
    /// From the centre of the splat to the pixel.
    offset: Vector2<f64>,
    alpha: f64,
    /// Derivative of alpha by the logarithm of what it was before ceiling and cutoff.
    alpha_by_logarithm: f64,
    /// Transmittance in front of the splat.
    transmittance: f64,
}

/// What a pixel shows.
pub(super) struct Pixel {
    pub(super) colour: Vector3<f64>,
    pub(super) depth: f64,
    pub(super) alpha: f64,
    contributions: Vec<Contribution>,
}

/// Gradient by what a pixel shows.
pub(super) struct PixelGradient {
    pub(super) colour: Vector3<f64>,
    pub(super) depth: f64,
    pub(super) alpha: f64,
}

/// Composites the splats, which are sorted by depth, at the pixel `at`.
pub(super) fn composite(
    splats: &[Splat],
    at: Vector2<f64>,
    background: &Vector3<f64>,
    cutoff: Cutoff,
) -> Pixel {
    let mut transmittance = 1.0;
    let mut pixel = Pixel { colour: Vector3::zeros(), depth: 0.0, alpha: 0.0, contributions: Vec::new() };
    for (index, splat) in splats.iter().enumerate() {
        let offset = at - splat.centre;
        // alpha = opacity exp(-d^T C d / 2).
        let raw = splat.opacity * (-0.5 * (splat.conic * offset).dot(&offset)).exp();
        let Some((alpha, alpha_by_logarithm)) = effective_alpha(raw, cutoff) else { continue };
        let behind = transmittance * (1.0 - alpha);
        // The pixel is opaque.
        if cutoff == Cutoff::Hard && behind <= MIN_TRANSMITTANCE {
            break;
        }
        // C = sum of c_i alpha_i T_i with T_i = product of (1 - alpha_j) before i.
        let weight = alpha * transmittance;
        pixel.colour += weight * splat.colour;
        pixel.depth += weight * splat.depth_at(&offset);
        let contribution = Contribution { splat: index, offset, alpha, alpha_by_logarithm, transmittance };
        pixel.contributions.push(contribution);
        transmittance = behind;
    }
    pixel.colour += transmittance * background;
    pixel.alpha = 1.0 - transmittance;
    pixel
}

impl Splat {
    /// Camera z at an offset from the centre.
    fn depth_at(&self, offset: &Vector2<f64>) -> f64 {
        self.depth + self.tilt.dot(offset)
    }
}

/// Alpha after ceiling and cutoff, and its derivative by `ln raw`; `None` if the splat is skipped.
fn effective_alpha(raw: f64, cutoff: Cutoff) -> Option<(f64, f64)> {
    let (alpha, grad_logarithm) = if raw < MAX_ALPHA { (raw, raw) } else { (MAX_ALPHA, 0.0) };
    // From here up to twice as much, the smooth cutoff fades a splat in.
    let excess = (alpha - MIN_ALPHA) / MIN_ALPHA;
    match cutoff {
        Cutoff::Hard => (alpha >= MIN_ALPHA).then_some((alpha, grad_logarithm)),
        Cutoff::Smooth if excess >= 1.0 => Some((alpha, grad_logarithm)),
        Cutoff::Smooth => (excess > 0.0).then(|| {
            let fade = excess * excess * (3.0 - 2.0 * excess);
            let fade_by_alpha = 6.0 * excess * (1.0 - excess) / MIN_ALPHA;
            (alpha * fade, grad_logarithm * (fade + alpha * fade_by_alpha))
        }),
    }
}

impl Pixel {
    /// Number of splats composited.
    pub(super) fn contributions(&self) -> u32 {
        self.contributions.len() as u32
    }

    /// Adds the gradient by every splat of the pixel. Walking back to front, `behind` is the value of the loss's
    /// linear form on everything behind a splat as seen through no other.
    pub(super) fn backward(
        &self,
        splats: &[Splat],
        background: &Vector3<f64>,
        grad_pixel: &PixelGradient,
        gradients: &mut [SplatGradient],
    ) {
        let mut behind = grad_pixel.colour.dot(background);
        for contribution in self.contributions.iter().rev() {
            let splat = &splats[contribution.splat];
            let gradient = &mut gradients[contribution.splat];
            let weight = contribution.alpha * contribution.transmittance;
            gradient.colour += weight * grad_pixel.colour;
            let offset = contribution.offset;
            let grad_depth = weight * grad_pixel.depth;
            gradient.depth += grad_depth;
            gradient.tilt += grad_depth * offset;
            gradient.centre -= grad_depth * splat.tilt;

            let depth = splat.depth_at(&offset);
            // dC/d(alpha_i) = T_i (c_i - C_behind), all as seen through the splats before.
            let own = grad_pixel.colour.dot(&splat.colour) + grad_pixel.depth * depth + grad_pixel.alpha;
            let grad_alpha = contribution.transmittance * (own - behind);
            let grad_logarithm = grad_alpha * contribution.alpha_by_logarithm;
            // By the logarithm of alpha: opacity is a factor, the exponent a quadratic form.
            gradient.opacity += grad_logarithm / splat.opacity;
            gradient.centre += grad_logarithm * (splat.conic * offset);
            gradient.conic[0] -= grad_logarithm * 0.5 * offset.x * offset.x;
            gradient.conic[1] -= grad_logarithm * offset.x * offset.y;
            gradient.conic[2] -= grad_logarithm * 0.5 * offset.y * offset.y;
            behind += contribution.alpha * (own - behind);
        }
    }
}
