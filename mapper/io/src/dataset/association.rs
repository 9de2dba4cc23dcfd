//! Pairing of two lists of timestamps.

/// Pairs each entry of `a` with at most one entry of `b`, both in increasing order, that is at most `tolerance`
/// seconds away: the closest pair first, then the closest of what is left. Returns index pairs in the order of
/// `a`.
pub(super) fn associate(a: &[f64], b: &[f64], tolerance: f64) -> Vec<(usize, usize)> {
    let mut candidates = Vec::new();
    // All pairs within the tolerance, in one pass over both lists.
    let mut first = 0;
    for (i, time) in a.iter().enumerate() {
        while first < b.len() && b[first] < time - tolerance {
            first += 1;
        }
        let near = b[first..].iter().take_while(|other| **other <= time + tolerance);
        candidates.extend(near.enumerate().map(|(k, other)| ((other - time).abs(), i, first + k)));
    }
    candidates.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)).then(x.2.cmp(&y.2)));

    // The closest of them first; ties by the order of the lists.
    let (mut a_taken, mut b_taken) = (vec![false; a.len()], vec![false; b.len()]);
    let mut pairs = Vec::with_capacity(a.len().min(b.len()));
    for (_, i, j) in candidates {
        if !a_taken[i] && !b_taken[j] {
            (a_taken[i], b_taken[j]) = (true, true);
            pairs.push((i, j));
        }
    }
    pairs.sort_unstable();
    pairs
}

/// Smallest distance in time between an entry of `a` and one of `b`, seconds; infinite if one is empty.
pub(super) fn closest(a: &[f64], b: &[f64]) -> f64 {
    let distance = |time: &f64| {
        let after = b.partition_point(|other| other < time);
        let neighbours = &b[after.saturating_sub(1)..b.len().min(after + 1)];
        neighbours.iter().map(|other| (other - time).abs()).fold(f64::INFINITY, f64::min)
    };
    a.iter().map(distance).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closest_pair_wins_and_nothing_is_used_twice() {
        // 1.00 could take 1.01, but 1.012 is closer to it and then only 0.985 is left.
        let pairs = associate(&[1.00, 1.012, 2.0], &[0.985, 1.01, 3.0], 0.02);
        assert_eq!(pairs, [(0, 0), (1, 1)]);
    }

    #[test]
    fn tolerance_is_inclusive_and_pairs_follow_time() {
        assert_eq!(associate(&[0.0, 1.0, 2.0], &[0.25, 1.25, 2.5], 0.25), [(0, 0), (1, 1)]);
        assert_eq!(associate(&[5.0], &[], 1.0), []);
    }

    #[test]
    fn closest_distance_looks_at_both_sides() {
        assert_eq!(closest(&[1.0, 10.0], &[4.0, 8.5, 20.0]), 1.5);
        assert_eq!(closest(&[1.0], &[]), f64::INFINITY);
        assert_eq!(closest(&[1.0], &[3.0]), 2.0);
        assert_eq!(closest(&[3.0], &[1.0]), 2.0);
    }
}
