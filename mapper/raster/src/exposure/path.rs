//! The camera's path during an exposure, with a bow.

use mba_tracker::geometry::{RigidTransform, so3};
use mba_tracker::trajectory::ExposureTrajectory;
use nalgebra::{SMatrix, Vector6};

use mba_io::trajectory_file::TimedExposure;

/// Number of parameters of a path: tangents of the pose at opening, of that at closing, and the bow.
pub const PATH_PARAMETERS: usize = 18;

/// A path during an exposure: the papers' linear motion between two poses, plus a parabola that is zero at both ends.
///
/// A trembling hand can turn round while the shutter is open. The middle of a straight path is then pixels away from
/// where the camera was at mid exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExposurePath {
    /// `world_from_camera` at opening and closing.
    pub ends: ExposureTrajectory,
    /// Tangent of [`RigidTransform::perturbed`] from the middle of the linear motion to the pose at mid exposure:
    /// translation in the world in metres, rotation in the camera frame in radians.
    pub bow: Vector6<f64>,
}

impl ExposurePath {
    /// The path of linear motion between `ends`.
    #[must_use]
    pub fn linear(ends: ExposureTrajectory) -> Self {
        Self { ends, bow: Vector6::zeros() }
    }

    /// The path of a camera that stays where it is.
    #[must_use]
    pub fn still(world_from_camera: RigidTransform) -> Self {
        Self::linear(ExposureTrajectory::still(world_from_camera))
    }

    /// The path through the three poses of an exposure.
    #[must_use]
    pub fn through(exposure: &TimedExposure) -> Self {
        let ends = ExposureTrajectory { start: exposure.start, end: exposure.end };
        Self { ends, bow: ends.mid().tangent_to(&exposure.mid) }
    }

    /// The three poses of an exposure with this path, at `timestamp` in seconds.
    #[must_use]
    pub fn timed(&self, timestamp: f64) -> TimedExposure {
        TimedExposure { timestamp, start: self.ends.start, mid: self.mid(), end: self.ends.end }
    }

    /// `world_from_camera` at normalised time `s`, 0 at opening to 1 at closing; the motion goes on outside.
    #[must_use]
    pub fn at(&self, s: f64) -> RigidTransform {
        self.ends.at(s).perturbed(&(self.bow * height(s)))
    }

    /// `world_from_camera` at mid exposure.
    #[must_use]
    pub fn mid(&self) -> RigidTransform {
        self.at(0.5)
    }

    /// Derivative of the tangent of the pose at `s` by the parameters of the path: 6 rows, 18 columns for the tangents
    /// at opening and at closing and for the bow.
    #[must_use]
    pub fn pose_jacobian(&self, s: f64) -> SMatrix<f64, 6, PATH_PARAMETERS> {
        let turn = self.bow.fixed_rows::<3>(3) * height(s);
        let back = so3::exp_matrix(&-turn);
        let mut jacobian = SMatrix::<f64, 6, PATH_PARAMETERS>::zeros();
        jacobian.fixed_view_mut::<6, 12>(0, 0).copy_from(&self.ends.pose_jacobian(s));
        let turned = back * jacobian.fixed_view::<3, 12>(3, 0);
        jacobian.fixed_view_mut::<3, 12>(3, 0).copy_from(&turned);
        jacobian.fixed_view_mut::<3, 3>(0, 12).fill_diagonal(height(s));
        let grad_bow = so3::right_jacobian(&turn) * height(s);
        jacobian.fixed_view_mut::<3, 3>(3, 15).copy_from(&grad_bow);
        jacobian
    }

    /// The path after a step of its parameters, in the order of [`Self::pose_jacobian`].
    #[must_use]
    pub fn perturbed(&self, step: &SMatrix<f64, PATH_PARAMETERS, 1>) -> Self {
        let ends = self.ends.perturbed(&step.fixed_rows::<12>(0).into_owned());
        Self { ends, bow: self.bow + step.fixed_rows::<6>(12) }
    }

    /// The path over `factor` times the time around the same middle: through where this one goes at its new opening and
    /// closing. A factor of 1 gives the same path, bit for bit.
    #[must_use]
    pub fn stretched(&self, factor: f64) -> Self {
        if factor == 1.0 {
            return *self;
        }
        let [start, mid, end] = [0.5 - 0.5 * factor, 0.5, 0.5 + 0.5 * factor].map(|s| self.at(s));
        let ends = ExposureTrajectory { start, end };
        Self { ends, bow: ends.mid().tangent_to(&mid) }
    }

    /// The same path in another world.
    #[must_use]
    pub fn seen_from(&self, other_from_world: &RigidTransform) -> Self {
        let mut bow = self.bow;
        let shift = other_from_world.rotation * self.bow.fixed_rows::<3>(0);
        bow.fixed_rows_mut::<3>(0).copy_from(&shift);
        Self { ends: self.ends.seen_from(other_from_world), bow }
    }
}

/// Share of the bow at normalised time `s`: 0 at the ends, 1 in the middle.
fn height(s: f64) -> f64 {
    4.0 * s * (1.0 - s)
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    fn path() -> ExposurePath {
        let pose = |x: f64| {
            let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.2 + 0.1 * x, -0.3, 0.1 * x));
            RigidTransform::new(rotation, Vector3::new(x, 0.5 - 0.2 * x, 2.0))
        };
        let bow = Vector6::new(0.02, -0.01, 0.03, 0.05, -0.04, 0.02);
        ExposurePath { ends: ExposureTrajectory { start: pose(0.0), end: pose(0.3) }, bow }
    }

    #[test]
    fn the_jacobian_is_that_of_finite_differences() {
        let (path, step) = (path(), 1e-6);
        for s in [-0.7, 0.0, 0.2, 0.5, 0.9, 1.4] {
            let jacobian = path.pose_jacobian(s);
            for k in 0..PATH_PARAMETERS {
                let mut tangent = SMatrix::<f64, PATH_PARAMETERS, 1>::zeros();
                tangent[k] = step;
                let [ahead, behind] =
                    [tangent, -tangent].map(|step| path.at(s).tangent_to(&path.perturbed(&step).at(s)));
                let difference = (ahead - behind) / (2.0 * step) - jacobian.column(k);
                assert!(difference.norm() < 1e-8, "column {k} at {s}: {difference}");
            }
        }
    }

    #[test]
    fn three_poses_define_the_path_and_come_back() {
        let exposure = path().timed(4.5);
        let again = ExposurePath::through(&exposure);
        assert!((again.bow - path().bow).norm() < 1e-12);
        assert!(again.mid().tangent_to(&exposure.mid).norm() < 1e-12);
        assert_eq!(again.timed(4.5).start, exposure.start);
    }

    #[test]
    fn a_stretched_path_goes_the_same_way() {
        let long = path().stretched(2.5);
        for s in [-0.7, 0.0, 0.3, 0.5, 1.0, 1.6] {
            let apart = path().at(s).tangent_to(&long.at(0.5 + (s - 0.5) / 2.5)).norm();
            // Rotations of ends and bow do not commute: the two differ by products of angles.
            assert!(apart < 4e-3, "{apart} at {s}");
        }
        assert!(long.mid().tangent_to(&path().mid()).norm() < 1e-12);
        assert!(long.stretched(0.4).mid().tangent_to(&path().mid()).norm() < 1e-12);
        assert_eq!(path().stretched(1.0), path());
    }

    #[test]
    fn another_world_sees_the_same_path() {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(1.0, 0.5, -0.7));
        let other_from_world = RigidTransform::new(rotation, Vector3::new(3.0, -1.0, 0.5));
        let moved = path().seen_from(&other_from_world);
        for s in [0.0, 0.3, 1.0] {
            assert!(moved.at(s).tangent_to(&other_from_world.compose(&path().at(s))).norm() < 1e-12);
        }
    }
}
