//! Writing a field.

use std::path::Path;

use mba_io::FileError;
use mba_io::whole_file::write_durably;

use super::{CHECKED_FROM, MAGIC, VERSION, place};
use crate::triplane::field::TriplaneField;
use crate::triplane::settings::{CHANNELS, HIDDEN};

/// Writes `field` as the map file `path`, whole or not at all.
///
/// # Errors
/// [`FileError::Unwritable`]; an older file is still there.
pub fn write_field(path: &Path, field: &TriplaneField) -> Result<(), FileError> {
    // Values take half of their size in memory; header and decoders fit into a page.
    let mut bytes = Vec::with_capacity(field.bytes() / 2 + 4096);
    bytes.extend(MAGIC);
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend([0; 4]);
    header(field, &mut bytes);
    for part in field.distance_decoder.parts().into_iter().chain(field.colour_decoder.parts()) {
        part.iter().for_each(|weight| bytes.extend(weight.to_le_bytes()));
    }
    for planes in field.geometry.iter().chain(&field.colour) {
        planes.values.iter().for_each(|plane| quantised(&plane.0, &mut bytes));
    }
    let checksum = crc32fast::hash(&bytes[CHECKED_FROM..]);
    bytes[place::CHECKSUM..CHECKED_FROM].copy_from_slice(&checksum.to_le_bytes());
    write_durably(path, &bytes)
}

fn header(field: &TriplaneField, bytes: &mut Vec<u8>) {
    let settings = &field.settings;
    for count in [CHANNELS as u32, HIDDEN as u32, settings.geometry_cells, settings.colour_cells] {
        bytes.extend(count.to_le_bytes());
    }
    for number in [settings.truncation, settings.sharpness, field.log_sharpness] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend(field.seed.to_le_bytes());
    field.region.first.iter().for_each(|cell| bytes.extend(cell.to_le_bytes()));
    field.region.cells.iter().for_each(|cells| bytes.extend(cells.to_le_bytes()));
}

/// The values of a plane in 65536 steps from the least to the greatest.
fn quantised(values: &[f32], bytes: &mut Vec<u8>) {
    let finite = values.iter().copied().filter(|value| value.is_finite());
    let [least, most] = finite.fold([f32::INFINITY, f32::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)]);
    let [least, most] = if least <= most { [least, most] } else { [0.0; 2] };
    let step = (most - least) / f32::from(u16::MAX);
    bytes.extend(least.to_le_bytes());
    bytes.extend(step.to_le_bytes());
    let per_step = if step > 0.0 { 1.0 / step } else { 0.0 };
    // The cast saturates.
    values.iter().for_each(|value| bytes.extend((((value - least) * per_step).round() as u16).to_le_bytes()));
}
