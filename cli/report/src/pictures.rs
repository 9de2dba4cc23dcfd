//! Keyframes before and after deblurring, chosen and packed for the report.

use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::RgbImage;
use image::codecs::jpeg::JpegEncoder;
use image::imageops::{self, FilterType};
use mba_mapper::dataset::{self, Dataset};
use mba_mapper::evaluation::psnr;
use mba_mapper::run::{Run, deblurred_path};

use super::detail::{cut, most_textured};
use super::motion_lines::motion_lines;

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
    /// The most textured part of the images, if the data set is there.
    pub(super) detail: Option<Detail>,
}

/// The same part of several images at full size, as JPEG in base64.
#[derive(Clone, Debug)]
pub(super) struct Detail {
    pub(super) captured: String,
    pub(super) deblurred: String,
    pub(super) truth: Option<String>,
}

/// A keyframe that could be shown.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Candidate {
    index: usize,
    blur_px: f64,
    has_truth: bool,
}

/// The images of one keyframe at full size.
pub(super) struct Images {
    pub(super) index: usize,
    pub(super) blur_px: f64,
    pub(super) deblurred: RgbImage,
    pub(super) captured: Option<RgbImage>,
    pub(super) truth: Option<RgbImage>,
    /// Where points of the scene were imaged during the exposure, as estimated, if the captured image is there.
    pub(super) lines: Vec<Vec<[f64; 2]>>,
}

/// The most blurred keyframes, spread over the run; none for a run without deblurred images. What cannot be read is
/// left out.
pub(super) fn keyframe_images(run: &Run, dataset: Option<&Dataset>) -> Vec<Images> {
    select(&candidates(run, dataset)).iter().filter_map(|key| read(run, dataset, key)).collect()
}

/// The images as the report shows them.
///
/// # Errors
/// When a picture cannot be encoded.
pub(super) fn keyframe_pictures(images: &[Images]) -> anyhow::Result<Vec<KeyframePictures>> {
    let mut pictures = Vec::new();
    for width in WIDTHS {
        pictures = images.iter().map(|images| pack(images, width)).collect::<anyhow::Result<_>>()?;
        if pictures.iter().map(KeyframePictures::characters).sum::<usize>() <= MAX_CHARACTERS {
            break;
        }
    }
    Ok(pictures)
}

/// The keyframes whose deblurred image is there.
fn candidates(run: &Run, dataset: Option<&Dataset>) -> Vec<Candidate> {
    let keyframes = run.frames.iter().enumerate().filter(|(_, frame)| frame.keyframe != 0);
    keyframes
        .filter(|(index, _)| deblurred_path(&run.folder, *index).is_file())
        .map(|(index, frame)| {
            let has_truth = dataset.is_some_and(|dataset| truth_path(dataset, index).is_file());
            Candidate { index, blur_px: frame.blur_px, has_truth }
        })
        .collect()
}

/// The most blurred keyframe of each of several equal parts of the list, one with a sharp image if there is one.
fn select(keyframes: &[Candidate]) -> Vec<Candidate> {
    let part = |k: usize| k * keyframes.len() / MAX_KEYFRAMES;
    let parts = (0..MAX_KEYFRAMES).map(|k| &keyframes[part(k)..part(k + 1)]);
    let order =
        |a: &Candidate, b: &Candidate| a.has_truth.cmp(&b.has_truth).then(a.blur_px.total_cmp(&b.blur_px));
    parts.filter_map(|part| part.iter().copied().max_by(order)).collect()
}

/// Where a data set with ground truth keeps the sharp image of frame `index`.
fn truth_path(dataset: &Dataset, index: usize) -> PathBuf {
    dataset.folder().join("sharp").join(format!("{index:06}.png"))
}

fn read(run: &Run, dataset: Option<&Dataset>, candidate: &Candidate) -> Option<Images> {
    let Candidate { index, blur_px, .. } = *candidate;
    let deblurred = read_image(&deblurred_path(&run.folder, index))?;
    let fits = |image: &RgbImage| image.dimensions() == deblurred.dimensions();
    let truth = dataset.and_then(|dataset| read_image(&truth_path(dataset, index))).filter(fits);
    let frame = dataset.and_then(|dataset| Some((dataset.calibration(), dataset.frame(index).ok()?)));
    let (captured, lines) = match frame {
        Some((calibration, frame)) => {
            let line =
                |exposure| motion_lines(&frame, &calibration.camera, calibration.depth_scale, exposure);
            let lines = run.exposures.get(index).map(line).unwrap_or_default();
            (RgbImage::from_raw(frame.width as u32, frame.height as u32, frame.rgb).filter(fits), lines)
        }
        None => (None, Vec::new()),
    };
    Some(Images { index, blur_px, deblurred, captured, truth, lines })
}

fn read_image(path: &Path) -> Option<RgbImage> {
    Some(dataset::read_image(path).ok()?.into_rgb8())
}

fn pack(images: &Images, width: u32) -> anyhow::Result<KeyframePictures> {
    let Images { index, blur_px, deblurred, captured, truth, .. } = images;
    let jpeg = |image: &RgbImage| jpeg_base64(image, width);
    Ok(KeyframePictures {
        index: *index,
        blur_px: *blur_px,
        size: deblurred.dimensions(),
        deblurred: jpeg(deblurred)?,
        captured: captured.as_ref().map(jpeg).transpose()?,
        truth: truth.as_ref().map(jpeg).transpose()?,
        psnr: images.likeness(),
        detail: detail(images)?,
    })
}

fn detail(images: &Images) -> anyhow::Result<Option<Detail>> {
    let Some(captured) = &images.captured else { return Ok(None) };
    let jpeg = |image: &RgbImage| {
        let part = images.detail_of(image);
        jpeg_base64(&part, part.width())
    };
    Ok(Some(Detail {
        captured: jpeg(captured)?,
        deblurred: jpeg(&images.deblurred)?,
        truth: images.truth.as_ref().map(jpeg).transpose()?,
    }))
}

/// The image, reduced to at most `width` columns, as a JPEG in base64.
pub(super) fn jpeg_base64(image: &RgbImage, width: u32) -> anyhow::Result<String> {
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

impl Images {
    /// Peak signal-to-noise ratios in dB of captured and deblurred image against the truth.
    pub(super) fn likeness(&self) -> Option<[f64; 2]> {
        let ratio = |image: &RgbImage| psnr(self.truth.as_ref()?, image).ok();
        Some([ratio(self.captured.as_ref()?)?, ratio(&self.deblurred)?])
    }

    /// The part of `image`, one of these, where the truth or else the deblurred image has most texture.
    pub(super) fn detail_of(&self, image: &RgbImage) -> RgbImage {
        cut(image, &most_textured(self.truth.as_ref().unwrap_or(&self.deblurred)))
    }
}

impl KeyframePictures {
    fn characters(&self) -> usize {
        let detail =
            self.detail.iter().flat_map(|d| [Some(&d.captured), Some(&d.deblurred), d.truth.as_ref()]);
        let whole = [Some(&self.deblurred), self.captured.as_ref(), self.truth.as_ref()];
        whole.into_iter().chain(detail).flatten().map(String::len).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_most_blurred_of_every_part_is_chosen() {
        let candidate =
            |k: usize| Candidate { index: 10 * k, blur_px: [1.0, 2.0, 3.0][k % 3], has_truth: false };
        let mut keyframes: Vec<Candidate> = (0..12).map(candidate).collect();
        let indices =
            |keyframes: &[Candidate]| select(keyframes).iter().map(|key| key.index).collect::<Vec<_>>();
        assert_eq!(indices(&keyframes), [10, 20, 50, 70, 80, 110]);
        assert_eq!(select(&keyframes[..4]), keyframes[..4]);
        assert!(select(&[]).is_empty());
        keyframes[6].has_truth = true;
        assert_eq!(indices(&keyframes), [10, 20, 50, 60, 80, 110], "a keyframe with truth goes first");
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
