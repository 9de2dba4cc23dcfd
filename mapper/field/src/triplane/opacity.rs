//! From signed distances to opacities, and along a ray to weights.

use fearless_simd::{f32x8, prelude::*};

use mba_raster::raster::exp::exp;

/// Opacity of a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Opacity {
    /// Share of the light from behind that the sample hides.
    pub(super) alpha: f32,
    /// `sigmoid(-beta s)`.
    pub(super) inside: f32,
}

/// Opacities for signed distances: `1 - exp(-beta sigmoid(-beta s))` (MBA-SLAM eq. 12 to 14, ESLAM eq. 4). There is no
/// length of an interval in it: an opacity belongs to a sample.
#[inline(always)]
pub(super) fn opacity<S: Simd>(simd: S, distances: &[f32], sharpness: f32, out: &mut Vec<Opacity>) {
    out.clear();
    for distances in distances.chunks(8) {
        let mut lanes = [0.0; 8];
        lanes[..distances.len()].copy_from_slice(distances);
        let s = f32x8::load_array(simd, lanes);
        let one = f32x8::splat(simd, 1.0);
        let inside = one / (exp(s * sharpness) + 1.0);
        let alpha = one - exp(inside * -sharpness);
        let (alpha, inside) = (alpha.to_array(), inside.to_array());
        let pairs = alpha.into_iter().zip(inside).take(distances.len());
        out.extend(pairs.map(|(alpha, inside)| Opacity { alpha, inside }));
    }
}

/// Stores the weights `alpha_i prod_(j<i) (1 - alpha_j)` of the samples of a ray, and returns their sum.
pub(super) fn weigh(opacities: &[Opacity], weights: &mut [f32]) -> f32 {
    let mut behind = 1.0;
    for (weight, opacity) in weights.iter_mut().zip(opacities) {
        *weight = opacity.alpha * behind;
        behind *= 1.0 - opacity.alpha;
    }
    1.0 - behind
}

/// Adds the gradient by the signed distances of a ray's samples to `grad_distances`, given that by their weights, and
/// returns the gradient by the logarithm of the sharpness.
///
/// With the density `q = beta y`, `y = sigmoid(-beta s)`, and light T that arrives at a sample: the gradient by q is
/// `(1 - alpha) T g - sum_(j>i) w_j g_j`. Nothing is divided by, so that opaque samples are no exception.
pub(super) fn weigh_backward(
    sharpness: f32,
    distances: &[f32],
    opacities: &[Opacity],
    weights: &[f32],
    grad_weights: &[f32],
    grad_distances: &mut [[f32; 1]],
) -> f32 {
    let mut arriving = 1.0;
    let mut later: f32 = weights.iter().zip(grad_weights).map(|(weight, by)| weight * by).sum();
    let mut grad_log_sharpness = 0.0;
    for i in 0..weights.len() {
        let Opacity { alpha, inside } = opacities[i];
        later -= weights[i] * grad_weights[i];
        arriving *= 1.0 - alpha;
        let grad_density = arriving * grad_weights[i] - later;
        let steep = sharpness * inside * (1.0 - inside);
        grad_distances[i][0] -= grad_density * sharpness * steep;
        grad_log_sharpness += grad_density * sharpness * (inside - distances[i] * steep);
    }
    grad_log_sharpness
}

#[cfg(test)]
mod tests {
    use mba_tracker::simd::{Level, levels_up_to};

    use super::*;

    const DISTANCES: [f32; 7] = [0.9, 0.4, 0.1, 0.02, -0.05, -0.3, 0.5];
    const GRAD_WEIGHTS: [f32; 7] = [0.3, -0.2, 1.0, 0.7, -1.5, 0.4, 2.0];

    /// Weighted sum in double precision.
    fn sum(distances: &[f64], sharpness: f64) -> f64 {
        let mut behind = 1.0;
        let mut sum = 0.0;
        for (s, by) in distances.iter().zip(GRAD_WEIGHTS) {
            let alpha = 1.0 - (-sharpness / (1.0 + (sharpness * s).exp())).exp();
            sum += behind * alpha * f64::from(by);
            behind *= 1.0 - alpha;
        }
        sum
    }

    #[test]
    fn gradients_are_those_of_finite_differences_at_every_level() {
        let sharpness = 12.0_f32;
        let exact: Vec<f64> = DISTANCES.iter().map(|s| f64::from(*s)).collect();
        for level in levels_up_to(Level::new()) {
            let (mut opacities, mut weights, mut by) = (Vec::new(), [0.0; 7], [[0.0; 1]; 7]);
            fearless_simd::dispatch!(level, simd => opacity(simd, &DISTANCES, sharpness, &mut opacities));
            let total = weigh(&opacities, &mut weights);
            assert!((weights.iter().sum::<f32>() - total).abs() < 1e-6);
            let weighted: f64 = weights.iter().zip(GRAD_WEIGHTS).map(|(w, g)| f64::from(w * g)).sum();
            assert!((weighted - sum(&exact, 12.0)).abs() < 1e-5);
            let grad_log =
                weigh_backward(sharpness, &DISTANCES, &opacities, &weights, &GRAD_WEIGHTS, &mut by);
            for k in 0..7 {
                let moved = |by: f64| {
                    let mut moved = exact.clone();
                    moved[k] += by;
                    sum(&moved, 12.0)
                };
                let numeric = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                assert!((numeric - f64::from(by[k][0])).abs() < 2e-4, "{k}: {} not {numeric}", by[k][0]);
            }
            let at = |log: f64| sum(&exact, 12.0 * log.exp());
            let numeric = (at(1e-5) - at(-1e-5)) / 2e-5;
            assert!((numeric - f64::from(grad_log)).abs() < 2e-4, "{grad_log}, not {numeric}");
        }
    }
}
