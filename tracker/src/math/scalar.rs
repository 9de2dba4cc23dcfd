//! Elementary functions through `libm`, so that every target computes the same bits.

/// Sine of an angle in radians.
#[inline]
#[must_use]
pub fn sin(x: f64) -> f64 {
    libm::sin(x)
}

/// Cosine of an angle in radians.
#[inline]
#[must_use]
pub fn cos(x: f64) -> f64 {
    libm::cos(x)
}

/// Angle in radians of the point `(x, y)`, in `(-pi, pi]`.
#[inline]
#[must_use]
pub fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// Square root.
#[inline]
#[must_use]
pub fn sqrt(x: f64) -> f64 {
    libm::sqrt(x)
}

/// Natural logarithm.
#[inline]
#[must_use]
pub fn ln(x: f64) -> f64 {
    libm::log(x)
}

/// `x` to the power `y`.
#[inline]
#[must_use]
pub fn powf(x: f64, y: f64) -> f64 {
    libm::pow(x, y)
}

/// Square root in single precision.
#[inline]
#[must_use]
pub fn sqrt_f32(x: f32) -> f32 {
    libm::sqrtf(x)
}

/// Largest integer not above `x`, for `|x| < 2^31`.
///
/// Cheaper than a library call where the target has no rounding instruction.
#[inline]
#[must_use]
pub fn floor_to_i32(x: f32) -> i32 {
    let truncated = x as i32;
    truncated - i32::from((truncated as f32) > x)
}

/// The integer nearest to `x`, halves rounded up.
#[inline]
#[must_use]
pub fn round_half_up_to_i32(x: f32) -> i32 {
    floor_to_i32(x + 0.5)
}
