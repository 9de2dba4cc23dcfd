//! The colour sensor: photons to electrons to 8-bit values.

use glam::Vec3;
use mba_tracker::math::{powf, sqrt};
use rayon::prelude::*;

use super::config::{OutputResponse, SensorNoise};
use super::noise::{Purpose, normal, stream};

/// Turns light into bytes by comparing with the light at which a byte rounds up to the next one.
pub(super) struct Encoder {
    thresholds: [f32; 255],
}

impl Encoder {
    pub(super) fn new(response: OutputResponse) -> Self {
        let linear_light = |encoded: f64| match response {
            OutputResponse::Linear => encoded,
            OutputResponse::Srgb if encoded <= 0.04045 => encoded / 12.92,
            OutputResponse::Srgb => powf((encoded + 0.055) / 1.055, 2.4),
        };
        Self { thresholds: std::array::from_fn(|code| linear_light((code as f64 + 0.5) / 255.0) as f32) }
    }

    /// The byte of linear light; saturates outside `[0, 1]`.
    pub(super) fn encode(&self, light: f32) -> u8 {
        self.thresholds.partition_point(|threshold| *threshold <= light) as u8
    }
}

/// Gain, noise and quantisation of a whole image: interleaved RGB bytes.
pub(super) fn expose(
    light: &[Vec3],
    width: usize,
    gain: f32,
    noise: Option<(SensorNoise, u64, usize)>,
    encoder: &Encoder,
) -> Vec<u8> {
    let mut bytes = vec![0; light.len() * 3];
    bytes.par_chunks_mut(3 * width).zip(light.par_chunks(width)).enumerate().for_each(
        |(row, (out, light))| {
            let mut random = noise.map(|(_, seed, frame)| stream(seed, Purpose::Colour, frame, row));
            for (out, light) in out.chunks_exact_mut(3).zip(light) {
                for (byte, value) in out.iter_mut().zip((*light * gain).to_array()) {
                    let value = match (noise, &mut random) {
                        (Some((noise, ..)), Some(random)) => measured(value, noise, normal(random)),
                        _ => value,
                    };
                    *byte = encoder.encode(value);
                }
            }
        },
    );
    bytes
}

/// Light as a sensor measures it, given a standard normal number. Photon counts are taken as normal with their own
/// mean as variance, which is within the quantisation down to a few dozen electrons.
fn measured(light: f32, noise: SensorNoise, normal: f64) -> f32 {
    let electrons = f64::from(light.max(0.0)) * noise.full_well_electrons;
    let variance = electrons + noise.read_noise_electrons * noise.read_noise_electrons;
    ((electrons + sqrt(variance) * normal) / noise.full_well_electrons) as f32
}

#[cfg(test)]
mod tests {
    use mba_tracker::photometric::InverseResponse;

    use super::*;

    #[test]
    fn encoding_inverts_the_tracker_s_response_table() {
        for (response, table) in [
            (OutputResponse::Srgb, InverseResponse::srgb()),
            (OutputResponse::Linear, InverseResponse::linear()),
        ] {
            let encoder = Encoder::new(response);
            for byte in 0..=255 {
                assert_eq!(encoder.encode(table.linear_light(byte)), byte);
            }
        }
    }

    #[test]
    fn srgb_has_its_published_values() {
        let encoder = Encoder::new(OutputResponse::Srgb);
        // 18 % grey is 117.6 of 255 (IEC 61966-2-1: 1.055 * 0.18^(1/2.4) - 0.055 = 0.4614).
        assert_eq!(encoder.encode(0.18), 118);
        assert_eq!(encoder.encode(0.002), (0.002_f32 * 12.92 * 255.0).round() as u8);
        assert_eq!((encoder.encode(-0.1), encoder.encode(1.7)), (0, 255));
    }

    #[test]
    fn noise_has_the_variance_of_electrons() {
        let noise = SensorNoise { full_well_electrons: 400.0, read_noise_electrons: 6.0 };
        let encoder = Encoder::new(OutputResponse::Linear);
        for light in [0.25_f32, 0.5] {
            let bytes = expose(&vec![Vec3::splat(light); 20_000], 200, 1.0, Some((noise, 7, 3)), &encoder);
            let values: Vec<f64> = bytes.iter().map(|byte| f64::from(*byte) / 255.0).collect();
            let n = values.len() as f64;
            let mean = values.iter().sum::<f64>() / n;
            let variance = values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n - 1.0);
            let expected = (f64::from(light) * 400.0 + 36.0) / (400.0 * 400.0) + 1.0 / (12.0 * 255.0 * 255.0);
            assert!((mean - f64::from(light)).abs() < 1e-3, "{mean}");
            // Standard error of the variance: sqrt(2/60000) = 0.6 %.
            assert!((variance / expected - 1.0).abs() < 0.025, "{variance} {expected}");
        }
    }
}
