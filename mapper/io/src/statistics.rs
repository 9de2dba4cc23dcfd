//! Summary of a list of errors.

use serde::{Deserialize, Serialize};

/// The usual figures of a list of errors, in the unit of the errors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// Root of the mean square.
    pub rmse: f64,
    /// Arithmetic mean.
    pub mean: f64,
    /// Middle value; the mean of the two middle ones for an even count.
    pub median: f64,
    /// Standard deviation of the population (divided by the count, as `evo` does).
    pub std: f64,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
}

impl Statistics {
    /// The figures of `errors`; `None` when there are none or one is not finite.
    #[must_use]
    pub fn of(errors: &[f64]) -> Option<Self> {
        if errors.is_empty() || errors.iter().any(|e| !e.is_finite()) {
            return None;
        }
        let count = errors.len() as f64;
        let mut sorted = errors.to_vec();
        sorted.sort_by(f64::total_cmp);
        let mean = errors.iter().sum::<f64>() / count;
        let mean_square = errors.iter().map(|e| e * e).sum::<f64>() / count;
        // About the mean; the root mean square is about zero.
        let variance = errors.iter().map(|e| (e - mean) * (e - mean)).sum::<f64>() / count;
        Some(Self {
            rmse: mean_square.sqrt(),
            mean,
            median: quantile_of_sorted(&sorted, 0.5),
            std: variance.sqrt(),
            min: sorted[0],
            max: sorted[sorted.len() - 1],
        })
    }

    /// The same figures in another unit: every one times `factor` (positive).
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            rmse: self.rmse * factor,
            mean: self.mean * factor,
            median: self.median * factor,
            std: self.std * factor,
            min: self.min * factor,
            max: self.max * factor,
        }
    }
}

/// The `q` quantile (0 to 1) of finite `values` by linear interpolation between order statistics; `None` when empty.
#[must_use]
pub fn quantile(values: &[f64], q: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    (!sorted.is_empty()).then(|| quantile_of_sorted(&sorted, q))
}

/// Share (0 to 1) of `errors` that are at most `threshold`; 0 for an empty list.
#[must_use]
pub fn share_within(errors: &[f64], threshold: f64) -> f64 {
    let good = errors.iter().filter(|&&e| e <= threshold).count();
    good as f64 / errors.len().max(1) as f64
}

fn quantile_of_sorted(sorted: &[f64], q: f64) -> f64 {
    let position = q.clamp(0.0, 1.0) * (sorted.len() - 1) as f64;
    let below = position.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (sorted[above] - sorted[below]) * (position - below as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_a_known_list() {
        let s = Statistics::of(&[4.0, 1.0, 3.0, 0.0]).unwrap();
        assert_eq!((s.min, s.max, s.mean, s.median), (0.0, 4.0, 2.0, 2.0));
        assert_eq!(s.rmse, 6.5f64.sqrt());
        assert_eq!(s.std, 2.5f64.sqrt());
    }

    #[test]
    fn no_figures_without_finite_errors() {
        assert_eq!(Statistics::of(&[]), None);
        assert_eq!(Statistics::of(&[1.0, f64::NAN]), None);
    }

    #[test]
    fn quantiles_interpolate_and_ignore_nan() {
        let values = [10.0, f64::NAN, 0.0, 30.0, 20.0, 40.0];
        assert_eq!(quantile(&values, 0.95), Some(38.0));
        assert_eq!(quantile(&values, 0.0), Some(0.0));
        assert_eq!(quantile(&[f64::NAN], 0.5), None);
    }

    #[test]
    fn share_counts_the_border() {
        assert_eq!(share_within(&[0.01, 0.02, 0.03, 0.04], 0.02), 0.5);
        assert_eq!(share_within(&[], 0.02), 0.0);
    }
}
