//! Poses as numbers that come back bit for bit.

use mba_tracker::geometry::RigidTransform;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// `tx ty tz qx qy qz qw`.
pub type PoseNumbers = [f64; 7];

/// The numbers of a pose.
pub fn numbers(pose: &RigidTransform) -> PoseNumbers {
    let (t, q) = (pose.translation, pose.rotation.coords);
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
}

/// The pose of such numbers.
pub fn pose([tx, ty, tz, x, y, z, w]: PoseNumbers) -> RigidTransform {
    // Normalising again would change the last bit.
    RigidTransform::new(UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z)), Vector3::new(tx, ty, tz))
}
