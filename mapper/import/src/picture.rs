//! Images on their way into a data set.

use std::fs;
use std::io::{self, Cursor};
use std::path::{Path, PathBuf};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, ImageReader};
use mba_io::FileError;

use crate::ImportError;

/// Most pixels of an image that is decoded or stored.
pub(crate) const MOST_PIXELS: usize = 64_000_000;

/// An image with its file format.
pub(crate) enum Picture {
    /// A file that is copied as it is.
    File(PathBuf),
    /// The bytes of a PNG or JPEG file.
    Encoded(Vec<u8>),
}

/// Width and height of the stored pixels, and what ending a file of this format has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PictureHeader {
    pub(crate) size: (usize, usize),
    pub(crate) ending: &'static str,
}

impl Picture {
    /// What the header says.
    ///
    /// # Errors
    /// [`ImportError::Damaged`], naming `path`, for what is neither PNG nor JPEG.
    pub(crate) fn header(&self, path: &Path) -> Result<PictureHeader, ImportError> {
        let damaged = |error: &dyn std::fmt::Display| ImportError::damaged(path, one_line(error));
        match self {
            Self::File(file) => {
                let metadata = fs::metadata(file).map_err(|reason| ImportError::unreadable(file, reason))?;
                if !metadata.is_file() {
                    return Err(ImportError::damaged(file, "it is no file"));
                }
                let reader =
                    ImageReader::open(file).map_err(|reason| ImportError::unreadable(file, reason))?;
                header(reader).map_err(|error| damaged(&error))
            }
            Self::Encoded(bytes) => {
                header(ImageReader::new(Cursor::new(bytes))).map_err(|error| damaged(&error))
            }
        }
    }

    /// Writes the image to a new file.
    pub(crate) fn write(&self, path: &Path) -> Result<(), ImportError> {
        let written = match self {
            Self::File(file) => fs::copy(file, path).map(drop),
            Self::Encoded(bytes) => fs::write(path, bytes),
        };
        written.map_err(|reason| FileError::Unwritable { path: path.to_owned(), reason }.into())
    }
}

fn header<R: io::BufRead + io::Seek>(reader: ImageReader<R>) -> Result<PictureHeader, image::ImageError> {
    use image::ImageFormat::{Jpeg, Png};
    let reader = reader.with_guessed_format()?;
    let ending = match reader.format() {
        Some(Png) => "png",
        Some(Jpeg) => "jpg",
        _ => return Err(image::ImageError::IoError(io::Error::other("it is neither PNG nor JPEG"))),
    };
    let (width, height) = reader.into_dimensions()?;
    Ok(PictureHeader { size: (width as usize, height as usize), ending })
}

/// A message that may have several lines as one.
pub(crate) fn one_line(error: &dyn std::fmt::Display) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Pixels of 8 bits, red, green, blue each, as PNG.
pub(crate) fn colour_png(size: (usize, usize), rgb: &[u8]) -> io::Result<Vec<u8>> {
    png(size, rgb, 3, ExtendedColorType::Rgb8)
}

/// Pixels of 8 bits, one value each, as PNG.
pub(crate) fn grey_png(size: (usize, usize), grey: &[u8]) -> io::Result<Vec<u8>> {
    png(size, grey, 1, ExtendedColorType::L8)
}

/// Pixels of 16 bits, one value each, as PNG.
pub(crate) fn depth_png(size: (usize, usize), depth: &[u16]) -> io::Result<Vec<u8>> {
    // The encoder takes the machine's own order of bytes.
    let bytes: Vec<u8> = depth.iter().flat_map(|value| value.to_ne_bytes()).collect();
    png(size, &bytes, 2, ExtendedColorType::L16)
}

/// Raw units per metre of depth that comes in metres: 0.2 mm, up to 13 m, as the TUM benchmark has it.
pub(crate) const UNITS_OF_METRES: f64 = 5000.0;

/// Depth in metres as PNG, rounded to [`UNITS_OF_METRES`]; what is not above zero or not finite is missing. Returns also how
/// many pixels are farther than 16 bits reach, and therefore missing.
pub(crate) fn metres_png(
    size: (usize, usize),
    metres: impl Iterator<Item = f32>,
) -> io::Result<(Vec<u8>, usize)> {
    let mut beyond = 0;
    let raw = |metres: f32| {
        let units = (f64::from(metres) * UNITS_OF_METRES).round();
        let is_beyond = units >= f64::from(u16::MAX);
        beyond += usize::from(is_beyond && metres.is_finite());
        // Written so that NaN is missing.
        if units >= 1.0 && !is_beyond { units as u16 } else { 0 }
    };
    let values: Vec<u16> = metres.map(raw).collect();
    Ok((depth_png(size, &values)?, beyond))
}

fn png(
    (width, height): (usize, usize),
    bytes: &[u8],
    bytes_per_pixel: usize,
    colour: ExtendedColorType,
) -> io::Result<Vec<u8>> {
    let expected = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(bytes_per_pixel));
    if expected != Some(bytes.len()) || bytes.is_empty() {
        let reason = format!("{} bytes are no image of {width} x {height} pixels", bytes.len());
        return Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
    }
    let mut file = Vec::with_capacity(bytes.len() / 2);
    // The difference to the pixel above: nearly as small as with a choice per row, in a third of the time.
    PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Up)
        .write_image(bytes, width as u32, height as u32, colour)
        .map_err(io::Error::other)?;
    Ok(file)
}
