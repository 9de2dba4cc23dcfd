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

/// Largest integer not above `x`; the nearest there is beyond 2^31, and 0 for NaN.
///
/// Cheaper than a library call where the target has no rounding instruction.
#[inline]
#[must_use]
pub fn floor_to_i32(x: f32) -> i32 {
    let truncated = x as i32;
    truncated.saturating_sub(i32::from((truncated as f32) > x))
}

/// The integer nearest to `x`, halves rounded up.
#[inline]
#[must_use]
pub fn round_half_up_to_i32(x: f32) -> i32 {
    floor_to_i32(x + 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floors_are_those_of_the_standard_library_and_stop_at_the_ends() {
        for x in [-2.5, -2.0, -0.1, 0.0, 0.1, 1.0, 1.9, 8_388_607.5, -8_388_607.5] {
            assert_eq!(floor_to_i32(x), x.floor() as i32, "{x}");
        }
        for x in [-3e9, f32::MIN, f32::NEG_INFINITY] {
            assert_eq!((floor_to_i32(x), round_half_up_to_i32(x)), (i32::MIN, i32::MIN), "{x}");
        }
        assert_eq!((floor_to_i32(f32::INFINITY), floor_to_i32(f32::NAN)), (i32::MAX, 0));
    }
}
