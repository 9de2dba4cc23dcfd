//! The part of a picture in which blur shows best.

use image::RgbImage;

/// Part of an image, pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Part {
    pub(super) left: u32,
    pub(super) top: u32,
    pub(super) width: u32,
    pub(super) height: u32,
}

/// Columns and rows of places that are tried along one side.
const PLACES: u32 = 13;

/// The quarter by quarter of the image with the strongest contrast between neighbouring pixels.
pub(super) fn most_textured(image: &RgbImage) -> Part {
    let (width, height) = ((image.width() / 4).max(1), (image.height() / 4).max(1));
    let place = |k: u32, size: u32, part: u32| k * (size - part) / (PLACES - 1);
    let all = (0..PLACES).flat_map(|y| (0..PLACES).map(move |x| (x, y)));
    let parts = all.map(|(x, y)| Part {
        left: place(x, image.width(), width),
        top: place(y, image.height(), height),
        width,
        height,
    });
    parts.max_by_key(|part| contrast(image, part)).unwrap_or(Part { left: 0, top: 0, width, height })
}

/// The part as an image of its own.
pub(super) fn cut(image: &RgbImage, part: &Part) -> RgbImage {
    image::imageops::crop_imm(image, part.left, part.top, part.width, part.height).to_image()
}

/// Sum of the differences of green, which carries most of the luminance, between neighbours.
fn contrast(image: &RgbImage, part: &Part) -> u64 {
    let green = |x: u32, y: u32| image.get_pixel(x, y).0[1];
    let rows = part.top..part.top + part.height - 1;
    let pixels = rows.flat_map(|y| (part.left..part.left + part.width - 1).map(move |x| (x, y)));
    let at =
        |(x, y)| green(x, y).abs_diff(green(x + 1, y)) as u64 + green(x, y).abs_diff(green(x, y + 1)) as u64;
    pixels.map(at).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chessboard_is_found() {
        let chess =
            |x: u32, y: u32| (48..64).contains(&x) && (20..32).contains(&y) && (x + y).is_multiple_of(2);
        let image = RgbImage::from_fn(64, 48, |x, y| image::Rgb([if chess(x, y) { 200 } else { 40 }; 3]));
        let part = most_textured(&image);
        assert_eq!((part.left, part.width, part.height), (48, 16, 12));
        assert!(part.top.abs_diff(20) <= 1, "{part:?}");
        assert_eq!(cut(&image, &part).dimensions(), (16, 12));
    }

    #[test]
    fn the_smallest_image_has_a_part() {
        assert_eq!(most_textured(&RgbImage::new(1, 1)), Part { left: 0, top: 0, width: 1, height: 1 });
    }
}
