//! Poses written as 4x4 matrices, row by row.

use std::path::Path;

use mba_tracker::geometry::RigidTransform;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::FileError;

/// How far `R R^T` may be from the identity in each element; what is accepted is made a rotation.
const ROTATION_TOLERANCE: f64 = 1e-2;

/// The pose with the given rows; `path` and `line` (of the first row) only serve the message.
pub(crate) fn pose_from_rows(
    rows: &[f64; 16],
    path: &Path,
    line: usize,
) -> Result<RigidTransform, FileError> {
    let m = rows;
    let matrix = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    let deviation = if matrix.determinant() > 0.0 {
        (matrix * matrix.transpose() - Matrix3::identity()).amax()
    } else {
        f64::INFINITY
    };
    if deviation > ROTATION_TOLERANCE {
        return Err(FileError::NotRotation { path: path.to_owned(), line, deviation });
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&matrix));
    Ok(RigidTransform::new(rotation, Vector3::new(m[3], m[7], m[11])))
}
