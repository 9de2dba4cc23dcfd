//! Light that falls off towards the corners of the image.

/// The share of light that reaches the sensor at distance `r` from the middle of the image:
/// `1 + a2 r^2 + a4 r^4`, where `r` is 1 at the centre of a corner pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vignetting {
    /// Coefficient of the squared distance.
    pub a2: f64,
    /// Coefficient of its square.
    pub a4: f64,
}

impl Vignetting {
    /// The same light everywhere.
    pub const NONE: Self = Self { a2: 0.0, a4: 0.0 };

    /// Whether the light is the same everywhere.
    #[must_use]
    #[inline]
    pub fn is_none(&self) -> bool {
        *self == Self::NONE
    }

    /// Share of the light at a squared distance from the middle, 1 in the corner.
    #[must_use]
    #[inline]
    pub fn falloff(&self, radius_squared: f64) -> f64 {
        1.0 + radius_squared * (self.a2 + radius_squared * self.a4)
    }

    /// Share of the light at pixel `(u, v)` of an image of this size; pixel centres are at whole numbers.
    #[must_use]
    #[inline]
    pub fn falloff_at(&self, width: usize, height: usize, u: f64, v: f64) -> f64 {
        self.falloff(radius_squared(width, height, u, v))
    }

    /// Least share of the light anywhere in the image; no number if a coefficient is none.
    #[must_use]
    pub fn least(&self) -> f64 {
        if !(self.a2.is_finite() && self.a4.is_finite()) {
            return f64::NAN;
        }
        let ends = self.falloff(0.0).min(self.falloff(1.0));
        let turn = -self.a2 / (2.0 * self.a4);
        if (0.0..=1.0).contains(&turn) { ends.min(self.falloff(turn)) } else { ends }
    }

    /// Gives row `v` of an image of `row.len()` times `height` pixels of linear light what the lens took.
    pub(crate) fn restore_row(&self, row: &mut [f32], v: usize, height: usize) {
        let (width, a2, a4) = (row.len(), self.a2 as f32, self.a4 as f32);
        let centre = 0.5 * (width as f32 - 1.0);
        let down = radius_squared(width, height, f64::from(centre), v as f64) as f32;
        // Squared distances along the row are counted from its middle, in half diagonals.
        let across =
            radius_squared(width, height, 0.0, 0.5 * (height as f64 - 1.0)) as f32 / (centre * centre);
        for (u, light) in row.iter_mut().enumerate() {
            let offset = u as f32 - centre;
            let squared = down + across * offset * offset;
            *light /= 1.0 + squared * (a2 + squared * a4);
        }
    }
}

/// Squared distance of pixel `(u, v)` from the middle of an image, 1 at the centre of a corner pixel.
#[must_use]
#[inline]
pub fn radius_squared(width: usize, height: usize, u: f64, v: f64) -> f64 {
    let (centre_u, centre_v) = (0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0));
    let corner = centre_u * centre_u + centre_v * centre_v;
    let (across, down) = (u - centre_u, v - centre_v);
    // An image of one pixel has no corners.
    if corner > 0.0 { (across * across + down * down) / corner } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corner_pixels_are_at_radius_one_and_the_middle_has_all_light() {
        let lens = Vignetting { a2: -0.35, a4: 0.05 };
        for (u, v) in [(0.0, 0.0), (639.0, 0.0), (0.0, 479.0), (639.0, 479.0)] {
            assert!((lens.falloff_at(640, 480, u, v) - 0.7).abs() < 1e-12);
        }
        assert_eq!(lens.falloff_at(640, 480, 319.5, 239.5), 1.0);
        // The middle of the left edge: r^2 = 319.5^2 / (319.5^2 + 239.5^2) = 0.64024.
        let expected = 1.0 - 0.35 * 0.640_240 + 0.05 * 0.409_907;
        assert!((lens.falloff_at(640, 480, 0.0, 239.5) - expected).abs() < 1e-6);
        assert_eq!(lens.falloff_at(1, 1, 0.0, 0.0), 1.0);
    }

    #[test]
    fn least_light_may_lie_between_middle_and_corner() {
        // 1 - 2 s + s^2 is zero at s = 1; 1 - 3 s + 2 s^2 is -1/8 at s = 3/4.
        assert_eq!(Vignetting { a2: -2.0, a4: 1.0 }.least(), 0.0);
        assert_eq!(Vignetting { a2: -3.0, a4: 2.0 }.least(), -0.125);
        assert_eq!(Vignetting { a2: -0.5, a4: 0.1 }.least(), 0.6);
        assert_eq!(Vignetting { a2: 0.5, a4: 0.1 }.least(), 1.0);
        assert_eq!(Vignetting::NONE.least(), 1.0);
        assert!(Vignetting { a2: f64::NAN, a4: 0.0 }.least().is_nan());
    }

    #[test]
    fn a_restored_row_has_the_light_that_came_in() {
        let lens = Vignetting { a2: -0.35, a4: 0.05 };
        for v in [0, 17, 47] {
            let mut row: [f32; 64] =
                core::array::from_fn(|u| 0.4 * lens.falloff_at(64, 48, u as f64, v as f64) as f32);
            assert!(row[0] < 0.36);
            lens.restore_row(&mut row, v, 48);
            for light in row {
                assert!((light - 0.4).abs() < 1e-6, "{light} in row {v}");
            }
        }
    }
}
