//! Linear light to stored colour bytes: gain, noise, response, rounding.

use glam::Vec3;
use mba_io::dataset::Vignetting;
use mba_tracker::photometric::InverseResponse;
use rayon::prelude::*;

use super::random::{Purpose, RowRandom};
use super::{NoiseModel, ResponseCurve};

/// How a camera turns light into bytes.
pub(super) struct Developer<'a> {
    /// Factor on the light: gain, and exposure time in units of the usual one.
    pub(super) gain: f64,
    pub(super) vignetting: Vignetting,
    pub(super) noise: Option<NoiseModel>,
    pub(super) response: &'a ResponseCurve,
    pub(super) seed: u64,
}

impl Developer<'_> {
    /// RGB bytes of an image whose rows are `width` pixels long; `frame` selects the noise.
    pub(super) fn develop(&self, radiance: &[Vec3], width: usize, frame: usize) -> Vec<u8> {
        let mut bytes = vec![0; 3 * radiance.len()];
        let height = radiance.len() / width;
        let rows = bytes.par_chunks_mut(3 * width).zip(radiance.par_chunks(width));
        rows.enumerate().for_each(|(row, (bytes, radiance))| {
            let mut random = RowRandom::new(self.seed, Purpose::Colour, frame, row);
            for (column, (pixel, light)) in bytes.chunks_exact_mut(3).zip(radiance).enumerate() {
                let at = (column as f64, row as f64);
                let falloff = self.vignetting.falloff_at(width, height, at.0, at.1) as f32;
                let light = self.exposed(*light * self.gain as f32 * falloff, &mut random);
                pixel.copy_from_slice(&light.to_array().map(|light| self.response.encode(light)));
            }
        });
        bytes
    }

    /// Adds shot and read noise. Shot noise is normal with the variance of the Poisson distribution; the
    /// difference would show below some ten electrons only, where read noise dominates.
    fn exposed(&self, light: Vec3, random: &mut RowRandom) -> Vec3 {
        let Some(NoiseModel { full_well, read_noise }) = self.noise else { return light };
        let (full_well, read_variance) = (full_well as f32, (read_noise * read_noise) as f32);
        let electrons = light.min(Vec3::splat(4.0)) * full_well;
        let [a, b] = random.normal_pair();
        let [c, _] = random.normal_pair();
        let spread = (electrons + read_variance).to_array().map(f32::sqrt);
        (electrons + Vec3::from(spread) * Vec3::new(a, b, c)) / full_well
    }
}

impl ResponseCurve {
    /// The byte for linear light, where 1 is full scale; light beyond is clipped.
    #[must_use]
    pub fn encode(&self, light: f32) -> u8 {
        (255.0 * self.value(light)).round() as u8
    }

    /// What is stored for linear light before it is rounded to a byte, both from 0 to 1; light beyond is clipped.
    #[must_use]
    pub fn value(&self, light: f32) -> f32 {
        let light = light.clamp(0.0, 1.0);
        match self {
            Self::Linear => light,
            Self::Srgb if light <= 0.003_130_8 => 12.92 * light,
            Self::Srgb => 1.055 * light.powf(1.0 / 2.4) - 0.055,
            Self::Measured(inverse) => measured_value(inverse, light),
        }
    }
}

/// The value whose light this is: straight lines between the lights of the 256 codes.
fn measured_value(inverse: &InverseResponse, light: f32) -> f32 {
    // The last code below the light; the lights of the codes increase.
    let mut below = 0_u8;
    for bit in (0..8).rev() {
        let candidate = below | 1 << bit;
        if inverse.linear_light(candidate) < light {
            below = candidate;
        }
    }
    let Some(above) = below.checked_add(1) else { return 1.0 };
    let [from, to] = [below, above].map(|code| inverse.linear_light(code));
    (f32::from(below) + ((light - from) / (to - from)).clamp(0.0, 1.0)) / 255.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_bytes_are_those_of_the_standard() {
        // By hand: 0.18 is 117.64, 0.5 is 187.52 of 255, 0.0031308 is the end of the straight part.
        let cases = [
            (0.0, 0),
            (0.003_130_8, 10),
            (0.215_861, 128),
            (0.18, 118),
            (0.5, 188),
            (1.0, 255),
            (7.0, 255),
            (-1.0, 0),
        ];
        for (light, byte) in cases {
            assert_eq!(ResponseCurve::Srgb.encode(light), byte, "light {light}");
        }
        let inverse = InverseResponse::srgb();
        for byte in 0..=255 {
            assert_eq!(ResponseCurve::Srgb.encode(inverse.linear_light(byte)), byte);
            assert_eq!(ResponseCurve::Linear.encode(f32::from(byte) / 255.0), byte);
        }
    }

    #[test]
    fn measured_bytes_have_the_light_of_their_table() {
        let table = std::array::from_fn(|code| 0.01 + (code as f32 / 255.0).powf(1.8));
        let inverse = InverseResponse::from_table(&table).unwrap();
        let response = ResponseCurve::Measured(Box::new(inverse.clone()));
        for code in 0..=255 {
            let light = inverse.linear_light(code);
            assert_eq!(response.encode(light), code);
            assert!((response.value(light) - f32::from(code) / 255.0).abs() < 1e-6);
        }
        // A third of the way in light from code 100 to 101.
        let [from, to] = [100, 101].map(|code| inverse.linear_light(code));
        let value = response.value(from + (to - from) / 3.0);
        assert!((value - (100.0 + 1.0 / 3.0) / 255.0).abs() < 1e-6, "{value}");
        let ends = [0.0, inverse.linear_light(0) / 2.0, 1.0, 9.0].map(|light| response.encode(light));
        assert_eq!(ends, [0, 0, 255, 255]);
    }

    #[test]
    fn light_falls_off_before_noise_and_response() {
        let developer = Developer {
            gain: 1.5,
            vignetting: Vignetting { a2: -0.5, a4: 0.1 },
            noise: None,
            response: &ResponseCurve::Linear,
            seed: 4,
        };
        let bytes = developer.develop(&[Vec3::splat(0.4); 21], 7, 0);
        // 255 * 0.6 in the middle, times 0.6 in the corner; the middle of the left edge is at r^2 = 9 / 10.
        let edge = 1.0 - 0.45 + 0.081;
        assert_eq!([bytes[3 * 10], bytes[0], bytes[3 * 7]], [153, 92, (153.0 * edge) as u8 + 1]);
    }

    #[test]
    fn noise_has_the_variance_of_its_electrons() {
        let noise = NoiseModel { full_well: 900.0, read_noise: 12.0 };
        let developer = Developer {
            gain: 2.0,
            vignetting: Vignetting::NONE,
            noise: Some(noise),
            response: &ResponseCurve::Linear,
            seed: 4,
        };
        for light in [0.1_f32, 0.3] {
            let bytes = developer.develop(&[Vec3::splat(light); 20_000], 200, 0);
            let mean = bytes.iter().map(|byte| f64::from(*byte)).sum::<f64>() / bytes.len() as f64;
            let variance =
                bytes.iter().map(|byte| (f64::from(*byte) - mean).powi(2)).sum::<f64>() / bytes.len() as f64;
            let electrons = 2.0 * f64::from(light) * 900.0;
            // Rounding to bytes adds 1/12.
            let expected = (electrons + 144.0) * (255.0_f64 / 900.0).powi(2) + 1.0 / 12.0;
            // Standard errors over 60 000 values: 0.6 % of the variance, 0.03 of the mean.
            assert!((variance / expected - 1.0).abs() < 0.025, "{variance}, expected {expected}");
            assert!((mean - electrons * 255.0 / 900.0).abs() < 0.12, "{mean}");
        }
    }
}
