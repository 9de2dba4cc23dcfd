//! Robust scale of a sample.

/// Median of the values, which are reordered; 0 for an empty slice.
pub(crate) fn median(values: &mut [f32]) -> f32 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// Standard deviation of a normal distribution per median of absolute values.
pub(crate) const SIGMA_PER_MEDIAN_ABSOLUTE: f32 = 1.4826;
