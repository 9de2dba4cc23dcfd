//! Letters of 5x7 dots: the finest detail of the scenes.

use glam::{Vec2, Vec3};

use super::Spot;
use crate::synth::noise::{cell, hash2, random2};

/// Rows from the top, leftmost dot in bit 4; A to Z.
#[rustfmt::skip]
const LETTERS: [[u8; 7]; 26] = [
    [0b01110, 0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0b10001],
    [0b11110, 0b10001, 0b11110, 0b10001, 0b10001, 0b10001, 0b11110],
    [0b01110, 0b10001, 0b10000, 0b10000, 0b10000, 0b10001, 0b01110],
    [0b11110, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b11110],
    [0b11111, 0b10000, 0b11110, 0b10000, 0b10000, 0b10000, 0b11111],
    [0b11111, 0b10000, 0b11110, 0b10000, 0b10000, 0b10000, 0b10000],
    [0b01110, 0b10001, 0b10000, 0b10111, 0b10001, 0b10001, 0b01110],
    [0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0b10001, 0b10001],
    [0b01110, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
    [0b00111, 0b00010, 0b00010, 0b00010, 0b00010, 0b10010, 0b01100],
    [0b10001, 0b10010, 0b11100, 0b10010, 0b10010, 0b10001, 0b10001],
    [0b10000, 0b10000, 0b10000, 0b10000, 0b10000, 0b10000, 0b11111],
    [0b10001, 0b11011, 0b10101, 0b10101, 0b10001, 0b10001, 0b10001],
    [0b10001, 0b11001, 0b10101, 0b10011, 0b10001, 0b10001, 0b10001],
    [0b01110, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01110],
    [0b11110, 0b10001, 0b10001, 0b11110, 0b10000, 0b10000, 0b10000],
    [0b01110, 0b10001, 0b10001, 0b10001, 0b10101, 0b10010, 0b01101],
    [0b11110, 0b10001, 0b10001, 0b11110, 0b10100, 0b10010, 0b10001],
    [0b01111, 0b10000, 0b10000, 0b01110, 0b00001, 0b00001, 0b11110],
    [0b11111, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100],
    [0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01110],
    [0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01010, 0b00100],
    [0b10001, 0b10001, 0b10001, 0b10101, 0b10101, 0b11011, 0b10001],
    [0b10001, 0b10001, 0b01010, 0b00100, 0b01010, 0b10001, 0b10001],
    [0b10001, 0b10001, 0b01010, 0b00100, 0b00100, 0b00100, 0b00100],
    [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b10000, 0b11111],
];

/// Dots from one letter to the next, and from one line to the next.
const ADVANCE: f32 = 6.0;
const LINE: f32 = 10.0;

/// Whether a dot (x to the right, y down, in dots) of a letter is set; anything but a letter is blank.
fn dot(letter: u8, x: f32, y: f32) -> bool {
    let index = usize::from(letter.wrapping_sub(b'A'));
    let inside = (0.0..5.0).contains(&x) && (0.0..7.0).contains(&y);
    inside && LETTERS.get(index).is_some_and(|rows| rows[y as usize] >> (4 - x as u32) & 1 == 1)
}

/// Whether a position (metres from the top left corner of the text) lies on a letter of `text`, set with dots of
/// size `dot_size`.
pub(super) fn is_ink(text: &str, at: Vec2, dot_size: f32) -> bool {
    let dots = at / dot_size;
    if dots.x < 0.0 {
        return false;
    }
    let index = (dots.x / ADVANCE) as usize;
    text.as_bytes().get(index).is_some_and(|letter| dot(*letter, dots.x - ADVANCE * index as f32, dots.y))
}

/// Width of a line of text.
pub(super) fn width(text: &str, dot_size: f32) -> f32 {
    (text.len() as f32 * ADVANCE - 1.0) * dot_size
}

/// Whether a position lies on a letter of made-up words that fill the plane.
pub(super) fn is_body_text(at: Vec2, dot_size: f32, seed: u32) -> bool {
    let dots = at / dot_size;
    let (row, y) = cell(dots.y / LINE);
    let (column, x) = cell(dots.x / ADVANCE);
    let blank = hash2(column, row, seed).is_multiple_of(5) || hash2(0, row, seed).is_multiple_of(7);
    let letter = b'A' + (hash2(column, row, seed ^ 0x77) % 26) as u8;
    !blank && dot(letter, x * ADVANCE, y * LINE - 1.0)
}

/// A printed page: margins, a headline and paragraphs.
pub(super) fn page(spot: &Spot, dot_size: f32, paper: Vec3, ink: Vec3, seed: u32) -> Vec3 {
    let margin = 0.07 * spot.size.min_element();
    let inside = spot.uv - margin;
    let end = spot.size - 2.0 * margin;
    let on_page = inside.min_element() > 0.0 && (end - inside).min_element() > 0.0;
    let headline = LINE * dot_size * 2.5;
    let printed = if !on_page {
        false
    } else if inside.y < headline {
        let title = TITLES[seed as usize % TITLES.len()];
        let size = (end.x / width(title, 1.0)).min(2.0 * dot_size);
        is_ink(title, inside, size)
    } else {
        // The last line of a paragraph is short.
        let (row, _) = cell((inside.y - headline) / (LINE * dot_size));
        let length = if row % 6 == 5 { 0.2 + 0.6 * random2(row, 0, seed) } else { 1.0 };
        inside.x < length * end.x && is_body_text(inside - Vec2::Y * headline, dot_size, seed)
    };
    if printed { ink } else { paper }
}

/// Headlines and signs.
pub(super) const TITLES: [&str; 12] = [
    "MOTION",
    "SHUTTER",
    "EXPOSURE",
    "HALF A SECOND",
    "PARALLAX",
    "KEYFRAME",
    "BUNDLE",
    "STEREO LIFE",
    "DEPTH OF FIELD",
    "ODOMETRY",
    "PHOTON",
    "QUATERNION",
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_drawn_the_right_way_round() {
        // The foot of an L reaches to the right, its head does not.
        let ink = |x: f32, y: f32| is_ink("IL", Vec2::new(6.0 + x, y) * 0.01, 0.01);
        assert!(ink(0.5, 0.5) && ink(0.5, 6.5) && ink(4.5, 6.5) && !ink(4.5, 0.5));
        assert!(!ink(5.5, 6.5) && !ink(0.5, 7.5));
    }
}
