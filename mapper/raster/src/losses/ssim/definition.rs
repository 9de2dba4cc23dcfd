//! Structural similarity of images (Wang et al. 2004, "Image quality assessment: from error visibility to structural
//! similarity") in double precision.
//!
//! Constants, window and border are those of the paper and of scikit-image's `structural_similarity` with
//! `gaussian_weights=True, sigma=1.5, use_sample_covariance=False`: a Gaussian window of 11x11 pixels, population
//! moments, and the mean over the windows that lie inside the image.

/// Side of the window in pixels.
pub const WINDOW: usize = 11;

/// Standard deviation of the window in pixels.
pub(crate) const SIGMA: f64 = 1.5;

/// K1 and K2 of the paper; times the range of values and squared they keep the quotients finite.
pub(crate) const STABILISERS: [f64; 2] = [0.01, 0.03];

/// Weights of a row or column of the window, which sum to one.
pub(crate) fn window_weights() -> [f64; WINDOW] {
    let middle = (WINDOW / 2) as f64;
    let weights: [f64; WINDOW] =
        core::array::from_fn(|k| (-0.5 * ((k as f64 - middle) / SIGMA).powi(2)).exp());
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

/// Mean SSIM of two planes of `[width, height]` values, row by row, that span `range`.
///
/// Both sides are at least [`WINDOW`] and the planes have that size.
pub fn mean_ssim(size: [usize; 2], a: &[f64], b: &[f64], range: f64) -> f64 {
    let weights = window_weights();
    let product = |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a * b).collect() };
    let [mean_a, mean_b, aa, bb, ab] = [a, b, &product(a, a), &product(b, b), &product(a, b)]
        .map(|plane| window_means(size, plane, &weights));
    let [c1, c2] = STABILISERS.map(|k| (k * range).powi(2));
    let similarity = |k: usize| {
        let (ma, mb) = (mean_a[k], mean_b[k]);
        let (variances, covariance) = (aa[k] - ma * ma + bb[k] - mb * mb, ab[k] - ma * mb);
        (2.0 * ma * mb + c1) * (2.0 * covariance + c2) / ((ma * ma + mb * mb + c1) * (variances + c2))
    };
    (0..mean_a.len()).map(similarity).sum::<f64>() / mean_a.len() as f64
}

/// Weighted mean over every window inside the plane.
fn window_means([width, height]: [usize; 2], plane: &[f64], weights: &[f64; WINDOW]) -> Vec<f64> {
    let weighted = |values: &mut dyn Iterator<Item = f64>| -> f64 {
        weights.iter().zip(values).map(|(weight, value)| weight * value).sum()
    };
    let rows: Vec<f64> = plane
        .chunks_exact(width)
        .flat_map(|row| row.windows(WINDOW).map(|window| weighted(&mut window.iter().copied())))
        .collect();
    let width = width + 1 - WINDOW;
    (0..width * (height + 1 - WINDOW))
        .map(|k| weighted(&mut rows[k..].iter().step_by(width).copied()))
        .collect()
}
