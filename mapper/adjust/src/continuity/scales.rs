//! How a sequence usually moves, told by its mid-exposure poses, which do not depend on the direction of time.

use mba_io::statistics::quantile;
use mba_tracker::geometry::RigidTransform;
use nalgebra::Vector3;

use super::spline::Part;

/// Median length of a vector of three standard normal numbers.
pub(super) const MEDIAN_NORM_3: f64 = 1.538;

/// Frames to either side whose motion is typical of a frame's. A hand is calm for a second and shakes in the next.
const WINDOW: usize = 8;

/// How much more than in the whole sequence may be typical of a place.
const LARGEST_RISE: f64 = 3.0;

/// A pose at mid exposure.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) timestamp: f64,
    pub(super) world_from_camera: RigidTransform,
}

/// Standard deviation along one axis of the `order`-th derivative of the path near each sample, at least that of the
/// whole sequence: medians over divided differences. All zero for fewer than `order + 1` samples.
pub(super) fn typical_derivatives(samples: &[Sample], part: Part, order: usize) -> Vec<f64> {
    let lengths: Vec<f64> =
        samples.windows(order + 1).map(|window| derivative(window, part).norm()).collect();
    let median = |values: &[f64]| quantile(values, 0.5).unwrap_or(0.0);
    let overall = median(&lengths);
    (0..samples.len())
        .map(|k| {
            let first = k.saturating_sub(WINDOW + order).min(lengths.len());
            let end = (k + WINDOW + 1).min(lengths.len());
            median(&lengths[first..end.max(first)]).clamp(overall, LARGEST_RISE * overall) / MEDIAN_NORM_3
        })
        .collect()
}

/// The highest derivative that the samples determine: their divided difference times a factorial. Rotations are told
/// from the first sample's.
pub(super) fn derivative(samples: &[Sample], part: Part) -> Vector3<f64> {
    let origin = &samples[0].world_from_camera;
    let mut sum = Vector3::zeros();
    for (k, sample) in samples.iter().enumerate().skip(1) {
        let others = samples.iter().enumerate().filter(|&(l, _)| l != k);
        let product: f64 = others.map(|(_, other)| sample.timestamp - other.timestamp).product();
        sum += part.step(origin, &sample.world_from_camera) / product;
    }
    let factorial: f64 = (1..samples.len()).map(|k| k as f64).product();
    sum * factorial
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::so3;

    use super::*;

    #[test]
    fn a_cubic_has_its_jerk_everywhere_even_at_uneven_times() {
        let samples: Vec<Sample> = [0.0f64, 0.1, 0.15, 0.3, 0.38, 0.5, 0.61]
            .iter()
            .map(|&t| {
                let rotation = so3::exp(&(Vector3::y() * (2.0 * t * t * t + t)));
                let translation = Vector3::new(t * t - 4.0 * t * t * t, t, 0.0);
                Sample { timestamp: t, world_from_camera: RigidTransform::new(rotation, translation) }
            })
            .collect();
        for (part, jerk) in [(Part::Translation, 24.0), (Part::Rotation, 12.0)] {
            for found in typical_derivatives(&samples, part, 3) {
                assert!((found * MEDIAN_NORM_3 - jerk).abs() < 1e-9, "{found}");
            }
        }
        assert_eq!(typical_derivatives(&samples[..3], Part::Translation, 3), [0.0; 3]);
    }
}
