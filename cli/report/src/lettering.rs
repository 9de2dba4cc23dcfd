//! Short labels in pictures, drawn with letters of five by seven pixels.

use image::{Rgb, RgbImage};

/// Width of a letter and of the gap after it, in dots.
const ADVANCE: u32 = 6;
/// Dots above one another in a letter.
const HEIGHT: u32 = 7;
/// Dots between the letters and the edge of the plate behind them.
const BORDER: u32 = 3;
/// Side of a dot in pixels.
const DOT: u32 = 2;

/// Rows of each letter from the top; the lowest five bits from left to right.
const LETTERS: [(char, [u8; 7]); 41] = [
    ('a', [0, 0, 14, 1, 15, 17, 15]),
    ('b', [16, 16, 30, 17, 17, 17, 30]),
    ('c', [0, 0, 14, 16, 16, 17, 14]),
    ('d', [1, 1, 15, 17, 17, 17, 15]),
    ('e', [0, 0, 14, 17, 31, 16, 14]),
    ('f', [6, 9, 8, 28, 8, 8, 8]),
    ('g', [0, 15, 17, 17, 15, 1, 14]),
    ('h', [16, 16, 22, 25, 17, 17, 17]),
    ('i', [4, 0, 12, 4, 4, 4, 14]),
    ('j', [2, 0, 6, 2, 2, 18, 12]),
    ('k', [16, 16, 18, 20, 24, 20, 18]),
    ('l', [12, 4, 4, 4, 4, 4, 14]),
    ('m', [0, 0, 26, 21, 21, 17, 17]),
    ('n', [0, 0, 22, 25, 17, 17, 17]),
    ('o', [0, 0, 14, 17, 17, 17, 14]),
    ('p', [0, 0, 30, 17, 30, 16, 16]),
    ('q', [0, 0, 13, 19, 15, 1, 1]),
    ('r', [0, 0, 22, 25, 16, 16, 16]),
    ('s', [0, 0, 14, 16, 14, 1, 30]),
    ('t', [8, 8, 28, 8, 8, 9, 6]),
    ('u', [0, 0, 17, 17, 17, 19, 13]),
    ('v', [0, 0, 17, 17, 17, 10, 4]),
    ('w', [0, 0, 17, 17, 21, 21, 10]),
    ('x', [0, 0, 17, 10, 4, 10, 17]),
    ('y', [0, 0, 17, 17, 15, 1, 14]),
    ('z', [0, 0, 31, 2, 4, 8, 31]),
    ('B', [30, 17, 17, 30, 17, 17, 30]),
    ('0', [14, 17, 19, 21, 25, 17, 14]),
    ('1', [4, 12, 4, 4, 4, 4, 14]),
    ('2', [14, 17, 1, 2, 4, 8, 31]),
    ('3', [31, 2, 4, 2, 1, 17, 14]),
    ('4', [2, 6, 10, 18, 31, 2, 2]),
    ('5', [31, 16, 30, 1, 1, 17, 14]),
    ('6', [6, 8, 16, 30, 17, 17, 14]),
    ('7', [31, 1, 2, 4, 8, 8, 8]),
    ('8', [14, 17, 17, 14, 17, 17, 14]),
    ('9', [14, 17, 17, 15, 1, 2, 12]),
    ('.', [0, 0, 0, 0, 0, 12, 12]),
    (',', [0, 0, 0, 0, 12, 4, 8]),
    ('-', [0, 0, 0, 31, 0, 0, 0]),
    ('+', [0, 4, 4, 31, 4, 4, 0]),
];

const INK: Rgb<u8> = Rgb([255, 255, 255]);
const PLATE: Rgb<u8> = Rgb([20, 24, 32]);

/// Writes `text` on a dark plate into the top-left corner. What does not fit is cut off, and a letter that is not in
/// the table is a gap.
pub(super) fn label(image: &mut RgbImage, text: &str) {
    let columns = ADVANCE * text.chars().count() as u32 + 2 * BORDER - 1;
    for y in 0..HEIGHT + 2 * BORDER {
        for x in 0..columns {
            dot(image, x, y, PLATE);
        }
    }
    for (k, letter) in text.chars().enumerate() {
        let Some((_, rows)) = LETTERS.iter().find(|(known, _)| *known == letter) else { continue };
        let left = BORDER + ADVANCE * k as u32;
        for (y, row) in rows.iter().enumerate() {
            let inked = (0..5_u32).filter(|x| row >> (4 - x) & 1 == 1);
            inked.for_each(|x| dot(image, left + x, BORDER + y as u32, INK));
        }
    }
}

/// One dot; outside of the image there is none.
fn dot(image: &mut RgbImage, x: u32, y: u32, colour: Rgb<u8>) {
    for (dx, dy) in (0..DOT * DOT).map(|k| (k % DOT, k / DOT)) {
        if let Some(pixel) = image.get_pixel_mut_checked(DOT * x + dx, DOT * y + dy) {
            *pixel = colour;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_is_ink_on_a_plate_and_cut_off_at_the_edge() {
        let mut image = RgbImage::from_pixel(24, 40, Rgb([100; 3]));
        label(&mut image, "l-");
        // The stem of the l: the third of its five columns, after the border.
        assert_eq!(image.get_pixel(DOT * (BORDER + 2), DOT * (BORDER + 3)), &INK);
        assert_eq!(image.get_pixel(DOT * BORDER, DOT * (BORDER + 3)), &PLATE);
        assert_eq!(image.get_pixel(23, DOT * (BORDER + 3)), &INK, "the bar of the - goes on to the edge");
        assert_eq!(image.get_pixel(5, DOT * (HEIGHT + 2 * BORDER)), &Rgb([100; 3]), "below the plate");
    }

    #[test]
    fn every_letter_is_once_in_the_table_and_five_dots_wide() {
        for (k, (letter, rows)) in LETTERS.iter().enumerate() {
            assert!(rows.iter().all(|row| *row < 32), "{letter}");
            assert!(LETTERS[..k].iter().all(|(other, _)| other != letter), "{letter}");
        }
    }
}
