//! Where the worlds of the groups lie in one world.
//!
//! Every keyframe on a border was mapped by two groups or more. Each group is moved as a whole, so that all agree best on
//! these keyframes: a pose graph over the groups whose edges have the information matrices that the groups state.

use mba_tracker::geometry::{RigidTransform, so3};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, Vector3, Vector6};

use crate::Submap;

/// Standard deviation of the world of a group about where the run has it, metres and radians: far above what keyframes on
/// borders say, it holds groups that share none.
const FREEDOM: (f64, f64) = (0.1, 0.05);

/// Linearisations; moves are small, so that few are needed.
const ITERATIONS: usize = 8;

/// A disagreement beyond the typical one by this factor counts half: a place that was taken for another one.
const ODD: f64 = 3.0;

/// A keyframe that two groups have.
#[derive(Clone, Copy, Debug)]
struct Shared {
    groups: [usize; 2],
    world_from_camera: [RigidTransform; 2],
    information: Matrix6<f64>,
}

/// How the worlds of the groups move, and what that is for.
#[derive(Clone, Debug)]
pub(crate) struct Anchors {
    /// `world_from_group_world` by group.
    pub(crate) moves: Vec<RigidTransform>,
    /// Keyframes that two groups have, counted for each pair.
    pub(crate) shared: usize,
    /// Distance between the two positions of such a keyframe, RMS in metres, before and after.
    pub(crate) disagreement: [f64; 2],
}

impl Anchors {
    /// The moves under which the groups agree best; groups without a map stay where they are.
    pub(crate) fn new(submaps: &[Option<Submap>]) -> Self {
        let shared = shared_keyframes(submaps);
        let still = vec![RigidTransform::identity(); submaps.len()];
        let mut moves = still.clone();
        let centres = centres(submaps);
        for _ in 0..ITERATIONS {
            let Some(steps) = steps(&moves, &centres, &shared) else { break };
            moves = moves.iter().zip(&steps).zip(&centres).map(moved).collect();
        }
        let disagreement = [&still, &moves].map(|moves| rms_distance(moves, &shared));
        Self { moves, shared: shared.len(), disagreement }
    }
}

/// A group's move after a step about its centre: a shift, and a turn about the world's axes.
fn moved(((pose, step), centre): ((&RigidTransform, &Vector6<f64>), &Vector3<f64>)) -> RigidTransform {
    let centre = pose.transform_point(centre);
    let turn = so3::exp(&step.fixed_rows::<3>(3).into());
    let shift: Vector3<f64> = step.fixed_rows::<3>(0).into();
    let about_centre = RigidTransform::new(turn, centre + shift - turn * centre);
    let moved = about_centre.compose(pose);
    RigidTransform { rotation: so3::renormalised(&moved.rotation), ..moved }
}

/// All keyframes that two groups have, in the order of the groups.
fn shared_keyframes(submaps: &[Option<Submap>]) -> Vec<Shared> {
    let mut shared = Vec::new();
    for (a, first) in submaps.iter().enumerate() {
        for (b, second) in submaps.iter().enumerate().skip(a + 1) {
            let (Some(first), Some(second)) = (first, second) else { continue };
            for pose in &first.keyframes {
                let Ok(at) = second.keyframes.binary_search_by_key(&pose.frame, |other| other.frame) else {
                    continue;
                };
                let other = &second.keyframes[at];
                shared.push(Shared {
                    groups: [a, b],
                    world_from_camera: [pose.world_from_camera(), other.world_from_camera()],
                    information: of_difference(&pose.information(), &other.information()),
                });
            }
        }
    }
    shared
}

/// Information of the difference of two poses that have these.
fn of_difference(a: &Matrix6<f64>, b: &Matrix6<f64>) -> Matrix6<f64> {
    // The covariances of poses that were found apart add up.
    let covariances = a.try_inverse().zip(b.try_inverse());
    let information = covariances.and_then(|(a, b)| (a + b).try_inverse());
    information.map_or_else(Matrix6::zeros, |information| 0.5 * (information + information.transpose()))
}

/// Mean position of the keyframes of every group.
fn centres(submaps: &[Option<Submap>]) -> Vec<Vector3<f64>> {
    let centre = |submap: &Option<Submap>| {
        let Some(submap) = submap else { return Vector3::zeros() };
        let positions = submap.keyframes.iter().map(|pose| pose.world_from_camera().translation);
        positions.sum::<Vector3<f64>>() / submap.keyframes.len().max(1) as f64
    };
    submaps.iter().map(centre).collect()
}

/// The difference of the two poses of a keyframe in the camera frame of the first one.
fn residual(moves: &[RigidTransform], shared: &Shared) -> (Vector6<f64>, [RigidTransform; 2]) {
    let poses = [0, 1].map(|k| moves[shared.groups[k]].compose(&shared.world_from_camera[k]));
    let between = poses[0].inverse().compose(&poses[1]);
    let turn = so3::log(&between.rotation);
    let mut residual = Vector6::zeros();
    residual.fixed_rows_mut::<3>(0).copy_from(&between.translation);
    residual.fixed_rows_mut::<3>(3).copy_from(&turn);
    (residual, poses)
}

/// A step of every group towards agreement; none if there is no finite one.
fn steps(moves: &[RigidTransform], centres: &[Vector3<f64>], shared: &[Shared]) -> Option<Vec<Vector6<f64>>> {
    let residuals: Vec<_> = shared.iter().map(|shared| residual(moves, shared)).collect();
    let squares: Vec<f64> = residuals
        .iter()
        .zip(shared)
        .map(|((r, _), shared)| (r.transpose() * shared.information * r).x)
        .collect();
    let mut sorted = squares.clone();
    sorted.sort_by(f64::total_cmp);
    // Places that were taken for other ones must not decide: what is odd is so relative to the typical disagreement.
    let typical = sorted.get(sorted.len() / 2).copied().unwrap_or(1.0).max(1e-12);
    let size = 6 * moves.len();
    let (mut matrix, mut descent) = (DMatrix::zeros(size, size), DVector::zeros(size));
    hold(moves, centres, &mut matrix, &mut descent);
    for (((residual, poses), shared), square) in residuals.iter().zip(shared).zip(&squares) {
        let weight = 1.0 / (1.0 + square / (ODD * ODD * typical));
        let information = shared.information * weight;
        // The residual is in the camera of the first of the two poses: the worlds move against each other there.
        let from_world = poses[0].rotation_matrix().transpose();
        let jacobians = [0, 1].map(|k| {
            let centre = moves[shared.groups[k]].transform_point(&centres[shared.groups[k]]);
            let sign = if k == 0 { -1.0 } else { 1.0 };
            sign * jacobian(&from_world, &(poses[k].translation - centre))
        });
        for (a, jacobian_a) in jacobians.iter().enumerate() {
            let row = 6 * shared.groups[a];
            let mut part = descent.fixed_rows_mut::<6>(row);
            // Gauss-Newton: J' W r and J' W J, a block of six for each group.
            part -= jacobian_a.transpose() * information * residual;
            for (b, jacobian_b) in jacobians.iter().enumerate() {
                let mut block = matrix.fixed_view_mut::<6, 6>(row, 6 * shared.groups[b]);
                block += jacobian_a.transpose() * information * jacobian_b;
            }
        }
    }
    // The hold on every group keeps the matrix positive definite, so that none means numbers that are not finite.
    let solution = matrix.cholesky()?.solve(&descent);
    let finite = solution.iter().all(|step| step.is_finite());
    finite.then(|| solution.as_slice().chunks_exact(6).map(Vector6::from_column_slice).collect())
}

/// Change of a residual by a shift of the world of a group and a turn of it, about a point that is `arm` away.
fn jacobian(from_world: &Matrix3<f64>, arm: &Vector3<f64>) -> Matrix6<f64> {
    let mut jacobian = Matrix6::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(from_world);
    jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&(-from_world * so3::hat(arm)));
    jacobian.fixed_view_mut::<3, 3>(3, 3).copy_from(from_world);
    jacobian
}

/// The pull of every group towards where the run has it.
fn hold(
    moves: &[RigidTransform],
    centres: &[Vector3<f64>],
    matrix: &mut DMatrix<f64>,
    descent: &mut DVector<f64>,
) {
    let [shift, turn] = [FREEDOM.0, FREEDOM.1].map(|sigma| 1.0 / (sigma * sigma));
    for (k, pose) in moves.iter().enumerate() {
        let turned = so3::log(&pose.rotation);
        let shifted = pose.transform_point(&centres[k]) - centres[k];
        for axis in 0..3 {
            matrix[(6 * k + axis, 6 * k + axis)] += shift;
            matrix[(6 * k + 3 + axis, 6 * k + 3 + axis)] += turn;
            descent[6 * k + axis] -= shift * shifted[axis];
            descent[6 * k + 3 + axis] -= turn * turned[axis];
        }
    }
}

fn rms_distance(moves: &[RigidTransform], shared: &[Shared]) -> f64 {
    let square = |shared: &Shared| residual(moves, shared).0.fixed_rows::<3>(0).norm_squared();
    let mean = shared.iter().map(square).sum::<f64>() / shared.len().max(1) as f64;
    mean.sqrt()
}

#[cfg(test)]
mod tests {
    use mba_slam::mapping::MappedKeyframe;

    use super::*;

    fn pose(numbers: [f64; 6]) -> RigidTransform {
        RigidTransform::identity().perturbed(&Vector6::from(numbers))
    }

    /// The map of some keyframes of a path, in a world that is displaced by `world_from_group_world`.
    fn submap(frames: std::ops::Range<usize>, world_from_group_world: &RigidTransform) -> Option<Submap> {
        let keyframe = |index: usize| {
            let s = index as f64;
            let true_pose = pose([0.3 * s, (0.4 * s).sin(), 0.1 * s, 0.02 * s, 0.2 * s, 0.0]);
            MappedKeyframe {
                index,
                world_from_camera: world_from_group_world.inverse().compose(&true_pose),
                log_gain: 0.0,
                information: Matrix6::from_diagonal(&Vector6::new(1e6, 1e6, 4e5, 1e7, 1e7, 8e6)),
            }
        };
        Some(Submap::of_keyframes(&frames.map(keyframe).collect::<Vec<_>>()))
    }

    #[test]
    fn worlds_that_were_displaced_come_together_again() {
        let displaced = [
            RigidTransform::identity(),
            pose([0.01, -0.02, 0.015, 0.004, -0.01, 0.006]),
            pose([-0.015, 0.01, 0.0, -0.008, 0.003, 0.01]),
        ];
        let maps =
            [submap(0..10, &displaced[0]), submap(6..18, &displaced[1]), submap(14..24, &displaced[2])];
        let anchors = Anchors::new(&maps);
        assert_eq!(anchors.shared, 8);
        assert!(anchors.disagreement[0] > 0.01 && anchors.disagreement[1] < 1e-4, "{anchors:?}");
        // Relative to the first one, each is moved by what it was displaced by.
        let first = anchors.moves[0].inverse();
        for (moved, displaced) in anchors.moves.iter().zip(&displaced) {
            let difference = displaced.tangent_to(&first.compose(moved));
            assert!(difference.norm() < 2e-4, "{difference}");
        }
        // A group that shares nothing stays, and so does one without a map.
        let alone = Anchors::new(&[submap(0..5, &displaced[0]), submap(40..45, &displaced[1]), None]);
        assert_eq!((alone.shared, alone.moves), (0, vec![RigidTransform::identity(); 3]));
    }
}
