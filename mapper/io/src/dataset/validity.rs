//! Values that make sense: cameras, rotations, and the error of one that does not.

use std::fmt::Display;

use mba_tracker::geometry::PinholeCamera;
use nalgebra::{Matrix3, Rotation3};

/// A value outside its valid range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key} is {value}, expected {expected}")]
pub struct InvalidValue {
    /// What has the value.
    pub key: &'static str,
    /// The value.
    pub value: String,
    /// What it should be.
    pub expected: &'static str,
}

/// Largest plausible focal length in image widths: narrower than 0.6 degrees of view.
const MAX_FOCAL_IN_WIDTHS: f64 = 100.0;

/// Largest plausible image side in pixels, so that absurd sizes do not ask for absurd memory.
const MAX_SIDE: usize = 16_384;

/// Most pixels of an image: eight times those of the largest depth cameras.
pub(crate) const MAX_PIXELS: usize = 64_000_000;

/// What the nine numbers of a rotation must be.
pub(super) const ROTATION: &str =
    "the 9 numbers of a rotation, row by row, columns orthogonal and of length 1";

/// Largest element of `R R^T - I` of a rotation that is kept as it is.
const ROUNDING: f64 = 1e-12;

/// Whether the matrix is finite, orthonormal to rounding and right-handed.
pub(super) fn is_rotation(rotation: &Rotation3<f64>) -> bool {
    let matrix = rotation.matrix();
    let deviation = matrix * matrix.transpose() - Matrix3::identity();
    // Written so that NaN is refused.
    deviation.iter().all(|element| element.abs() <= ROUNDING) && matrix.determinant() > 0.0
}

/// The rotation of nine numbers, row by row, that may be rounded to two decimals; none if they are no rotation.
pub(super) fn rotation_of(rows: &[f64; 9]) -> Option<Rotation3<f64>> {
    let exact = Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(rows));
    if is_rotation(&exact) {
        return Some(exact);
    }
    let matrix = exact.matrix();
    let deviation = matrix * matrix.transpose() - Matrix3::identity();
    let is_near = deviation.iter().all(|element| element.abs() <= 0.02) && matrix.determinant() > 0.0;
    if !is_near {
        return None;
    }
    // The nearest rotation: the singular values, all near 1, become 1.
    let parts = matrix.svd(true, true);
    Some(Rotation3::from_matrix_unchecked(parts.u? * parts.v_t?))
}

/// Checks size, focal lengths and principal point.
pub fn check_camera(camera: &PinholeCamera) -> Result<(), InvalidValue> {
    for (key, side) in [("width", camera.width), ("height", camera.height)] {
        if side == 0 || side > MAX_SIDE {
            return Err(invalid(key, side, "a size from 1 to 16384 pixels"));
        }
    }
    if camera.width * camera.height > MAX_PIXELS {
        return Err(invalid("width", camera.width, "a size of at most 64 million pixels"));
    }
    let (width, height) = (camera.width as f64, camera.height as f64);
    for (key, focal) in [("fx", camera.fx), ("fy", camera.fy)] {
        if !(focal > 1.0 && focal <= MAX_FOCAL_IN_WIDTHS * width) {
            return Err(invalid(
                key,
                focal,
                "a focal length in pixels, above 1 and at most 100 image widths",
            ));
        }
    }
    for (key, centre, side) in [("cx", camera.cx, width), ("cy", camera.cy, height)] {
        if !(centre >= -side && centre <= 2.0 * side) {
            return Err(invalid(key, centre, "a principal point in pixels, in or near the image"));
        }
    }
    Ok(())
}

/// Checks that `value` is finite and above zero.
pub fn check_positive(key: &'static str, value: f64, expected: &'static str) -> Result<(), InvalidValue> {
    if value.is_finite() && value > 0.0 { Ok(()) } else { Err(invalid(key, value, expected)) }
}

/// The error of a value.
pub(super) fn invalid(key: &'static str, value: impl Display, expected: &'static str) -> InvalidValue {
    let mut value = value.to_string();
    // Numbers of hundreds of digits are read best with an exponent.
    if value.len() > LONGEST_VALUE
        && let Ok(number) = value.parse::<f64>()
    {
        value = format!("{number:e}");
    }
    InvalidValue { key, value, expected }
}

/// Characters of a number that is shown digit by digit.
const LONGEST_VALUE: usize = 24;
