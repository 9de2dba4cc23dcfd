//! Keyframes before and after deblurring, chosen and packed for the report.

use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::codecs::jpeg::JpegEncoder;
use image::imageops::{self, FilterType};
use image::{ImageReader, RgbImage};
use mba_mapper::dataset::Dataset;
use mba_mapper::evaluation::psnr;
use mba_mapper::run::{Run, deblurred_path};

/// Most keyframes in a report.
const MAX_KEYFRAMES: usize = 6;

/// Widths in pixels that pictures are reduced to, the next one when the report would become too large.
const WIDTHS: [u32; 3] = [640, 480, 320];

/// Most characters of all pictures together, so that the report can be sent by mail.
const MAX_CHARACTERS: usize = 2_600_000;

const JPEG_QUALITY: u8 = 85;

/// One keyframe as the report shows it.
#[derive(Clone, Debug)]
pub(super) struct KeyframePictures {
    /// Index of the frame in the data set.
    pub(super) index: usize,
    /// Estimated blur length in pixels.
    pub(super) blur_px: f64,
    /// Width and height of the frame in pixels.
    pub(super) size: (u32, u32),
    /// JPEG of the deblurred image in base64.
    pub(super) deblurred: String,
    /// The same of the captured image, if the data set is there.
    pub(super) captured: Option<String>,
    /// The same of the true sharp image, if the data set has one.
    pub(super) truth: Option<String>,
    /// Peak signal-to-noise ratios in dB of captured and deblurred image against the truth, display values at full
    /// size.
    pub(super) psnr: Option<[f64; 2]>,
}

/// The images of one keyframe at full size.
struct Images {
    index: usize,
    blur_px: f64,
    deblurred: RgbImage,
    captured: Option<RgbImage>,
    truth: Option<RgbImage>,
}

/// Pictures of the most blurred keyframes, spread over the run; none for a run without deblurred images. What cannot
/// be read is left out.
pub(super) fn keyframe_pictures(
    run: &Run,
    dataset: Option<&Dataset>,
) -> anyhow::Result<Vec<KeyframePictures>> {
    let images: Vec<Images> =
        select(&deblurred_keyframes(run)).into_iter().filter_map(|key| read(run, dataset, key)).collect();
    let mut pictures = Vec::new();
    for width in WIDTHS {
        pictures = images.iter().map(|images| pack(images, width)).collect::<anyhow::Result<_>>()?;
        if pictures.iter().map(KeyframePictures::characters).sum::<usize>() <= MAX_CHARACTERS {
            break;
        }
    }
    Ok(pictures)
}

/// (index, blur) of the keyframes whose deblurred image is there.
fn deblurred_keyframes(run: &Run) -> Vec<(usize, f64)> {
    let blurs = run.frames.iter().enumerate().filter(|(_, frame)| frame.keyframe != 0);
    blurs
        .map(|(index, frame)| (index, frame.blur_px))
        .filter(|(index, _)| deblurred_path(&run.folder, *index).is_file())
        .collect()
}

/// The most blurred keyframe of each of several equal parts of the list.
fn select(keyframes: &[(usize, f64)]) -> Vec<(usize, f64)> {
    let part = |k: usize| k * keyframes.len() / MAX_KEYFRAMES;
    let parts = (0..MAX_KEYFRAMES).map(|k| &keyframes[part(k)..part(k + 1)]);
    parts.filter_map(|part| part.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1))).collect()
}

fn read(run: &Run, dataset: Option<&Dataset>, (index, blur_px): (usize, f64)) -> Option<Images> {
    let deblurred = read_image(&deblurred_path(&run.folder, index))?;
    let fits = |image: &RgbImage| image.dimensions() == deblurred.dimensions();
    let captured = dataset.and_then(|dataset| captured(dataset, index)).filter(fits);
    let truth = dataset
        .and_then(|dataset| read_image(&dataset.folder().join("sharp").join(format!("{index:06}.png"))))
        .filter(fits);
    Some(Images { index, blur_px, deblurred, captured, truth })
}

fn captured(dataset: &Dataset, index: usize) -> Option<RgbImage> {
    let frame = dataset.frame(index).ok()?;
    RgbImage::from_raw(frame.width as u32, frame.height as u32, frame.rgb)
}

fn read_image(path: &Path) -> Option<RgbImage> {
    Some(ImageReader::open(path).ok()?.with_guessed_format().ok()?.decode().ok()?.into_rgb8())
}

fn pack(images: &Images, width: u32) -> anyhow::Result<KeyframePictures> {
    let Images { index, blur_px, deblurred, captured, truth } = images;
    let jpeg = |image: &RgbImage| jpeg_base64(image, width);
    let ratio = |image: &RgbImage| psnr(truth.as_ref()?, image).ok();
    Ok(KeyframePictures {
        index: *index,
        blur_px: *blur_px,
        size: deblurred.dimensions(),
        deblurred: jpeg(deblurred)?,
        captured: captured.as_ref().map(jpeg).transpose()?,
        truth: truth.as_ref().map(jpeg).transpose()?,
        psnr: captured.as_ref().and_then(|captured| Some([ratio(captured)?, ratio(deblurred)?])),
    })
}

/// The image, reduced to at most `width` columns, as a JPEG in base64.
fn jpeg_base64(image: &RgbImage, width: u32) -> anyhow::Result<String> {
    let mut jpeg = Vec::new();
    let encoder = JpegEncoder::new_with_quality(&mut jpeg, JPEG_QUALITY);
    if image.width() > width {
        let height = (image.height() * width).div_ceil(image.width());
        imageops::resize(image, width, height, FilterType::Triangle).write_with_encoder(encoder)?;
    } else {
        image.write_with_encoder(encoder)?;
    }
    Ok(STANDARD.encode(jpeg))
}

impl KeyframePictures {
    fn characters(&self) -> usize {
        let optional = [&self.captured, &self.truth];
        self.deblurred.len() + optional.into_iter().flatten().map(String::len).sum::<usize>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_most_blurred_of_every_part_is_chosen() {
        let keyframes: Vec<(usize, f64)> = (0..12).map(|k| (10 * k, [1.0, 2.0, 3.0][k % 3])).collect();
        let indices: Vec<usize> = select(&keyframes).iter().map(|key| key.0).collect();
        assert_eq!(indices, [10, 20, 50, 70, 80, 110]);
        assert_eq!(select(&keyframes[..4]), keyframes[..4]);
        assert!(select(&[]).is_empty());
    }

    #[test]
    fn a_picture_is_reduced_and_keeps_its_shape() {
        let text = jpeg_base64(&RgbImage::from_pixel(1280, 720, image::Rgb([200, 100, 50])), 640).unwrap();
        let jpeg = image::load_from_memory(&STANDARD.decode(text).unwrap()).unwrap().into_rgb8();
        assert_eq!(jpeg.dimensions(), (640, 360));
        let off = jpeg.get_pixel(320, 180).0.iter().zip([200_u8, 100, 50]).map(|(a, b)| a.abs_diff(b));
        assert!(off.max() < Some(5));
    }
}
