//! From the bytes of image messages to pictures, without loss.

use super::messages::{CompressedImage, Image};
use crate::picture::{MOST_PIXELS, Picture, UNITS_OF_METRES, colour_png, depth_png, grey_png, metres_png};

/// Raw units per metre of depth in 16 bits, by the convention of ROS.
pub(super) const UNITS_OF_INTEGERS: f64 = 1000.0;

/// A depth image and its raw units per metre.
pub(super) struct Depth {
    pub(super) picture: Picture,
    pub(super) scale: f64,
    /// Pixels that are farther than 16 bits reach.
    pub(super) beyond: usize,
}

/// A colour image.
///
/// # Errors
/// What is wrong with it, or not read.
pub(super) fn colour(image: &Image<'_>) -> Result<Picture, String> {
    let (bytes, order): (usize, &[usize]) = match image.encoding {
        "rgb8" | "8UC3" => (3, &[0, 1, 2]),
        "bgr8" => (3, &[2, 1, 0]),
        "rgba8" => (4, &[0, 1, 2]),
        "bgra8" => (4, &[2, 1, 0]),
        "mono8" | "8UC1" => (1, &[0]),
        other => {
            return Err(format!(
                "colour images are {other}; rgb8, bgr8, rgba8, bgra8, mono8, and JPEG and PNG are read"
            ));
        }
    };
    let pixels = rows(image, bytes)?;
    let encoded = match (bytes, order) {
        (1, _) => grey_png(image.size, &pixels),
        (3, [0, ..]) => colour_png(image.size, &pixels),
        _ => {
            let rgb: Vec<u8> = pixels
                .chunks_exact(bytes)
                .flat_map(|pixel| [pixel[order[0]], pixel[1], pixel[order[2]]])
                .collect();
            colour_png(image.size, &rgb)
        }
    };
    encoded.map(Picture::Encoded).map_err(|error| error.to_string())
}

/// A depth image.
///
/// # Errors
/// What is wrong with it, or not read.
pub(super) fn depth(image: &Image<'_>) -> Result<Depth, String> {
    match image.encoding {
        "16UC1" | "mono16" => {
            let bytes = rows(image, 2)?;
            let (pairs, _) = bytes.as_chunks::<2>();
            let number = if image.is_big_endian { u16::from_be_bytes } else { u16::from_le_bytes };
            let values: Vec<u16> = pairs.iter().map(|pair| number(*pair)).collect();
            let picture = encoded_depth(image.size, &values)?;
            let scale = image.depth_units.map_or(UNITS_OF_INTEGERS, per_metre);
            Ok(Depth { picture, scale, beyond: 0 })
        }
        "32FC1" => {
            let bytes = rows(image, 4)?;
            let (quads, _) = bytes.as_chunks::<4>();
            let number = if image.is_big_endian { f32::from_be_bytes } else { f32::from_le_bytes };
            of_metres(image.size, quads.iter().map(|quad| number(*quad)))
        }
        other => Err(format!("depth images are {other}; 16UC1, mono16, 32FC1 and compressedDepth are read")),
    }
}

/// Raw units per metre of a unit in metres.
pub(super) fn per_metre(unit: f32) -> f64 {
    // 0.001 has no exact form: 1 / 0.001f32 is 999.99995.
    let scale = 1.0 / f64::from(unit);
    let whole = scale.round();
    if (scale - whole).abs() < 1e-4 * whole { whole } else { scale }
}

fn encoded_depth(size: (usize, usize), values: &[u16]) -> Result<Picture, String> {
    depth_png(size, values).map(Picture::Encoded).map_err(|error| error.to_string())
}

/// Depth in metres.
fn of_metres(size: (usize, usize), metres: impl Iterator<Item = f32>) -> Result<Depth, String> {
    let (file, beyond) = metres_png(size, metres).map_err(|error| error.to_string())?;
    Ok(Depth { picture: Picture::Encoded(file), scale: UNITS_OF_METRES, beyond })
}

/// The bytes of all pixels without what fills up rows.
fn rows(image: &Image<'_>, bytes_per_pixel: usize) -> Result<Vec<u8>, String> {
    let (width, height) = image.size;
    if width == 0 || height == 0 || width.saturating_mul(height) > MOST_PIXELS {
        return Err(format!("an image claims to have {width} x {height} pixels"));
    }
    // The last row needs no filling.
    let row = width * bytes_per_pixel;
    let needed = image.step.checked_mul(height - 1).and_then(|bytes| bytes.checked_add(row));
    if image.step < row || needed.is_none_or(|needed| needed > image.data.len()) {
        return Err(format!(
            "an image of {width} x {height} pixels with {} bytes per row has only {} bytes",
            image.step,
            image.data.len()
        ));
    }
    let mut pixels = Vec::with_capacity(row * height);
    for start in (0..height).map(|line| line * image.step) {
        pixels.extend_from_slice(&image.data[start..start + row]);
    }
    Ok(pixels)
}

/// A compressed colour image: the file that the message holds.
pub(super) fn compressed_colour(image: &CompressedImage<'_>) -> Picture {
    Picture::Encoded(image.data.to_vec())
}

/// Bytes before the PNG file of compressed depth: what it is, and two parameters.
const DEPTH_HEADER: usize = 12;

/// A compressed depth image: a PNG file of 16 bits, after twelve bytes for `compressedDepth`, which may also hold inverse
/// depth.
///
/// # Errors
/// What is wrong with it, or not read.
pub(super) fn compressed_depth(image: &CompressedImage<'_>) -> Result<Depth, String> {
    const PNG: [u8; 4] = [0x89, b'P', b'N', b'G'];
    if image.data.starts_with(&PNG) {
        let picture = Picture::Encoded(image.data.to_vec());
        return Ok(Depth { picture, scale: UNITS_OF_INTEGERS, beyond: 0 });
    }
    let Some((header, file)) =
        image.data.split_at_checked(DEPTH_HEADER).filter(|(_, file)| file.starts_with(&PNG))
    else {
        return Err(format!("compressed depth is \"{}\", which holds no PNG file", image.format));
    };
    if !image.format.trim_start().starts_with("32FC1") {
        let picture = Picture::Encoded(file.to_vec());
        return Ok(Depth { picture, scale: UNITS_OF_INTEGERS, beyond: 0 });
    }
    let parameter = |at: usize| header[at..at + 4].try_into().map_or(0.0, f32::from_le_bytes);
    let (a, b) = (parameter(4), parameter(8));
    let (size, inverse) = decode_16(file)?;
    // The depth of a code is a / (code - b); code 0 is missing.
    of_metres(size, inverse.into_iter().map(|code| if code == 0 { 0.0 } else { a / (f32::from(code) - b) }))
}

/// The pixels of a PNG file of 16 bits.
fn decode_16(file: &[u8]) -> Result<((usize, usize), Vec<u16>), String> {
    let picture = Picture::Encoded(file.to_vec());
    let header =
        picture.header(std::path::Path::new("")).map_err(|_| "compressed depth is damaged".to_owned())?;
    if header.size.0.saturating_mul(header.size.1) > MOST_PIXELS {
        return Err(format!("an image claims to have {} x {} pixels", header.size.0, header.size.1));
    }
    let image = image::load_from_memory_with_format(file, image::ImageFormat::Png)
        .map_err(|error| format!("compressed depth is damaged: {error}"))?;
    Ok((header.size, image.into_luma16().into_raw()))
}
