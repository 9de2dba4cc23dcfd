//! Images as the bytes of PNG files.

use std::io::{self, Cursor};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

/// A colour image: red, green, blue of each of `width * height` pixels, row-major.
pub fn encode_rgb(size: [usize; 2], rgb: &[u8]) -> io::Result<Vec<u8>> {
    encode(size, rgb, 3, ExtendedColorType::Rgb8)
}

/// A depth image: one value per pixel, row-major.
pub fn encode_depth(size: [usize; 2], depth: &[u16]) -> io::Result<Vec<u8>> {
    // The encoder takes the machine's own order of bytes.
    let bytes: Vec<u8> = depth.iter().flat_map(|value| value.to_ne_bytes()).collect();
    encode(size, &bytes, 2, ExtendedColorType::L16)
}

fn encode(
    [width, height]: [usize; 2],
    bytes: &[u8],
    bytes_per_pixel: usize,
    colour: ExtendedColorType,
) -> io::Result<Vec<u8>> {
    let mut png = Cursor::new(Vec::new());
    if bytes.len() != bytes_per_pixel * width * height {
        let size = format!("{} bytes are no image of {width} x {height} pixels", bytes.len());
        return Err(io::Error::new(io::ErrorKind::InvalidInput, size));
    }
    PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Adaptive)
        .write_image(bytes, width as u32, height as u32, colour)
        .map_err(io::Error::other)?;
    Ok(png.into_inner())
}
