//! Which estimated pose belongs to which reference pose.

/// Largest time difference of a matched pair in seconds, the default of `evo`.
pub const DEFAULT_MAX_DT: f64 = 0.01;

/// Indices of one reference pose and one estimated pose at the same time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Match {
    /// Index into the reference.
    pub reference: usize,
    /// Index into the estimate.
    pub estimate: usize,
}

/// Pairs time stamps (seconds, each list ascending) that are at most `max_dt` apart; the result is ascending.
///
/// As in `evo`, every stamp of the shorter list (the estimate when both are equally long) takes the nearest stamp
/// of the longer one. Unlike there, no stamp is used twice: the nearer of two claimants wins, so a gap in the longer
/// list cannot count one pose several times. Where stamps are more than `2 max_dt` apart both rules agree.
#[must_use]
pub fn associate(reference: &[f64], estimate: &[f64], max_dt: f64) -> Vec<Match> {
    if estimate.len() > reference.len() {
        let pairs = nearest_one_to_one(reference, estimate, max_dt);
        pairs.into_iter().map(|(reference, estimate)| Match { reference, estimate }).collect()
    } else {
        let pairs = nearest_one_to_one(estimate, reference, max_dt);
        pairs.into_iter().map(|(estimate, reference)| Match { reference, estimate }).collect()
    }
}

/// Pairs (index in `short`, index in `long`).
fn nearest_one_to_one(short: &[f64], long: &[f64], max_dt: f64) -> Vec<(usize, usize)> {
    let mut pairs: Vec<(usize, usize)> = Vec::with_capacity(short.len());
    for (i, &stamp) in short.iter().enumerate() {
        let Some(j) = nearest(long, stamp).filter(|&j| (long[j] - stamp).abs() <= max_dt) else { continue };
        match pairs.last_mut() {
            Some(last) if last.1 == j => {
                if (long[j] - stamp).abs() < (long[j] - short[last.0]).abs() {
                    *last = (i, j);
                }
            }
            _ => pairs.push((i, j)),
        }
    }
    pairs
}

/// Index of the ascending stamp nearest to `stamp`, the earlier one of two equally near.
fn nearest(stamps: &[f64], stamp: f64) -> Option<usize> {
    let after = stamps.partition_point(|&s| s < stamp);
    match (after.checked_sub(1), stamps.get(after)) {
        (Some(before), Some(&next)) if next - stamp < stamp - stamps[before] => Some(after),
        (Some(before), _) => Some(before),
        (None, Some(_)) => Some(after),
        (None, None) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn indices(matches: &[Match]) -> Vec<(usize, usize)> {
        matches.iter().map(|m| (m.reference, m.estimate)).collect()
    }

    #[test]
    fn nearest_stamp_within_tolerance_wins() {
        let reference = [0.0, 0.010, 0.020, 0.030, 0.500];
        let estimate = [0.004, 0.026, 0.400, 0.509];
        assert_eq!(indices(&associate(&reference, &estimate, 0.01)), [(0, 0), (3, 1), (4, 3)]);
    }

    #[test]
    fn longer_estimate_is_searched_from_the_reference() {
        let reference = [0.0, 0.1];
        let estimate = [-0.003, 0.001, 0.095, 0.108];
        assert_eq!(indices(&associate(&reference, &estimate, 0.01)), [(0, 1), (1, 2)]);
    }

    #[test]
    fn one_stamp_is_never_used_twice() {
        let reference = [0.0, 1.0, 2.0, 3.0];
        let estimate = [0.993, 1.002, 1.008];
        assert_eq!(indices(&associate(&reference, &estimate, 0.01)), [(1, 1)]);
    }

    #[test]
    fn nothing_to_match_gives_nothing() {
        assert!(associate(&[], &[1.0], 0.01).is_empty());
        assert!(associate(&[1.0], &[], 0.01).is_empty());
        assert!(associate(&[1.0], &[2.0], 0.01).is_empty());
    }
}
