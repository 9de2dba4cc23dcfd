//! Hashes, value noise and random numbers that give the same bits on every machine and thread count.

use glam::Vec3;
use mba_tracker::math::{cos, floor_to_i32, ln, sqrt};
use rand_core::Rng;
use rand_pcg::Pcg32;

/// A well-mixed 32-bit hash of one word.
#[inline]
pub(super) fn hash(word: u32) -> u32 {
    let mut h = word.wrapping_mul(0x9e37_79b1) ^ 0x85eb_ca6b;
    h = (h ^ (h >> 16)).wrapping_mul(0x21f0_aaad);
    h = (h ^ (h >> 15)).wrapping_mul(0x735a_2d97);
    h ^ (h >> 15)
}

/// Hash of a lattice point; `seed` selects one of many lattices.
#[inline]
pub(super) fn hash2(x: i32, y: i32, seed: u32) -> u32 {
    hash(hash(seed ^ (x as u32).wrapping_mul(0x8da6_b343)) ^ (y as u32).wrapping_mul(0xd816_3841))
}

/// Maps a hash to `[0, 1)`.
#[inline]
pub(super) fn unit(hash: u32) -> f32 {
    (hash >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// A number in `[0, 1)` for a lattice point.
#[inline]
pub(super) fn random2(x: i32, y: i32, seed: u32) -> f32 {
    unit(hash2(x, y, seed))
}

/// Cell of `x` and the position in it, `[0, 1)`.
#[inline]
pub(super) fn cell(x: f32) -> (i32, f32) {
    let i = floor_to_i32(x);
    (i, x - i as f32)
}

/// Smooth step from 0 at `low` to 1 at `high`.
#[inline]
pub(super) fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let s = ((x - low) / (high - low)).clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}

#[inline]
fn lerp(a: f32, b: f32, s: f32) -> f32 {
    a + (b - a) * s
}

/// Value noise in `[0, 1]` with features of size 1.
pub(super) fn noise2(x: f32, y: f32, seed: u32) -> f32 {
    let ((ix, fx), (iy, fy)) = (cell(x), cell(y));
    let (sx, sy) = (smoothstep(0.0, 1.0, fx), smoothstep(0.0, 1.0, fy));
    let corner = |dx: i32, dy: i32| random2(ix.wrapping_add(dx), iy.wrapping_add(dy), seed);
    lerp(lerp(corner(0, 0), corner(1, 0), sx), lerp(corner(0, 1), corner(1, 1), sx), sy)
}

/// Sum of `octaves` value noises, each of half the size and half the amplitude of the one before; in `[0, 1]`.
pub(super) fn fractal2(x: f32, y: f32, octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut total, mut amplitude, mut scale) = (0.0, 0.0, 1.0, 1.0);
    for octave in 0..octaves {
        sum += amplitude * noise2(x * scale, y * scale, seed.wrapping_add(octave.wrapping_mul(0x51ed)));
        total += amplitude;
        amplitude *= 0.5;
        scale *= 2.03;
    }
    sum / total
}

/// Value noise in space, in `[0, 1]`, features of size 1.
pub(super) fn noise3(p: Vec3, seed: u32) -> f32 {
    let (iz, fz) = cell(p.z);
    let layer =
        |dz: i32| noise2(p.x, p.y, hash(seed ^ (iz.wrapping_add(dz) as u32).wrapping_mul(0xcb1a_b31f)));
    lerp(layer(0), layer(1), smoothstep(0.0, 1.0, fz))
}

/// [`fractal2`] in space.
pub(super) fn fractal3(p: Vec3, octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut total, mut amplitude, mut scale) = (0.0, 0.0, 1.0, 1.0);
    for octave in 0..octaves {
        sum += amplitude * noise3(p * scale, seed.wrapping_add(octave.wrapping_mul(0x2f0b)));
        total += amplitude;
        amplitude *= 0.5;
        scale *= 2.03;
    }
    sum / total
}

/// What a random stream is used for: streams of different purposes never share numbers.
#[derive(Clone, Copy)]
pub(super) enum Purpose {
    /// Phases of the hand shake.
    Shake = 1,
    /// Photon and read noise of the colour image.
    Colour = 2,
    /// Disparity noise of the depth sensor.
    Depth = 3,
    /// Drop-outs of the depth sensor.
    DepthLoss = 4,
}

/// The random stream of one row of one frame, so that no result depends on which thread computes what.
pub(super) fn stream(seed: u64, purpose: Purpose, frame: usize, row: usize) -> Pcg32 {
    let state = seed ^ (frame as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    Pcg32::new(state, ((purpose as u64) << 32) | row as u64)
}

/// A uniform number in `(0, 1)`.
pub(super) fn uniform(random: &mut Pcg32) -> f64 {
    (f64::from(random.next_u32()) + 0.5) / 4_294_967_296.0
}

/// A standard normal number (Box and Muller's transform).
pub(super) fn normal(random: &mut Pcg32) -> f64 {
    let radius = sqrt(-2.0 * ln(uniform(random)));
    radius * cos(std::f64::consts::TAU * uniform(random))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_numbers_have_mean_zero_and_variance_one() {
        let mut random = stream(3, Purpose::Colour, 1, 2);
        let samples: Vec<f64> = (0..40_000).map(|_| normal(&mut random)).collect();
        let n = samples.len() as f64;
        let mean = samples.iter().sum::<f64>() / n;
        let variance = samples.iter().map(|x| x * x).sum::<f64>() / n;
        let kurtosis = samples.iter().map(|x| x.powi(4)).sum::<f64>() / n;
        // Four standard errors: 1/200, sqrt(2)/200 and sqrt(96)/200.
        assert!(mean.abs() < 0.02, "{mean}");
        assert!((variance - 1.0).abs() < 0.028, "{variance}");
        assert!((kurtosis - 3.0).abs() < 0.2, "{kurtosis}");
    }

    #[test]
    fn streams_of_neighbouring_rows_frames_and_purposes_differ() {
        let first = |seed, purpose, frame, row| stream(seed, purpose, frame, row).next_u32();
        let reference = first(0, Purpose::Colour, 0, 0);
        for other in [
            first(1, Purpose::Colour, 0, 0),
            first(0, Purpose::Depth, 0, 0),
            first(0, Purpose::Colour, 1, 0),
            first(0, Purpose::Colour, 0, 1),
        ] {
            assert_ne!(reference, other);
        }
    }

    #[test]
    fn value_noise_is_continuous_across_cells() {
        for k in -3..4 {
            let x = k as f32;
            assert!((noise2(x - 1e-4, 0.3, 9) - noise2(x + 1e-4, 0.3, 9)).abs() < 1e-3);
        }
    }
}
