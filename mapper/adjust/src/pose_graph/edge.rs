//! One measured motion: its disagreement with two poses, and the derivatives of that.

use mba_tracker::geometry::{RigidTransform, so3};
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

/// A measured motion between two nodes of a graph.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseGraphEdge {
    /// Index of the node that the motion starts from.
    pub from: usize,
    /// Index of the node that it leads to.
    pub to: usize,
    /// The measurement: pose of `to` in the camera frame of `from`.
    pub from_from_to: RigidTransform,
    /// Standard deviation of its translation along each axis, metres, above 0.
    pub translation_sigma: f64,
    /// Standard deviation of its rotation about each axis, radians, above 0.
    pub rotation_sigma: f64,
    /// Whether it may be a mistake, as a recognised place may be, and can be rejected.
    pub robust: bool,
}

/// An edge linearised at two poses, in standard deviations.
#[derive(Clone, Copy, Debug)]
pub(super) struct LinearEdge {
    pub(super) residual: Vector6<f64>,
    /// Derivatives by the tangent vectors of both poses ([`RigidTransform::perturbed`]).
    pub(super) jacobian_from: Matrix6<f64>,
    pub(super) jacobian_to: Matrix6<f64>,
}

impl PoseGraphEdge {
    /// Disagreement of two poses with the measurement, in standard deviations:
    /// `(R_f^T (p_t - p_f) - p) / sigma_t` and `log(R^T R_f^T R_t) / sigma_r`.
    pub(super) fn residual(
        &self,
        world_from_from: &RigidTransform,
        world_from_to: &RigidTransform,
    ) -> Vector6<f64> {
        let between = world_from_from.inverse().compose(world_from_to);
        let difference = self.from_from_to.tangent_to(&between);
        self.whitened(&difference.fixed_rows::<3>(0).into(), &difference.fixed_rows::<3>(3).into())
    }

    /// Squared norm of [`Self::residual`].
    pub(super) fn squared_error(
        &self,
        world_from_from: &RigidTransform,
        world_from_to: &RigidTransform,
    ) -> f64 {
        self.residual(world_from_from, world_from_to).norm_squared()
    }

    pub(super) fn linearised(
        &self,
        world_from_from: &RigidTransform,
        world_from_to: &RigidTransform,
    ) -> LinearEdge {
        let between = world_from_from.inverse().compose(world_from_to);
        let from_from_world = world_from_from.rotation_matrix().transpose();
        let difference = self.from_from_to.tangent_to(&between);
        let turn: Vector3<f64> = difference.fixed_rows::<3>(3).into();
        let jacobian_turn = so3::right_jacobian_inverse(&turn) / self.rotation_sigma;
        let jacobian_shift = from_from_world / self.translation_sigma;
        let (mut jacobian_from, mut jacobian_to) = (Matrix6::zeros(), Matrix6::zeros());
        set_block(&mut jacobian_from, [0, 0], -jacobian_shift);
        // exp(-d) x = x + [x] d to first order.
        set_block(&mut jacobian_from, [0, 3], so3::hat(&between.translation) / self.translation_sigma);
        // Q^T exp(-d) Q = exp(-Q^T d).
        set_block(&mut jacobian_from, [3, 3], -jacobian_turn * between.rotation_matrix().transpose());
        set_block(&mut jacobian_to, [0, 0], jacobian_shift);
        set_block(&mut jacobian_to, [3, 3], jacobian_turn);
        LinearEdge {
            residual: self.whitened(&difference.fixed_rows::<3>(0).into(), &turn),
            jacobian_from,
            jacobian_to,
        }
    }

    fn whitened(&self, shift: &Vector3<f64>, turn: &Vector3<f64>) -> Vector6<f64> {
        let (shift, turn) = (shift / self.translation_sigma, turn / self.rotation_sigma);
        Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
    }
}

fn set_block(matrix: &mut Matrix6<f64>, [row, column]: [usize; 2], block: Matrix3<f64>) {
    matrix.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(numbers: [f64; 6]) -> RigidTransform {
        RigidTransform::identity().perturbed(&Vector6::from(numbers))
    }

    #[test]
    fn derivatives_are_those_of_finite_differences() {
        let edge = PoseGraphEdge {
            from: 0,
            to: 1,
            from_from_to: pose([0.4, -0.2, 0.9, 0.3, -0.8, 0.5]),
            translation_sigma: 0.02,
            rotation_sigma: 0.005,
            robust: false,
        };
        let from = pose([1.0, -2.0, 0.5, -0.4, 1.1, 0.7]);
        let to = pose([1.8, -1.1, 0.2, 0.9, 0.3, -0.6]);
        let linear = edge.linearised(&from, &to);
        assert_eq!(linear.residual, edge.residual(&from, &to));
        const STEP: f64 = 1e-6;
        for k in 0..6 {
            let by = Vector6::from_fn(|row, _| if row == k { STEP } else { 0.0 });
            let central = |plus: Vector6<f64>, minus: Vector6<f64>| (plus - minus) / (2.0 * STEP);
            let jacobian_from =
                central(edge.residual(&from.perturbed(&by), &to), edge.residual(&from.perturbed(&-by), &to));
            let jacobian_to =
                central(edge.residual(&from, &to.perturbed(&by)), edge.residual(&from, &to.perturbed(&-by)));
            // Entries are up to 1/sigma = 200 and more.
            assert!((jacobian_from - linear.jacobian_from.column(k)).norm() < 1e-5, "column {k} by from");
            assert!((jacobian_to - linear.jacobian_to.column(k)).norm() < 1e-5, "column {k} by to");
        }
    }
}
