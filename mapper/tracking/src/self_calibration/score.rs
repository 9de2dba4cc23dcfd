//! How well a supposed camera explains a window, and which of several does it best.

use super::robust::{Spread, median};
use super::window::Tracked;

/// Residual that stands in for a frame that could not be aligned, in standard deviations of the nominal noise: more than
/// that of any frame that was.
const LOST_RESIDUAL: f64 = 40.0;

/// Frames at the start that do not count: the motion of the first one is learnt from the second.
const START: usize = 2;

/// Share of the frames that is left out at either end of a mean.
const TRIM: f64 = 0.15;

/// Logarithm of the residual of each frame; more is worse. Patches that were given up count against it.
pub(super) fn misfits(tracked: &[Tracked]) -> Vec<f64> {
    let misfit = |frame: &Tracked| {
        if frame.is_found && frame.residual > 0.0 {
            frame.residual.min(LOST_RESIDUAL).ln()
        } else {
            LOST_RESIDUAL.ln()
        }
    };
    tracked.iter().skip(START).map(misfit).collect()
}

/// Mean without the largest and smallest values, and its standard deviation.
pub(super) fn trimmed_mean(values: &[f64]) -> Option<Spread> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let cut = (TRIM * sorted.len() as f64) as usize;
    let kept = &sorted[cut..sorted.len().saturating_sub(cut).max(cut)];
    let middle = median(kept)?;
    let mean = kept.iter().sum::<f64>() / kept.len() as f64;
    // The winsorised variance: what was cut counts as much as the outermost values that stayed.
    let (low, high) = (*kept.first().unwrap_or(&middle), *kept.last().unwrap_or(&middle));
    let count = sorted.len() as f64;
    let variance = sorted.iter().map(|value| (value.clamp(low, high) - mean).powi(2)).sum::<f64>() / count;
    Some(Spread { median: mean, sigma: (variance / count).sqrt() / (1.0 - 2.0 * TRIM) })
}

/// How much worse `other` explains the frames than `best` does, with its standard deviation; frame by frame, so that
/// what makes a frame hard for both does not count.
pub(super) fn advantage(best: &[f64], other: &[f64]) -> Option<Spread> {
    let differences: Vec<f64> = best.iter().zip(other).map(|(best, other)| other - best).collect();
    trimmed_mean(&differences)
}

/// The bottom of the parabola through `(place, height)` points by least squares, with its curvature and the standard
/// deviation of a height around it; none where it has no bottom.
pub(super) fn parabola(points: &[(f64, f64)]) -> Option<Parabola> {
    use nalgebra::{Matrix3, Vector3};
    if points.len() < 3 {
        return None;
    }
    let centre = points.iter().map(|point| point.0).sum::<f64>() / points.len() as f64;
    let unit = points.iter().map(|point| (point.0 - centre).abs()).fold(0.0, f64::max);
    let row = |x: f64| {
        let x = (x - centre) / unit;
        Vector3::new(1.0, x, x * x)
    };
    let (mut matrix, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (x, y) in points {
        matrix += row(*x) * row(*x).transpose();
        right += row(*x) * *y;
    }
    let solution = matrix.lu().solve(&right)?;
    if solution.z.is_nan() || solution.z <= 0.0 {
        return None;
    }
    let squares: f64 = points.iter().map(|(x, y)| (row(*x).dot(&solution) - y).powi(2)).sum();
    let freedom = points.len().saturating_sub(3).max(1) as f64;
    let noise = (squares / freedom).sqrt();
    // The bottom moves by d(slope) / (2 curvature).
    let slope_sigma = noise * matrix.try_inverse()?[(1, 1)].max(0.0).sqrt();
    Some(Parabola {
        bottom: centre - unit * solution.y / (2.0 * solution.z),
        sigma: unit * slope_sigma / (2.0 * solution.z),
    })
}

/// Where a parabola is lowest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Parabola {
    /// Place of the bottom.
    pub(super) bottom: f64,
    /// Its standard deviation, from how far the points lie off the parabola.
    pub(super) sigma: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bottom_of_a_parabola_is_found() {
        let height = |x: f64| 3.0 + 0.5 * (x - 1.7) * (x - 1.7);
        let points: Vec<(f64, f64)> = [0.0, 1.0, 2.0, 4.0].iter().map(|x| (*x, height(*x))).collect();
        let found = parabola(&points).unwrap();
        assert!((found.bottom - 1.7).abs() < 1e-9 && found.sigma < 1e-9, "{found:?}");
        let upside_down: Vec<(f64, f64)> = points.iter().map(|(x, y)| (*x, -y)).collect();
        assert_eq!(parabola(&upside_down), None);
        assert_eq!(parabola(&points[..2]), None);
    }

    #[test]
    fn noise_makes_the_bottom_uncertain() {
        let noise = [0.1, -0.1, 0.1, -0.1, 0.1];
        let points: Vec<(f64, f64)> =
            noise.iter().enumerate().map(|(k, n)| (k as f64, (k as f64 - 2.0).powi(2) + n)).collect();
        let found = parabola(&points).unwrap();
        // sigma = noise / sqrt(sum x^2) / 2 with x = -2..2.
        assert!((found.bottom - 2.0).abs() < 1e-9, "{found:?}");
        assert!((0.01..0.04).contains(&found.sigma), "{found:?}");
    }

    #[test]
    fn the_trimmed_mean_ignores_the_outermost() {
        let mut values = vec![1.0, 2.0, 3.0, 2.0, 1.0, 3.0, 2.0, 2.0, 1e6, -1e6];
        assert_eq!(trimmed_mean(&values).unwrap().median, 2.0);
        values.truncate(0);
        assert!(trimmed_mean(&values).is_none());
    }
}
