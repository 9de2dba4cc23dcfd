//! Motion prior: the exposure's motion continues that of the exposure before.

use nalgebra::Vector6;

use crate::trajectory::ExposureTrajectory;

/// A Gaussian belief about the motion during an exposure (translation in the keyframe in metres, rotation in
/// radians, from opening to closing).
///
/// Zero motion is a stationary point of the photometric term and its sign is unobservable in a single frame, so
/// the prior also seeds the solver with a direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionPrior {
    /// Expected motion.
    pub expected: Vector6<f64>,
    /// Weight `1/variance` of each component.
    pub information: Vector6<f64>,
    /// Expected bow of the path, see [`crate::trajectory::BowedTrajectory`].
    pub bow: Vector6<f64>,
    /// Weight `1/variance` of each component of the bow.
    pub bow_information: Vector6<f64>,
}

impl MotionPrior {
    /// Difference between the motion of `trajectory` and the expected one.
    #[must_use]
    pub fn residual(&self, trajectory: &ExposureTrajectory) -> Vector6<f64> {
        trajectory.motion() - self.expected
    }

    /// Half the weighted square of the residual.
    #[must_use]
    pub fn cost(&self, trajectory: &ExposureTrajectory) -> f64 {
        let residual = self.residual(trajectory);
        0.5 * residual.component_mul(&residual).dot(&self.information)
    }
}
