//! Reading, whatever the order of the properties.

use std::fs;
use std::path::Path;

use super::NAMES;
use super::error::PlyError;
use super::header::{Encoding, Field, Header, Scalar};
use crate::gaussians::display_colour::linear_of;
use crate::gaussians::store::{COLOUR, Gaussian, Gaussians, PARAMETERS};

/// Reads a file of Gaussians, ascii or little-endian; see [`parse_ply`].
///
/// # Errors
///
/// If the file cannot be read or is not a file of Gaussians.
pub fn read_ply(path: &Path) -> Result<Gaussians, PlyError> {
    let bytes = fs::read(path).map_err(|reason| PlyError::Unreadable { path: path.to_owned(), reason })?;
    parse_ply(path, &bytes)
}

/// The Gaussians of a file with the content `bytes`; `path` only names it in errors.
///
/// Display colours become linear light. Other properties are ignored, among them spherical harmonics of higher
/// degrees: colours are those seen from the mean direction.
///
/// # Errors
///
/// If the content is not a file of Gaussians, ends early or holds values that are not finite.
pub fn parse_ply(path: &Path, bytes: &[u8]) -> Result<Gaussians, PlyError> {
    let header = Header::parse(path, bytes)?;
    match header.encoding {
        Encoding::LittleEndian => parse_binary(path, &header),
        Encoding::Text => parse_text(path, &header),
    }
}

fn parse_binary(path: &Path, header: &Header) -> Result<Gaussians, PlyError> {
    let body = usize::try_from(header.skip).ok().and_then(|skip| header.body.get(skip..)).unwrap_or_default();
    let complete = (body.len() / header.stride) as u64;
    if complete < header.vertices {
        return Err(truncated(path, header, complete));
    }
    let vertices = body.chunks_exact(header.stride).zip(0..header.vertices);
    vertices
        .map(|(bytes, vertex)| {
            let mut values = [0.0; PARAMETERS];
            for ((value, field), property) in values.iter_mut().zip(&header.fields).zip(NAMES) {
                let number = decode(field, bytes);
                *value =
                    finite(number).ok_or_else(|| not_finite(path, vertex, property, number.to_string()))?;
            }
            Ok(gaussian(values))
        })
        .collect()
}

fn parse_text(path: &Path, header: &Header) -> Result<Gaussians, PlyError> {
    let text = String::from_utf8_lossy(header.body);
    let skip = usize::try_from(header.skip).unwrap_or(usize::MAX);
    let mut lines = text.lines().filter(|line| !line.trim().is_empty()).skip(skip);
    (0..header.vertices)
        .map(|vertex| {
            let line = lines.next().ok_or_else(|| truncated(path, header, vertex))?;
            let words: Vec<&str> = line.split_whitespace().collect();
            let mut values = [0.0; PARAMETERS];
            for ((value, field), property) in values.iter_mut().zip(&header.fields).zip(NAMES) {
                let word = words.get(field.index).copied().unwrap_or_default();
                let number = word.parse().ok().and_then(finite);
                *value = number.ok_or_else(|| not_finite(path, vertex, property, word.to_owned()))?;
            }
            Ok(gaussian(values))
        })
        .collect()
}

/// The number of a field; the vertex is complete.
fn decode(field: &Field, vertex: &[u8]) -> f64 {
    let bytes = &vertex[field.offset..field.offset + field.scalar.size()];
    let mut eight = [0; 8];
    eight[..bytes.len()].copy_from_slice(bytes);
    let [a, b, c, d, ..] = eight;
    match field.scalar {
        Scalar::F32 => f32::from_le_bytes([a, b, c, d]).into(),
        Scalar::F64 => f64::from_le_bytes(eight),
        Scalar::U8 => a.into(),
        Scalar::I8 => i8::from_le_bytes([a]).into(),
        Scalar::U16 => u16::from_le_bytes([a, b]).into(),
        Scalar::I16 => i16::from_le_bytes([a, b]).into(),
        Scalar::U32 => u32::from_le_bytes([a, b, c, d]).into(),
        Scalar::I32 => i32::from_le_bytes([a, b, c, d]).into(),
    }
}

/// The number if it is finite, also in single precision.
fn finite(number: f64) -> Option<f32> {
    Some(number as f32).filter(|single| single.is_finite())
}

/// The Gaussian of numbers as the file has them.
fn gaussian(mut values: [f32; PARAMETERS]) -> Gaussian {
    values[COLOUR..].iter_mut().for_each(|channel| *channel = linear_of(*channel));
    Gaussian::from_array(values)
}

fn truncated(path: &Path, header: &Header, found: u64) -> PlyError {
    PlyError::Truncated { path: path.to_owned(), announced: header.vertices, found }
}

fn not_finite(path: &Path, vertex: u64, property: &'static str, found: String) -> PlyError {
    PlyError::NotFinite { path: path.to_owned(), vertex, property, found }
}
