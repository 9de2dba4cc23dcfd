//! The camera's response as a smooth-enough function: from linear light to display values, with its slope.

use mba_tracker::photometric::InverseResponse;

/// Segments of the curve.
const SEGMENTS: usize = 1024;

/// Display values, the stored bytes over 255, as a function of linear light; piecewise linear.
///
/// Knots are dense near black, where a display curve is steep: knot k is at light `(k/1024)^2`. Beyond `[0, 1]` the
/// curve goes on straight, so that light which is out of range has a gradient that leads back.
#[derive(Clone, Debug, PartialEq)]
pub struct DisplayCurve {
    /// Display value and slope at the start of every segment.
    segments: Vec<[f32; 2]>,
}

impl DisplayCurve {
    /// The inverse of a table, linear between its entries.
    #[must_use]
    pub fn new(inverse: &InverseResponse) -> Self {
        let light_of_knot = |k: usize| (k as f64 / SEGMENTS as f64).powi(2);
        let display: Vec<f64> = (0..=SEGMENTS).map(|k| display_of_light(inverse, light_of_knot(k))).collect();
        let segment = |k: usize| {
            let run = light_of_knot(k + 1) - light_of_knot(k);
            [display[k] as f32, ((display[k + 1] - display[k]) / run) as f32]
        };
        Self { segments: (0..SEGMENTS).map(segment).collect() }
    }

    /// Display value of light, and the slope of the curve there.
    #[inline]
    #[must_use]
    pub fn at(&self, light: f32) -> [f32; 2] {
        // NaN becomes segment 0, numbers beyond the table its last.
        let k = ((light.max(0.0).sqrt() * SEGMENTS as f32) as usize).min(SEGMENTS - 1);
        let [value, slope] = self.segments[k];
        let knot = (k as f32 * (1.0 / SEGMENTS as f32)).powi(2);
        [value + (light - knot) * slope, slope]
    }
}

/// Display value in `[0, 1]` whose light is `light`.
fn display_of_light(inverse: &InverseResponse, light: f64) -> f64 {
    let of_byte = |byte: u8| f64::from(inverse.linear_light(byte));
    let above = (0..=u8::MAX).find(|&byte| of_byte(byte) >= light).unwrap_or(u8::MAX);
    let Some(below) = above.checked_sub(1) else { return 0.0 };
    let fraction = ((light - of_byte(below)) / (of_byte(above) - of_byte(below))).min(1.0);
    (f64::from(below) + fraction) / 255.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_back_and_light_out_of_range_leads_back() {
        for inverse in [InverseResponse::srgb(), InverseResponse::linear()] {
            let curve = DisplayCurve::new(&inverse);
            for byte in 0..=255_u8 {
                let [value, slope] = curve.at(inverse.linear_light(byte));
                assert!((value * 255.0 - f32::from(byte)).abs() < 0.06, "byte {byte} came back as {value}");
                assert!(slope > 0.0);
            }
            assert!(curve.at(-0.1)[0] < 0.0 && curve.at(1.5)[0] > 1.0);
        }
    }

    #[test]
    fn the_slope_is_that_of_the_curve() {
        let curve = DisplayCurve::new(&InverseResponse::srgb());
        // d/dx 1.055 x^(1/2.4) at 0.25.
        let expected = 1.055 / 2.4 * 0.25_f64.powf(1.0 / 2.4 - 1.0);
        assert!((f64::from(curve.at(0.25)[1]) - expected).abs() < 0.02 * expected);
    }
}
