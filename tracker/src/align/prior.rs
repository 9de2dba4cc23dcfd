//! Motion prior: the exposure's motion continues that of the exposure before.

use nalgebra::Vector6;

use crate::geometry::RigidTransform;
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
    /// How the belief follows the mid pose; `None` where it does not.
    pub follows: Option<FollowsCentre>,
}

/// The belief about motion and bow comes from the way to the mid pose: if that moves, so does the belief.
///
/// Where rows and depth have other times than the middle, the mid pose is itself found by means of the motion, and a
/// belief that stayed behind would hold both back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FollowsCentre {
    /// The mid pose for which the expected values hold.
    pub keyframe_from_mid: RigidTransform,
    /// Change of the expected motion per change of the mid pose, of translation and rotation.
    pub motion: [f64; 2],
    /// Change of the expected bow per change of the mid pose, of translation and rotation.
    pub bow: [f64; 2],
}

impl MotionPrior {
    /// Differences between motion and bow of a path and the expected ones.
    #[must_use]
    pub fn residuals(&self, trajectory: &ExposureTrajectory, bow: &Vector6<f64>) -> [Vector6<f64>; 2] {
        let mut residuals = [trajectory.motion() - self.expected, bow - self.bow];
        if let Some(follows) = &self.follows {
            let centre = follows.keyframe_from_mid.tangent_to(&trajectory.mid());
            for i in 0..6 {
                residuals[0][i] -= centre[i] * follows.motion[i / 3];
                residuals[1][i] -= centre[i] * follows.bow[i / 3];
            }
        }
        residuals
    }
}
