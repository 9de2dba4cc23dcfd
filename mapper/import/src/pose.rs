//! Poses as other programs write them.

use mba_tracker::geometry::RigidTransform;
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

/// How far `R R^T` may be from the identity in each element; what is accepted is made a rotation. Poses of 7-Scenes are
/// off by 0.02.
const TOLERANCE: f64 = 5e-2;

/// The pose of a matrix with four columns, row by row, of which at least three rows are there; none if it is no pose, such
/// as one of infinite numbers.
pub(crate) fn from_rows(rows: &[f64]) -> Option<RigidTransform> {
    let &[a, b, c, x, d, e, f, y, g, h, i, z, ..] = rows else { return None };
    let matrix = Matrix3::new(a, b, c, d, e, f, g, h, i);
    let translation = Vector3::new(x, y, z);
    let deviation = (matrix * matrix.transpose() - Matrix3::identity()).amax();
    // Written so that NaN is refused.
    let is_pose = deviation <= TOLERANCE
        && matrix.determinant() > 0.0
        && matrix.iter().chain(translation.iter()).all(|value| value.is_finite());
    is_pose.then(|| {
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&matrix));
        RigidTransform::new(rotation, translation)
    })
}

/// The pose of a translation and a quaternion `x y z w` of about unit length.
pub(crate) fn from_quaternion(translation: [f64; 3], [x, y, z, w]: [f64; 4]) -> Option<RigidTransform> {
    let quaternion = Quaternion::new(w, x, y, z);
    let is_pose =
        (quaternion.norm() - 1.0).abs() <= TOLERANCE && translation.iter().all(|value| value.is_finite());
    is_pose
        .then(|| RigidTransform::new(UnitQuaternion::new_normalize(quaternion), Vector3::from(translation)))
}

/// The pose of a camera with x right, y down, z forward, of one with x right, y up, z backward, as OpenGL, ARKit and
/// nerfstudio have it.
pub(crate) fn from_opengl(pose: &RigidTransform) -> RigidTransform {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    RigidTransform::new(pose.rotation * turn, pose.translation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_of_opengl_looks_along_its_negative_z() {
        let rows = [0.0, -1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 3.0];
        let pose = from_opengl(&from_rows(&rows).unwrap());
        let ahead = pose.transform_point(&Vector3::z());
        assert!((ahead - Vector3::new(1.0, 2.0, 2.0)).norm() < 1e-12, "{ahead}");
        // Its y axis is up, ours down.
        let below = pose.transform_point(&Vector3::y());
        assert!((below - Vector3::new(2.0, 2.0, 3.0)).norm() < 1e-12, "{below}");
    }

    #[test]
    fn what_is_no_pose_is_none() {
        assert!(from_rows(&[f64::NEG_INFINITY; 16]).is_none());
        assert!(from_rows(&[1.0, 0.0, 0.0]).is_none());
        // A reflection.
        assert!(from_rows(&[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0]).is_none());
        assert!(from_quaternion([0.0; 3], [0.0, 0.0, 0.5, 0.5]).is_none());
    }
}
