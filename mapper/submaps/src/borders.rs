//! Keyframes of other groups that a group is mapped with.

use std::ops::Range;

use mba_tracker::geometry::PinholeCamera;
use rayon::prelude::*;

use crate::shared_view::CoarseView;

/// Share of the most keyframes of a group that its border has before it, and behind it.
const BESIDE: f64 = 0.08;

/// Share of the most keyframes that come from elsewhere.
const REVISITS: f64 = 0.24;

/// Share of the view that a keyframe from elsewhere has in common with one of the group.
const LEAST_SHARED: f64 = 0.3;

/// Positions of the border keyframes of every group, ascending: those next to it in time, and of all others those that share
/// most with it. `most` is the size of the largest group.
pub(crate) fn borders(
    groups: &[Range<usize>],
    views: &[CoarseView],
    camera: &PinholeCamera,
    most: usize,
) -> Vec<Vec<usize>> {
    let part = |share: f64| ((share * most as f64).round() as usize).max(2);
    let (beside, revisits) = (part(BESIDE), part(REVISITS));
    groups.par_iter().map(|group| border(group, views, camera, (beside, revisits))).collect()
}

fn border(
    group: &Range<usize>,
    views: &[CoarseView],
    camera: &PinholeCamera,
    (beside, revisits): (usize, usize),
) -> Vec<usize> {
    let near = group.start.saturating_sub(beside)..views.len().min(group.end + beside);
    let shared = |other: usize| {
        let with = |own: usize| views[own].shared_with(&views[other], camera);
        group.clone().map(with).fold(0.0, f64::max)
    };
    let elsewhere = (0..views.len()).filter(|other| !near.contains(other));
    let mut seen_again: Vec<(f64, usize)> =
        elsewhere.map(|other| (shared(other), other)).filter(|(share, _)| *share > LEAST_SHARED).collect();
    // The most shared views first; equal ones in the order of time, so that the choice is the same everywhere.
    seen_again.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut border: Vec<usize> = near.filter(|k| !group.contains(k)).collect();
    border.extend(seen_again.into_iter().take(revisits).map(|(_, other)| other));
    border.sort_unstable();
    border
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared_view::tests::{CAMERA, view};

    #[test]
    fn a_border_has_neighbours_and_places_seen_again() {
        // There and back along a wall, then away from it: the second group passes what the first one saw.
        let shifts: [f64; 15] =
            [0.0, 1.0, 2.0, 3.0, 20.0, 21.0, 22.0, 23.0, 24.0, 25.0, 26.0, 2.9, 1.9, 0.9, 60.0];
        let views: Vec<CoarseView> = shifts.iter().map(|shift| view(0.0, *shift, 2.0)).collect();
        let found = borders(&[0..4, 4..11, 11..15], &views, &CAMERA, 10);
        // Two on each side, and two from elsewhere at the most.
        assert_eq!(found[0], [4, 5, 11, 12]);
        assert_eq!(found[1], [2, 3, 11, 12]);
        assert_eq!(found[2], [1, 2, 9, 10]);
    }
}
