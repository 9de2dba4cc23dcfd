//! Figures that a few wrong frames do not change.

/// The middle of some values and how uncertain it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spread {
    /// Middle value.
    pub(super) median: f64,
    /// Standard deviation of the median, from the median distance to it.
    pub(super) sigma: f64,
}

/// Middle value; none without values.
pub(super) fn median(values: &[f64]) -> Option<f64> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let upper = *sorted.get(sorted.len() / 2)?;
    let lower = sorted[(sorted.len() - 1) / 2];
    Some(0.5 * (lower + upper))
}

/// Median and its uncertainty; none without values.
pub(super) fn spread(values: &[f64]) -> Option<Spread> {
    let median_value = median(values)?;
    let distances: Vec<f64> = values.iter().map(|value| (value - median_value).abs()).collect();
    // 1.4826 turns the median distance into the standard deviation of a normal distribution, 1.2533 that of a mean into
    // that of a median.
    let deviation = 1.4826 * median(&distances)?;
    Some(Spread { median: median_value, sigma: 1.2533 * deviation / (values.len() as f64).sqrt() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_wild_value_changes_little() {
        assert_eq!(median(&[3.0, 1.0, 1e9]), Some(3.0));
        assert_eq!(median(&[4.0, 2.0]), Some(3.0));
        assert_eq!(median(&[f64::NAN]), None);
        let values = [1.0, 2.0, 3.0, 4.0, 1e9];
        let found = spread(&values).unwrap();
        assert_eq!(found.median, 3.0);
        // Median distance 1.
        assert!((found.sigma - 1.4826 * 1.2533 / 5f64.sqrt()).abs() < 1e-12);
    }
}
