//! One brightness for all groups.
//!
//! The light of a map and the gains of its keyframes are known up to a common factor. Keyframes on borders have a gain in two
//! maps; the factors of all groups follow by least squares.

use nalgebra::{DMatrix, DVector};

use crate::Submap;

/// Weight of a factor of one, against 1 for every keyframe on a border: it decides for groups that share none, and keeps the
/// mean.
const HOLD: f64 = 1e-3;

/// Logarithm of the factor on the light of every group.
pub(crate) fn log_factors(submaps: &[Option<Submap>]) -> Vec<f64> {
    let count = submaps.len();
    let mut matrix = DMatrix::<f64>::identity(count, count) * HOLD;
    let mut right = DVector::<f64>::zeros(count);
    for (a, first) in submaps.iter().enumerate() {
        for (b, second) in submaps.iter().enumerate().skip(a + 1) {
            let (Some(first), Some(second)) = (first, second) else { continue };
            for pose in &first.keyframes {
                let Ok(at) = second.keyframes.binary_search_by_key(&pose.frame, |other| other.frame) else {
                    continue;
                };
                // Gain times light is the frame: g_a - s_a = g_b - s_b.
                let difference = pose.log_gain - second.keyframes[at].log_gain;
                for (k, sign) in [(a, 1.0), (b, -1.0)] {
                    matrix[(k, k)] += 1.0;
                    right[k] += sign * difference;
                }
                matrix[(a, b)] -= 1.0;
                matrix[(b, a)] -= 1.0;
            }
        }
    }
    let solved = matrix.cholesky().map(|factors| factors.solve(&right));
    solved.map_or_else(|| vec![0.0; count], |factors| factors.iter().copied().collect())
}

#[cfg(test)]
mod tests {
    use mba_slam::mapping::MappedKeyframe;
    use mba_tracker::geometry::RigidTransform;
    use nalgebra::Matrix6;

    use super::*;

    #[test]
    fn factors_make_the_gains_of_borders_equal() {
        let true_gain = |frame: usize| 0.1 * (frame as f64).sin();
        let factors = [0.2, -0.1, -0.1];
        let submap = |frames: std::ops::Range<usize>, factor: f64| {
            let keyframe = |index| MappedKeyframe {
                index,
                world_from_camera: RigidTransform::identity(),
                log_gain: true_gain(index) + factor,
                information: Matrix6::identity(),
            };
            Some(Submap::of_keyframes(&frames.map(keyframe).collect::<Vec<_>>()))
        };
        let maps = [submap(0..10, factors[0]), submap(5..15, factors[1]), submap(12..20, factors[2]), None];
        let found = log_factors(&maps);
        for (found, factor) in found.iter().zip(factors) {
            assert!((found - factor).abs() < 1e-4, "{found} instead of {factor}");
        }
        assert_eq!(found[3], 0.0);
    }
}
