//! One RGB-D frame and how its two images are decoded.

use std::io::Cursor;
use std::path::Path;
use std::thread;

use image::metadata::Orientation;
use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use super::jpeg_scan::check_scans;
use super::{FrameReadError, MAX_PIXELS};
use crate::FileError;
use crate::whole_file::read_at_most;

/// Bytes of the largest file of an image that is read.
const LARGEST_FILE: u64 = 256 << 20;

/// Colour and depth of one moment, undistorted and of the size of the calibration's camera.
#[derive(Clone, Debug, PartialEq)]
pub struct RgbdFrame {
    /// Index in the data set, from 0.
    pub index: usize,
    /// Mid exposure of the middle of the colour image, seconds.
    pub timestamp: f64,
    /// When depth was measured, seconds on the same clock.
    pub depth_timestamp: f64,
    /// Time the shutter was open, seconds.
    pub exposure_seconds: f64,
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Red, green, blue of each pixel as stored (not linear), row-major, `3 * width * height` values; black
    /// where undistortion finds no source.
    pub rgb: Vec<u8>,
    /// Depth along the optical axis in raw units (`depth_scale` per metre), row-major, `width * height` values;
    /// 0 = missing.
    pub depth: Vec<u16>,
}

impl RgbdFrame {
    /// Whether not a single pixel has a depth. Such a frame can still be used for its colours.
    #[must_use]
    pub fn depth_is_empty(&self) -> bool {
        self.depth.iter().all(|depth| *depth == 0)
    }
}

/// Decodes a colour image of `size` (width, height) into interleaved 8-bit RGB.
pub(super) fn read_colour(path: &Path, size: (usize, usize)) -> Result<Vec<u8>, FrameReadError> {
    Ok(decode(path, size, |_| Ok(()))?.into_rgb8().into_raw())
}

/// Largest raw depth: many cameras write it where they have none.
const SATURATED: u16 = u16::MAX;

/// Decodes a 16-bit depth image of `size` (width, height); saturated values are missing ones.
pub(super) fn read_depth(path: &Path, size: (usize, usize)) -> Result<Vec<u16>, FrameReadError> {
    let check = |colour_type| match colour_type {
        ColorType::L16 => Ok(()),
        other => Err(FrameReadError::DepthFormat { path: path.to_owned(), found: format!("{other:?}") }),
    };
    let mut depth = decode(path, size, check)?.into_luma16().into_raw();
    depth.iter_mut().filter(|depth| **depth == SATURATED).for_each(|depth| *depth = 0);
    Ok(depth)
}

/// Decodes an image of `size` (width, height) into one 8-bit value per pixel.
pub(super) fn read_grey(path: &Path, size: (usize, usize)) -> Result<Vec<u8>, FrameReadError> {
    Ok(decode(path, size, |_| Ok(()))?.into_luma8().into_raw())
}

/// What the header of an image says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ImageHeader {
    /// Columns and rows as stored.
    pub(super) stored: (usize, usize),
    orientation: Orientation,
}

impl ImageHeader {
    fn of(decoder: &mut impl ImageDecoder) -> Self {
        let (width, height) = decoder.dimensions();
        // What cannot be read is taken for not marked.
        let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
        Self { stored: (width as usize, height as usize), orientation }
    }

    /// Whether the image is to be shown otherwise than it is stored.
    pub(super) fn is_turned(&self) -> bool {
        self.orientation != Orientation::NoTransforms
    }

    /// Columns and rows as shown.
    pub(super) fn shown(&self) -> (usize, usize) {
        use Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
        let (width, height) = self.stored;
        match self.orientation {
            Rotate90 | Rotate270 | Rotate90FlipH | Rotate270FlipH => (height, width),
            _ => (width, height),
        }
    }

    /// Whether the image can be read with that size: as it is shown, which is what programs that calibrate see, or else as
    /// it is stored.
    pub(super) fn has_size(&self, size: (usize, usize)) -> bool {
        self.shown() == size || self.stored == size
    }
}

/// The header of an image, if it has one.
pub(super) fn header(path: &Path) -> Option<ImageHeader> {
    // A pipe or device may have no end.
    if !path.is_file() {
        return None;
    }
    let reader = ImageReader::open(path).ok()?.with_guessed_format().ok()?;
    Some(ImageHeader::of(&mut reader.into_decoder().ok()?))
}

/// Decodes an image of any pixel type and of up to 64 million pixels.
///
/// # Errors
///
/// [`FrameReadError`] if it is missing, damaged or too large.
pub fn read_image(path: &Path) -> Result<DynamicImage, FrameReadError> {
    let image = decode_checked(path, |header, _| match header.stored {
        (width, height) if width.saturating_mul(height) > MAX_PIXELS => Err(FrameReadError::TooManyPixels {
            path: path.to_owned(),
            found: header.stored,
            limit: MAX_PIXELS,
        }),
        _ => Ok(()),
    });
    image.map(|(image, _)| image)
}

/// Decodes an image after its size and `check` of its pixel type have been found good.
fn decode(
    path: &Path,
    size: (usize, usize),
    check: impl Fn(ColorType) -> Result<(), FrameReadError>,
) -> Result<DynamicImage, FrameReadError> {
    let (mut image, header) = decode_checked(path, |header, colour_type| {
        if !header.has_size(size) {
            let found = header.stored;
            return Err(FrameReadError::SizeMismatch { path: path.to_owned(), found, expected: size });
        }
        check(colour_type)
    })?;
    if header.is_turned() && header.shown() == size {
        image.apply_orientation(header.orientation);
    }
    Ok(image)
}

/// Decodes an image after `check` has found its size and pixel type good.
fn decode_checked(
    path: &Path,
    check: impl Fn(&ImageHeader, ColorType) -> Result<(), FrameReadError>,
) -> Result<(DynamicImage, ImageHeader), FrameReadError> {
    let damaged = |reason: String| {
        // Some decoders break their messages into lines.
        let reason = reason.split_whitespace().collect::<Vec<_>>().join(" ");
        FrameReadError::Damaged { path: path.to_owned(), reason }
    };
    let bytes = read_at_most(path, LARGEST_FILE).map_err(|error| match error {
        FileError::Unreadable { path, reason } => FrameReadError::Unreadable { path, reason },
        other => other.into(),
    })?;
    let reader = ImageReader::new(Cursor::new(&bytes))
        .with_guessed_format()
        .map_err(|error| damaged(error.to_string()))?;
    let is_jpeg = reader.format() == Some(ImageFormat::Jpeg);
    if is_jpeg && !jpeg_is_complete(&bytes) {
        return Err(damaged("the end marker of the JPEG stream is missing".into()));
    }
    let mut decoder = reader.into_decoder().map_err(|error| damaged(error.to_string()))?;
    let header = ImageHeader::of(&mut decoder);
    check(&header, decoder.color_type())?;
    let decode = || DynamicImage::from_decoder(decoder).map_err(|error| damaged(error.to_string()));
    if !is_jpeg {
        return Ok((decode()?, header));
    }
    // Reading the codes once more takes a third as long as decoding, which does not wait for it.
    thread::scope(|scope| {
        let checked = scope.spawn(|| check_scans(&bytes));
        let image = decode()?;
        let checked = checked.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        checked.map_err(|damage| damaged(damage.to_string()))?;
        Ok((image, header))
    })
}

/// Whether an end-of-image marker follows the last scan: the decoder itself fills what is missing with grey.
///
/// Inside a scan the byte FF is always followed by 00 or a restart marker, so both searches are exact.
fn jpeg_is_complete(bytes: &[u8]) -> bool {
    const START_OF_SCAN: [u8; 2] = [0xFF, 0xDA];
    const END_OF_IMAGE: [u8; 2] = [0xFF, 0xD9];
    let marker = |wanted: [u8; 2]| bytes.windows(2).rposition(|pair| pair == wanted);
    match (marker(START_OF_SCAN), marker(END_OF_IMAGE)) {
        (Some(scan), Some(end)) => scan < end,
        _ => false,
    }
}
