//! Exponential map, logarithm and Jacobians of SO(3) without special cases.
//!
//! Rotation vectors are in radians. The helper functions are even and smooth, so no formula here needs a
//! branch at zero rotation; the branches inside the helpers only choose a numerically stable evaluation.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use crate::math::{atan2, cos, sin, sqrt};

/// `sin(x)/x`, continued by 1 at zero.
#[must_use]
pub fn sinc(x: f64) -> f64 {
    let xx = x * x;
    if xx < 1e-6 { 1.0 - xx / 6.0 * (1.0 - xx / 20.0 * (1.0 - xx / 42.0)) } else { sin(x) / x }
}

/// `(1 - sinc(x))/x^2`, continued by 1/6 at zero.
#[must_use]
pub fn sinc_deficit(x: f64) -> f64 {
    let xx = x * x;
    if xx < 0.25 {
        // Terms (-1)^k x^(2k)/(2k+3)!; the first one left out is below 4e-17 at |x| = 1/2.
        const COEFFICIENTS: [f64; 7] = [
            1.0 / 6.0,
            -1.0 / 120.0,
            1.0 / 5_040.0,
            -1.0 / 362_880.0,
            1.0 / 39_916_800.0,
            -1.0 / 6_227_020_800.0,
            1.0 / 1_307_674_368_000.0,
        ];
        COEFFICIENTS.iter().rev().fold(0.0, |sum, c| sum * xx + c)
    } else {
        (1.0 - sinc(x)) / xx
    }
}

/// `(1 - cos(x))/x^2`, continued by 1/2 at zero.
#[must_use]
pub fn cosine_deficit(x: f64) -> f64 {
    let half = sinc(0.5 * x);
    0.5 * half * half
}

/// The matrix `[a]x` with `[a]x b = a x b`.
#[must_use]
#[inline]
pub fn hat(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

/// Rotation of angle `|r|` about `r`, as a unit quaternion.
#[must_use]
pub fn exp(r: &Vector3<f64>) -> UnitQuaternion<f64> {
    let half_angle = 0.5 * r.norm();
    let v = r * (0.5 * sinc(half_angle));
    UnitQuaternion::new_unchecked(Quaternion::new(cos(half_angle), v.x, v.y, v.z))
}

/// Rotation of angle `|r|` about `r`, as a matrix.
#[must_use]
pub fn exp_matrix(r: &Vector3<f64>) -> Matrix3<f64> {
    let angle = r.norm();
    let w = hat(r);
    Matrix3::identity() + w * sinc(angle) + w * w * cosine_deficit(angle)
}

/// The shortest rotation vector of `q`, length at most pi. Scale invariant: `q` may have drifted from unit
/// length.
#[must_use]
pub fn log(q: &UnitQuaternion<f64>) -> Vector3<f64> {
    let (v, w) = if q.w < 0.0 { (-q.imag(), -q.w) } else { (q.imag(), q.w) };
    let n = v.norm();
    // The quotient is accurate down to denormals; only an exact underflow needs the limit 2/w.
    if n < 1e-150 { v * 2.0 } else { v * (2.0 * atan2(n, w) / n) }
}

/// Right Jacobian: `exp(r + d) = exp(r) exp(J d)` to first order.
#[must_use]
pub fn right_jacobian(r: &Vector3<f64>) -> Matrix3<f64> {
    let angle = r.norm();
    let w = hat(r);
    Matrix3::identity() - w * cosine_deficit(angle) + w * w * sinc_deficit(angle)
}

/// Inverse of [`right_jacobian`]: `log(exp(r) exp(d)) = r + J d` to first order, for `|r| < 2 pi`.
#[must_use]
pub fn right_jacobian_inverse(r: &Vector3<f64>) -> Matrix3<f64> {
    let half_angle = 0.5 * r.norm();
    let e = (cosine_deficit(half_angle) - sinc_deficit(half_angle)) / (4.0 * sinc(half_angle));
    let w = hat(r);
    Matrix3::identity() + w * 0.5 + w * w * e
}

/// The same rotation scaled back to unit length after many products.
#[must_use]
pub fn renormalised(q: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let raw = q.into_inner();
    let norm = sqrt(raw.norm_squared());
    UnitQuaternion::new_unchecked(raw / norm)
}
