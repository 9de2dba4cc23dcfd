//! Linear light and the display colours that files of Gaussians hold.

/// Value of the spherical harmonic of degree 0, `1/(2 sqrt(pi))`.
const SH_DEGREE_0: f64 = 0.282_094_791_773_878_14;

/// The coefficient of spherical harmonics of degree 0 that shows as the linear channel `linear`.
///
/// Display colours are sRGB (IEC 61966-2-1), continued as an odd function below zero and without a limit above
/// one, so that nothing is lost: a map may hold colours that only make sense together with others.
pub(super) fn coefficient_of(linear: f32) -> f32 {
    let magnitude = f64::from(linear.abs());
    let display =
        if magnitude <= 0.003_130_8 { 12.92 * magnitude } else { 1.055 * magnitude.powf(1.0 / 2.4) - 0.055 };
    coefficient_of_value(display.copysign(f64::from(linear)))
}

/// The coefficient of spherical harmonics of degree 0 that shows as the display value `display`.
pub(super) fn coefficient_of_display(display: f32) -> f32 {
    coefficient_of_value(f64::from(display))
}

fn coefficient_of_value(display: f64) -> f32 {
    ((display - 0.5) / SH_DEGREE_0) as f32
}

/// The inverse of [`coefficient_of`].
pub(super) fn linear_of(coefficient: f32) -> f32 {
    let display = 0.5 + SH_DEGREE_0 * f64::from(coefficient);
    let magnitude = display.abs();
    let linear =
        if magnitude <= 0.040_45 { magnitude / 12.92 } else { ((magnitude + 0.055) / 1.055).powf(2.4) };
    linear.copysign(display) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn middle_grey_is_the_zero_coefficient() {
        // sRGB 0.5 is linear 0.214041.
        assert!(coefficient_of(0.214_041_14).abs() < 1e-6, "{}", coefficient_of(0.214_041_14));
        assert!((linear_of(0.5 / SH_DEGREE_0 as f32) - 1.0).abs() < 1e-6);
        assert!(linear_of(-0.5 / SH_DEGREE_0 as f32).abs() < 1e-6);
    }

    #[test]
    fn colours_return() {
        for linear in [-2.0, -0.3, -0.001, 0.0, 0.002, 0.003_130_8, 0.01, 0.5, 1.0, 3.0] {
            let back = linear_of(coefficient_of(linear));
            assert!((back - linear).abs() <= 1e-6 * linear.abs().max(0.1), "{back} instead of {linear}");
        }
    }
}
