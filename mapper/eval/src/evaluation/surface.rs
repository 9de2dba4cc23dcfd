//! How well two surfaces, given by points on them, agree.

use mba_io::statistics::{Statistics, share_within};
use serde::{Deserialize, Serialize};

use super::kd_tree::{KdTree, distance};

/// Points of the reference from which its spacing is taken.
const SPACING_SAMPLES: usize = 10_000;

/// Why surfaces cannot be compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceComparisonError {
    /// One of them is empty.
    #[error("the {0} surface has no points")]
    Empty(&'static str),
    /// A coordinate is not a finite number.
    #[error("the {0} surface has a point that is not finite")]
    NotFinite(&'static str),
}

/// Mean and median of distances.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeanMedian {
    /// Arithmetic mean.
    pub mean: f64,
    /// Middle value.
    pub median: f64,
}

/// Shares of points within a distance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ThresholdFigures {
    /// The distance, centimetres.
    pub threshold_cm: f64,
    /// Share (0 to 1) of the estimate's points with a reference point within it.
    pub precision: f64,
    /// Share (0 to 1) of the reference's points with an estimated point within it.
    pub recall: f64,
    /// Harmonic mean of both; 0 if both are.
    pub f1: f64,
}

/// Figures of merit of a surface, as in Tanks and Temples (Knapitsch et al. 2017).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SurfaceFigures {
    /// Points on the reference.
    pub reference_points: usize,
    /// Points on the estimate.
    pub estimate_points: usize,
    /// Median distance from a reference point to the nearest other one. Precision at thresholds near or below it is
    /// limited by the reference, not by the estimate.
    pub reference_spacing_cm: f64,
    /// Distances from the estimate to the reference.
    pub accuracy_cm: MeanMedian,
    /// Distances from the reference to the estimate.
    pub completion_cm: MeanMedian,
    /// Shares for every threshold.
    pub thresholds: Vec<ThresholdFigures>,
}

/// Compares points on an estimated surface with points on a reference, both in metres in one frame.
///
/// # Errors
/// [`SurfaceComparisonError`] for lists that are empty or not finite.
pub fn evaluate_surface(
    reference: &[[f32; 3]],
    estimate: &[[f32; 3]],
    thresholds_cm: &[f64],
) -> Result<SurfaceFigures, SurfaceComparisonError> {
    for (name, points) in [("reference", reference), ("estimated", estimate)] {
        if points.is_empty() {
            return Err(SurfaceComparisonError::Empty(name));
        }
        if points.iter().flatten().any(|coordinate| !coordinate.is_finite()) {
            return Err(SurfaceComparisonError::NotFinite(name));
        }
    }
    // Both ways: distances from the estimate say how exact it is, those from the reference how complete.
    let tree = KdTree::new(reference);
    let accuracy = tree.distances(estimate);
    let completion = KdTree::new(estimate).distances(reference);
    let empty = |name| move || SurfaceComparisonError::Empty(name);
    Ok(SurfaceFigures {
        reference_points: reference.len(),
        estimate_points: estimate.len(),
        completion_cm: MeanMedian::of_metres(&completion).ok_or_else(empty("reference"))?,
        accuracy_cm: MeanMedian::of_metres(&accuracy).ok_or_else(empty("estimated"))?,
        reference_spacing_cm: spacing_cm(&tree, reference),
        thresholds: thresholds_cm
            .iter()
            .map(|threshold| ThresholdFigures::new(*threshold, &accuracy, &completion))
            .collect(),
    })
}

impl MeanMedian {
    /// In centimetres, of distances in metres; `None` if there are none.
    fn of_metres(distances: &[f64]) -> Option<Self> {
        let statistics = Statistics::of(distances)?.scaled(100.0);
        Some(Self { mean: statistics.mean, median: statistics.median })
    }
}

impl ThresholdFigures {
    fn new(threshold_cm: f64, accuracy: &[f64], completion: &[f64]) -> Self {
        let [precision, recall] =
            [accuracy, completion].map(|distances| share_within(distances, 0.01 * threshold_cm));
        let sum = precision + recall;
        let f1 = if sum > 0.0 { 2.0 * precision * recall / sum } else { 0.0 };
        Self { threshold_cm, precision, recall, f1 }
    }
}

/// Median distance to the nearest other point over a part of the points; 0 if all are at one place.
fn spacing_cm(tree: &KdTree, points: &[[f32; 3]]) -> f64 {
    let step = points.len().div_ceil(SPACING_SAMPLES).max(1);
    let to_other = |point| tree.nearest_other(point).map(|other| distance(point, &other));
    let distances: Vec<f64> = points.iter().step_by(step).filter_map(to_other).collect();
    MeanMedian::of_metres(&distances).map_or(0.0, |distances| distances.median)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of `size` x `size` points, 1 cm apart, at the height `z`.
    fn square(size: usize, z: f32) -> Vec<[f32; 3]> {
        (0..size * size).map(|k| [0.01 * (k % size) as f32, 0.01 * (k / size) as f32, z]).collect()
    }

    #[test]
    fn a_shifted_plane_is_as_far_away_as_it_was_shifted() {
        let figures = evaluate_surface(&square(30, 0.0), &square(30, 0.03), &[1.0, 2.9, 3.1]).unwrap();
        for spread in [figures.accuracy_cm, figures.completion_cm] {
            assert!((spread.mean - 3.0).abs() < 1e-5 && (spread.median - 3.0).abs() < 1e-5, "{spread:?}");
        }
        let of = |k: usize| {
            [figures.thresholds[k].precision, figures.thresholds[k].recall, figures.thresholds[k].f1]
        };
        assert_eq!([of(0), of(1), of(2)], [[0.0; 3], [0.0; 3], [1.0; 3]]);
        assert!((figures.reference_spacing_cm - 1.0).abs() < 1e-4);
    }

    #[test]
    fn half_a_plane_is_precise_and_not_complete() {
        // 10 of 20 columns: the missing ones are 1 to 10 cm away.
        let whole = square(20, 0.0);
        let half: Vec<[f32; 3]> = whole.iter().filter(|point| point[0] < 0.095).copied().collect();
        let figures = evaluate_surface(&whole, &half, &[0.5, 2.5]).unwrap();
        assert_eq!(figures.accuracy_cm, MeanMedian { mean: 0.0, median: 0.0 });
        assert!((figures.completion_cm.mean - 0.5 * 5.5).abs() < 1e-4);
        let [tight, loose] = [figures.thresholds[0], figures.thresholds[1]];
        assert_eq!((tight.precision, tight.recall, tight.f1), (1.0, 0.5, 2.0 * 0.5 / 1.5));
        assert_eq!((loose.precision, loose.recall), (1.0, 0.6));
    }

    #[test]
    fn empty_and_infinite_surfaces_are_refused() {
        let message = |reference: &[[f32; 3]], estimate: &[[f32; 3]]| {
            evaluate_surface(reference, estimate, &[1.0]).unwrap_err().to_string()
        };
        let one = [[0.0; 3]];
        assert_eq!(message(&[], &one), "the reference surface has no points");
        assert_eq!(message(&one, &[]), "the estimated surface has no points");
        assert!(message(&one, &[[f32::NAN; 3]]).contains("estimated surface has a point that is not finite"));
    }
}
