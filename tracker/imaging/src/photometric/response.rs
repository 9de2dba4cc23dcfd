//! Inverse camera response as a table.

use crate::math::powf;

/// Inverse response of an 8-bit camera: linear light in `[0, 1]` for every byte value.
///
/// Blur averages light, not bytes, so frames are linearised before anything is averaged.
#[derive(Clone, Debug, PartialEq)]
pub struct InverseResponse {
    table: [f32; 256],
}

impl InverseResponse {
    /// The sRGB transfer function (IEC 61966-2-1).
    #[must_use]
    pub fn srgb() -> Self {
        Self::from_function(|x| if x <= 0.04045 { x / 12.92 } else { powf((x + 0.055) / 1.055, 2.4) })
    }

    /// Bytes proportional to light.
    #[must_use]
    pub fn linear() -> Self {
        Self::from_function(|x| x)
    }

    /// A measured response: linear light for every byte value, in any unit.
    ///
    /// Returns `None` unless the values are finite, non-negative and strictly increasing. They are scaled so that
    /// byte 255 is 1.
    #[must_use]
    pub fn from_table(linear: &[f32; 256]) -> Option<Self> {
        let increasing = linear.windows(2).all(|pair| pair[0] < pair[1]);
        let full = linear[255];
        if !(increasing && linear[0] >= 0.0 && full.is_finite() && full > 0.0) {
            return None;
        }
        Some(Self { table: linear.map(|value| value / full) })
    }

    fn from_function(linear: impl Fn(f64) -> f64) -> Self {
        Self { table: core::array::from_fn(|byte| linear(byte as f64 / 255.0) as f32) }
    }

    /// Linear light of a byte.
    #[inline]
    #[must_use]
    pub fn linear_light(&self, byte: u8) -> f32 {
        self.table[usize::from(byte)]
    }
}

/// Linear luminance of encoded colours: the inverse response with the luminance weights of ITU-R BT.709 folded in.
#[derive(Clone, Debug)]
pub struct LuminanceTable {
    grey: [f32; 256],
    red: [f32; 256],
    green: [f32; 256],
    blue: [f32; 256],
}

impl LuminanceTable {
    /// The tables for a camera response.
    #[must_use]
    pub fn new(response: &InverseResponse) -> Self {
        Self {
            grey: response.table,
            red: response.table.map(|light| 0.2126 * light),
            green: response.table.map(|light| 0.7152 * light),
            blue: response.table.map(|light| 0.0722 * light),
        }
    }

    /// Luminance of a grey byte.
    #[inline]
    #[must_use]
    pub fn grey(&self, byte: u8) -> f32 {
        self.grey[usize::from(byte)]
    }

    /// Luminance of an RGB pixel.
    #[inline]
    #[must_use]
    pub fn rgb(&self, red: u8, green: u8, blue: u8) -> f32 {
        self.red[usize::from(red)] + self.green[usize::from(green)] + self.blue[usize::from(blue)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_is_the_standard_at_known_bytes() {
        let response = InverseResponse::srgb();
        assert_eq!(response.linear_light(0), 0.0);
        assert_eq!(response.linear_light(255), 1.0);
        // IEC 61966-2-1: byte 10 is on the straight part, 10/255/12.92; byte 188 is close to half of the light.
        assert!((response.linear_light(10) - 0.003_035_27).abs() < 1e-8);
        assert!((response.linear_light(188) - 0.502_886_5).abs() < 1e-6);
    }

    #[test]
    fn srgb_encoded_light_comes_back() {
        let response = InverseResponse::srgb();
        for byte in 0..=255u8 {
            let light = f64::from(response.linear_light(byte));
            let encoded =
                if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * powf(light, 1.0 / 2.4) - 0.055 };
            assert!((encoded * 255.0 - f64::from(byte)).abs() < 1e-3, "byte {byte} came back as {encoded}");
        }
    }

    #[test]
    fn tables_are_scaled_to_full_light() {
        let table = core::array::from_fn(|byte| 3.0 + 2.0 * byte as f32);
        let response = InverseResponse::from_table(&table).expect("an increasing table");
        assert_eq!(response.linear_light(255), 1.0);
        assert_eq!(response.linear_light(0), 3.0 / 513.0);
    }

    #[test]
    fn tables_that_are_no_response_are_refused() {
        let good: [f32; 256] = core::array::from_fn(|byte| byte as f32);
        for (byte, value) in [(0, -0.5), (100, 99.0), (100, f32::NAN), (255, f32::INFINITY), (0, f32::NAN)] {
            let mut table = good;
            table[byte] = value;
            assert_eq!(InverseResponse::from_table(&table), None, "{value} at byte {byte}");
        }
    }

    #[test]
    fn luminance_of_grey_is_its_light_and_green_counts_most() {
        let table = LuminanceTable::new(&InverseResponse::srgb());
        for byte in [0, 17, 128, 255] {
            assert!((table.rgb(byte, byte, byte) - table.grey(byte)).abs() < 1e-6);
        }
        assert!((table.rgb(0, 255, 0) - 0.7152).abs() < 1e-6);
        assert!((table.rgb(255, 0, 0) - 0.2126).abs() < 1e-6);
    }
}
