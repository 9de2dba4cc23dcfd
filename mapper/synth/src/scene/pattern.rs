//! Building blocks of procedural textures: hashed lattices, noise, edges.
//!
//! `pixel` is the size in metres of a pixel on the surface. Detail fades out where it would be finer than the
//! pixels, so that textures do not alias.

use std::sync::LazyLock;

use glam::{IVec2, Vec2, Vec3};
use mba_tracker::photometric::InverseResponse;

/// A hash of a lattice point; all 32 bits are usable.
pub(super) fn hash(cell: IVec2, seed: u32) -> u32 {
    let mut x = (cell.x as u32).wrapping_mul(0x8da6_b343)
        ^ (cell.y as u32).wrapping_mul(0xd816_3841)
        ^ seed.wrapping_mul(0xcb1a_b31f);
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// A number in `[0, 1)` for a lattice point.
pub(super) fn random(cell: IVec2, seed: u32) -> f32 {
    (hash(cell, seed) >> 8) as f32 / 16_777_216.0
}

/// Largest integers not above the coordinates, and the remainders in `[0, 1)`.
pub(super) fn split(p: Vec2) -> (IVec2, Vec2) {
    let floor = |x: f32| {
        let towards_zero = x as i32;
        towards_zero - i32::from(x < towards_zero as f32)
    };
    let cell = IVec2::new(floor(p.x), floor(p.y));
    (cell, p - cell.as_vec2())
}

/// Smooth noise in `[-1, 1]` with random values on the integer lattice.
pub(super) fn noise(p: Vec2, seed: u32) -> f32 {
    let (cell, f) = split(p);
    let s = f * f * (3.0 - 2.0 * f);
    let seed = seed.wrapping_mul(0xcb1a_b31f);
    let columns =
        [cell.x as u32, (cell.x as u32).wrapping_add(1)].map(|x| x.wrapping_mul(0x8da6_b343) ^ seed);
    let rows = [cell.y as u32, (cell.y as u32).wrapping_add(1)].map(|y| y.wrapping_mul(0xd816_3841));
    let low = mix(lattice(columns[0] ^ rows[0]), lattice(columns[1] ^ rows[0]), s.x);
    let high = mix(lattice(columns[0] ^ rows[1]), lattice(columns[1] ^ rows[1]), s.x);
    mix(low, high, s.y)
}

fn mix(a: f32, b: f32, share: f32) -> f32 {
    a + (b - a) * share
}

/// A number in `[-1, 1)` from the key of a lattice point: one round less than [`hash`], which noise needs often
/// and can do without.
fn lattice(key: u32) -> f32 {
    let x = (key ^ (key >> 15)).wrapping_mul(0x2c1b_3c6d);
    ((x ^ (x >> 14)) as i32) as f32 / 2_147_483_648.0
}

/// `octaves` layers of noise, the first with cells of size `coarsest` (metres), each next one twice as fine and
/// 0.6 times as strong; in about `[-1.5, 1.5]`.
pub(super) fn layered_noise(p: Vec2, coarsest: f32, octaves: u32, pixel: f32, seed: u32) -> f32 {
    let (mut sum, mut strength, mut cell) = (0.0, 1.0, coarsest);
    for octave in 0..octaves {
        let visible = visibility(cell, pixel);
        if visible <= 0.0 {
            break;
        }
        sum += strength * visible * noise(p / cell, seed.wrapping_add(octave));
        strength *= 0.6;
        cell *= 0.5;
    }
    sum
}

/// 1 for structures of `size` that pixels resolve, 0 for those they cannot, sliding in between.
pub(super) fn visibility(size: f32, pixel: f32) -> f32 {
    (2.0 - 2.0 * pixel / size).clamp(0.0, 1.0)
}

/// 0 below `at`, 1 above, with a ramp as wide as a pixel.
pub(super) fn edge(x: f32, at: f32, pixel: f32) -> f32 {
    ((x - at) / pixel.max(1e-6) + 0.5).clamp(0.0, 1.0)
}

/// 1 within `half` of `centre`, 0 outside, soft over a pixel.
pub(super) fn stripe(x: f32, centre: f32, half: f32, pixel: f32) -> f32 {
    edge(half - (x - centre).abs(), 0.0, pixel)
}

/// Linear light of sRGB bytes.
static LINEAR_LIGHT: LazyLock<[f32; 256]> = LazyLock::new(|| {
    let response = InverseResponse::srgb();
    std::array::from_fn(|byte| response.linear_light(byte as u8))
});

/// A colour given as sRGB bytes `0xRRGGBB`, in linear light.
pub(super) fn colour(rgb: u32) -> Vec3 {
    let channel = |shift: u32| LINEAR_LIGHT[(rgb >> shift) as usize & 0xff];
    Vec3::new(channel(16), channel(8), channel(0))
}

/// Coverage in `[0, 1]` of printed lines of text with letters of height `letter` (metres): 3 x 5 dots per letter,
/// gaps between words, ragged right ends of paragraphs.
pub(super) fn text(p: Vec2, letter: f32, pixel: f32, seed: u32) -> f32 {
    let dot = letter / 5.0;
    // Lines are 1.7 letters apart; a letter is three dots wide, and one more is between letters.
    let (line, in_line) = split(Vec2::new(0.0, -p.y / (1.7 * letter)));
    let (column, in_letter) = split(Vec2::new(p.x / (4.0 * dot), 0.0));
    let letter_cell = IVec2::new(column.x, line.y);
    // One letter in six is a gap, and one of eight stretches of nine letters is the ragged end of a paragraph.
    let word_gap = random(letter_cell, seed ^ 0x51) < 0.17;
    let paragraph_end = random(IVec2::new(column.x / 9, line.y), seed ^ 0x77) < 0.12;
    if word_gap || paragraph_end {
        return 0.0;
    }
    // Five rows of dots, then the space between lines.
    let row = in_line.y * 1.7 * 5.0;
    let dot_column = in_letter.x * 4.0;
    if row >= 5.0 || dot_column >= 3.0 {
        return 0.0;
    }
    // Each letter has fifteen random dots.
    let bit = row as u32 * 3 + dot_column as u32;
    let ink = (hash(letter_cell, seed) >> (bit + 8)) & 1;
    // Dots that are smaller than a pixel are half ink, half paper.
    let sharpness = visibility(1.5 * dot, pixel);
    0.5 + (ink as f32 - 0.5) * sharpness
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_continuous_across_cells_and_zero_on_average() {
        for x in [-3.0_f32, -1.0, 0.0, 2.0, 5.0] {
            let step = noise(Vec2::new(x - 1e-4, 0.3), 5) - noise(Vec2::new(x + 1e-4, 0.3), 5);
            assert!(step.abs() < 1e-3, "jump of {step} at {x}");
        }
        let points = (0..40_000).map(|i| Vec2::new(0.37 * (i % 200) as f32, 0.41 * (i / 200) as f32));
        let mean = points.map(|p| noise(p, 5)).sum::<f32>() / 40_000.0;
        assert!(mean.abs() < 0.03, "{mean}");
    }

    #[test]
    fn detail_below_the_pixels_is_gone() {
        let spread = |pixel: f32| {
            let values = (0..500).map(|i| layered_noise(Vec2::new(0.013 * i as f32, 0.1), 0.02, 3, pixel, 1));
            values.map(f32::abs).fold(0.0, f32::max)
        };
        assert!(spread(0.001) > 0.5);
        assert_eq!(spread(0.02), 0.0);
    }
}
