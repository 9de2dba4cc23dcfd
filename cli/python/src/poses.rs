//! Poses between numpy and the rest: 4 x 4 matrices that take points of the camera to the world.

use mba_tracker::geometry::RigidTransform;
use nalgebra::{Matrix3, Matrix4, Rotation3, UnitQuaternion, Vector3};
use numpy::{
    AllowTypeChange, PyArray1, PyArray2, PyArray3, PyArrayLike2, PyArrayMethods, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::errors;

/// A pose as Python hands it over: a matrix of numbers of any type, or lists.
pub(crate) type PoseArgument<'py> = PyArrayLike2<'py, f64, AllowTypeChange>;

/// Largest difference of a product of two columns of a rotation from what it should be: what was rounded to four digits
/// still counts as one.
const ORTHONORMAL: f64 = 1e-3;

/// The elements of a matrix, row by row.
fn row_major(pose: &RigidTransform) -> Vec<f64> {
    let mut matrix = Matrix4::identity();
    matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&pose.rotation_matrix());
    matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&pose.translation);
    matrix.transpose().as_slice().to_vec()
}

/// One pose.
pub(crate) fn matrix(py: Python<'_>, pose: &RigidTransform) -> PyResult<Py<PyArray2<f64>>> {
    Ok(PyArray1::from_vec(py, row_major(pose)).reshape([4, 4])?.unbind())
}

/// Poses, one after the other.
pub(crate) fn matrices<'py>(
    py: Python<'py>,
    poses: impl IntoIterator<Item = RigidTransform>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let values: Vec<f64> = poses.into_iter().flat_map(|pose| row_major(&pose)).collect();
    let count = values.len() / 16;
    PyArray1::from_vec(py, values).reshape([count, 4, 4])
}

/// The pose that a matrix stands for.
///
/// # Errors
/// An `InputError` for what is no rigid motion.
pub(crate) fn pose(py: Python<'_>, name: &str, argument: &PoseArgument<'_>) -> PyResult<RigidTransform> {
    let refuse = |what: String| errors::input(py, format!("{name}: {what}"));
    let (shape, array) = (argument.shape(), argument.as_array());
    if shape != [4, 4] {
        return Err(refuse(format!("a matrix of 4 x 4 is needed, not {} x {}", shape[0], shape[1])));
    }
    let matrix = Matrix4::from_fn(|row, column| array[[row, column]]);
    let rotation: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into_owned();
    let translation: Vector3<f64> = matrix.fixed_view::<3, 1>(0, 3).into_owned();
    let is_rotation = (rotation.transpose() * rotation - Matrix3::identity()).amax() < ORTHONORMAL
        && rotation.determinant() > 0.0;
    let ends_well =
        matrix.row(3).iter().zip([0.0, 0.0, 0.0, 1.0]).all(|(value, end)| (value - end).abs() < 1e-9);
    if !(is_rotation && ends_well && translation.iter().all(|metres| metres.is_finite())) {
        return Err(refuse("a rotation, a translation and the row 0 0 0 1 are needed".to_owned()));
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&rotation));
    Ok(RigidTransform { rotation, translation })
}
