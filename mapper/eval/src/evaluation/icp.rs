//! Refinement of how two surfaces lie on each other.

use mba_tracker::geometry::RigidTransform;
use nalgebra::Vector3;
use rayon::prelude::*;

use super::kd_tree::{KdTree, distance};
use super::{TrajectoryAlignment, align};

/// Points of the estimate that take part.
const POINTS: usize = 50_000;

/// Steps at the most.
const STEPS: usize = 50;

/// A step by less than this (metres, radians) is the last.
const SMALL: f64 = 1e-6;

/// Moves `estimate` onto `reference` by pairing each point with its nearest neighbour within `reach` metres and
/// aligning the pairs, again and again (point-to-point ICP, Besl and McKay 1992).
///
/// Returns `reference_from_estimate`; the identity if fewer than three points have a neighbour. Points of the estimate
/// beyond some ten thousand are left out evenly.
#[must_use]
pub fn refine_by_icp(reference: &[[f32; 3]], estimate: &[[f32; 3]], reach: f64) -> RigidTransform {
    let tree = KdTree::new(reference);
    // Every so many points: a rigid motion is well determined by some thousands.
    let step = estimate.len().div_ceil(POINTS).max(1);
    let points: Vec<Vector3<f64>> =
        estimate.iter().step_by(step).map(|point| Vector3::from(point.map(f64::from))).collect();
    let mut reference_from_estimate = RigidTransform::identity();
    for _ in 0..STEPS {
        let pair = |point: &Vector3<f64>| {
            let moved = reference_from_estimate.transform_point(point);
            // 1. Where the point is by now, and its nearest neighbour within reach.
            let query = [moved.x, moved.y, moved.z].map(|coordinate| coordinate as f32);
            let nearest = tree.nearest(&query).filter(|nearest| distance(&query, nearest) <= reach)?;
            Some((Vector3::from(nearest.map(f64::from)), *point))
        };
        let pairs: Vec<Option<_>> = points.par_iter().map(pair).collect();
        let (targets, sources): (Vec<_>, Vec<_>) = pairs.into_iter().flatten().unzip();
        // 2. The motion that takes all points to their neighbours at once, from where they started.
        let Ok(found) = align(&targets, &sources, TrajectoryAlignment::Se3) else { break };
        let next = RigidTransform { rotation: found.rotation, translation: found.translation };
        let moved = reference_from_estimate.tangent_to(&next).norm();
        reference_from_estimate = next;
        // 3. Neighbours do not change any more once the motion does not.
        if moved < SMALL {
            break;
        }
    }
    reference_from_estimate
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    /// A wavy sheet of points 1 cm apart.
    fn sheet() -> Vec<Vector3<f64>> {
        let point = |k: usize| {
            let (x, y) = (0.01 * (k % 60) as f64, 0.01 * (k / 60) as f64);
            Vector3::new(x, y, 0.1 * (9.0 * x).sin() * (7.0 * y).cos())
        };
        (0..3600).map(point).collect()
    }

    #[test]
    fn a_small_motion_is_undone_and_far_points_do_not_count() {
        let turn = UnitQuaternion::from_euler_angles(0.004, -0.003, 0.005);
        let estimate_from_reference = RigidTransform::new(turn, Vector3::new(0.002, -0.001, 0.0025));
        let to_f32 = |point: &Vector3<f64>| [point.x, point.y, point.z].map(|c| c as f32);
        let reference: Vec<[f32; 3]> = sheet().iter().map(to_f32).collect();
        let moved = |point: &Vector3<f64>| to_f32(&estimate_from_reference.transform_point(point));
        let mut estimate: Vec<[f32; 3]> = sheet().iter().map(moved).collect();
        estimate.extend(reference.iter().take(900).map(|[x, y, z]| [*x, *y, z + 0.5]));
        let found = refine_by_icp(&reference, &estimate, 0.1);
        let error = found.compose(&estimate_from_reference).tangent_to(&RigidTransform::identity()).norm();
        assert!(error < 1e-4, "{error}");
    }

    #[test]
    fn nothing_near_moves_nothing() {
        assert_eq!(refine_by_icp(&[[0.0; 3]; 5], &[[1.0; 3]; 5], 0.1), RigidTransform::identity());
        assert_eq!(refine_by_icp(&[], &[], 0.1), RigidTransform::identity());
    }
}
