//! Pictures next to one another as PNG files, for those who want to show them elsewhere than in the report.

use image::codecs::png::{CompressionType, FilterType as RowFilter, PngEncoder};
use image::imageops::{self, FilterType};
use image::{ExtendedColorType, ImageEncoder, Rgb, RgbImage};

use super::lettering::label;
use super::motion_lines::draw;
use super::pictures::Images;

/// Width in pixels that a pane is reduced to.
const PANE_WIDTH: u32 = 400;
/// Width from which a detail is not magnified further.
const DETAIL_WIDTH: u32 = 320;
/// Pixels between panes.
const GAP: u32 = 6;
/// Bytes of a PNG before its second chunk: the signature and the header.
const HEADER_BYTES: usize = 33;
/// The chunk that files of this program have after the header, without length and checksum.
const MARK: &[u8] = b"tEXtSoftware\0mba";

/// A picture and the name of its file.
#[derive(Clone, Debug)]
pub(super) struct Picture {
    /// File name without extension.
    pub(super) name: String,
    /// PNG file.
    pub(super) png: Vec<u8>,
}

/// Captured, deblurred and true image of keyframe `number` of those that are shown, and the same of its detail; nothing
/// when the captured image is not there. The estimated motion is drawn into the captured one.
///
/// # Errors
/// When a picture cannot be encoded.
pub(super) fn keyframe(number: usize, images: &Images) -> anyhow::Result<Vec<Picture>> {
    let Some(captured) = &images.captured else { return Ok(Vec::new()) };
    let likeness = images.likeness();
    let gain = likeness.map(|[before, after]| format!(", {:+.1} dB", after - before));
    let labels = [
        format!("captured, blur {:.0} px", images.blur_px),
        format!("mba{}", gain.unwrap_or_default()),
        "truth".to_owned(),
    ];
    let sources = [Some(captured), Some(&images.deblurred), images.truth.as_ref()];
    let panes = |change: &dyn Fn(&RgbImage) -> RgbImage| -> Vec<(String, RgbImage)> {
        let pairs = labels.iter().zip(sources);
        pairs.filter_map(|(label, image)| Some((label.clone(), change(image?)))).collect()
    };
    let mut whole = panes(&|image| reduce(image));
    if let Some((_, pane)) = whole.first_mut() {
        draw(pane, &images.lines, f64::from(captured.width()) / f64::from(pane.width()));
    }
    let detail = panes(&|image| magnify(&images.detail_of(image)));
    Ok(vec![
        Picture { name: format!("keyframe_{number}"), png: join(whole)? },
        Picture { name: format!("detail_{number}"), png: join(detail)? },
    ])
}

/// Views of a map with the frames that they are taken from.
///
/// # Errors
/// When the picture cannot be encoded.
pub(super) fn views(views: &[(usize, RgbImage)]) -> anyhow::Result<Option<Picture>> {
    if views.is_empty() {
        return Ok(None);
    }
    let panes = views.iter().map(|(index, view)| (format!("map, frame {index}"), reduce(view))).collect();
    Ok(Some(Picture { name: "map".to_owned(), png: join(panes)? }))
}

/// Whether a file that begins with `start` is a picture of this program.
#[must_use]
pub(super) fn is_own_picture(start: &[u8]) -> bool {
    start.get(HEADER_BYTES + 4..).is_some_and(|chunk| chunk.starts_with(MARK))
}

fn reduce(image: &RgbImage) -> RgbImage {
    if image.width() <= PANE_WIDTH {
        return image.clone();
    }
    let height = (image.height() * PANE_WIDTH).div_ceil(image.width());
    imageops::resize(image, PANE_WIDTH, height, FilterType::Triangle)
}

/// A whole number of times as large, so that every pixel can be seen.
fn magnify(image: &RgbImage) -> RgbImage {
    let factor = (DETAIL_WIDTH / image.width().max(1)).max(1);
    imageops::resize(image, factor * image.width(), factor * image.height(), FilterType::Nearest)
}

/// The panes with their labels from left to right, as a PNG.
fn join(mut panes: Vec<(String, RgbImage)>) -> anyhow::Result<Vec<u8>> {
    panes.iter_mut().for_each(|(text, pane)| label(pane, text));
    let width = panes.iter().map(|(_, pane)| pane.width() + GAP).sum::<u32>().saturating_sub(GAP);
    let height = panes.iter().map(|(_, pane)| pane.height()).max().unwrap_or(0);
    let mut whole = RgbImage::from_pixel(width, height, Rgb([255; 3]));
    let mut left = 0;
    for (_, pane) in &panes {
        imageops::replace(&mut whole, pane, i64::from(left), 0);
        left += pane.width() + GAP;
    }
    encode(&whole)
}

fn encode(image: &RgbImage) -> anyhow::Result<Vec<u8>> {
    let mut png = Vec::new();
    PngEncoder::new_with_quality(&mut png, CompressionType::Best, RowFilter::Adaptive).write_image(
        image.as_raw(),
        image.width(),
        image.height(),
        ExtendedColorType::Rgb8,
    )?;
    let length = (MARK.len() - 4) as u32;
    let mark = [&length.to_be_bytes()[..], MARK, &crc32fast::hash(MARK).to_be_bytes()].concat();
    png.splice(HEADER_BYTES..HEADER_BYTES, mark);
    Ok(png)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panes_stand_side_by_side_in_a_file_that_is_recognised() {
        let pane = |grey: u8| (String::new(), RgbImage::from_pixel(40, 30, Rgb([grey; 3])));
        let png = join(vec![pane(50), pane(90)]).unwrap();
        assert!(is_own_picture(&png));
        let image = image::load_from_memory(&png).unwrap().into_rgb8();
        assert_eq!(image.dimensions(), (86, 30));
        assert_eq!([39, 42, 46].map(|x| image.get_pixel(x, 29).0[0]), [50, 255, 90]);
    }

    #[test]
    fn pictures_of_others_are_not_recognised() {
        let mut png = Vec::new();
        let (pixels, colour) = ([7; 27], ExtendedColorType::Rgb8);
        PngEncoder::new(&mut png).write_image(&pixels, 3, 3, colour).unwrap();
        assert!(!is_own_picture(&png) && !is_own_picture(b"a letter") && !is_own_picture(b""));
    }

    #[test]
    fn small_details_are_magnified_and_large_images_reduced() {
        assert_eq!(magnify(&RgbImage::new(160, 120)).dimensions(), (320, 240));
        assert_eq!(magnify(&RgbImage::new(400, 1)).dimensions(), (400, 1));
        assert_eq!(reduce(&RgbImage::new(640, 480)).dimensions(), (400, 300));
        assert_eq!(reduce(&RgbImage::new(80, 60)).dimensions(), (80, 60));
    }
}
