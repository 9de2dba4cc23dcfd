//! The map file of a field, `map.mbaf`.
//!
//! All numbers are little-endian; `u32`, `i32` and `f32` have four bytes, `u64` eight, `u16` two.
//!
//! | byte | what |
//! |---|---|
//! | 0 | the eight bytes `MBAFIELD` |
//! | 8 | `u32` version of the layout: 1 |
//! | 12 | `u32` CRC-32 (IEEE) of everything from byte 16 on |
//! | 16 | `u32` features per node, c |
//! | 20 | `u32` units per hidden layer, h |
//! | 24 | `u32` cells of fine geometry planes along a coarse cell |
//! | 28 | `u32` cells of fine colour planes along a coarse cell |
//! | 32 | `f32` truncation, metres |
//! | 36 | `f32` first sharpness |
//! | 40 | `f32` natural logarithm of the sharpness |
//! | 44 | `u64` seed |
//! | 52 | three `i32`: first coarse cell of the box along x, y and z; a coarse cell is 0.24 m |
//! | 64 | three `u32`: number of coarse cells |
//! | 76 | `f32` weights of the decoder of signed distance, then those of the decoder of colour |
//!
//! A decoder with o outputs has 2c rows of h weights of the first layer, one row per feature (first those of the coarse
//! planes), h biases, h rows of h weights of the second layer, one row per unit of the first, h biases, o rows of h
//! weights of the last layer, one row per output, and o biases.
//!
//! Then follow twelve planes: of geometry coarse, geometry fine, colour coarse, colour fine, each in the order xy, xz, yz.
//! A plane is `f32` least value, `f32` step, and one `u16` q per value, which is `least + q step`. Values of a node lie
//! together, nodes with ascending first coordinate next to each other, rows with ascending second one. An axis with n
//! cells of a plane has n + 1 nodes.
//!
//! Sixteen bits for a value halve the file; rendered colours change by less than a hundredth of a stored level.

mod error;
mod read;
mod write;

pub use error::FieldFileError;
pub use read::read_field;
pub use write::write_field;

/// What every file starts with.
const MAGIC: [u8; 8] = *b"MBAFIELD";

/// Version of the layout.
const VERSION: u32 = 1;

/// Bytes at which the numbers of the header begin, as in the table above.
mod place {
    pub(super) const VERSION: usize = 8;
    pub(super) const CHECKSUM: usize = 12;
    pub(super) const CHANNELS: usize = 16;
    pub(super) const HIDDEN: usize = 20;
    pub(super) const GEOMETRY_CELLS: usize = 24;
    pub(super) const COLOUR_CELLS: usize = 28;
    pub(super) const TRUNCATION: usize = 32;
    pub(super) const SHARPNESS: usize = 36;
    pub(super) const LOG_SHARPNESS: usize = 40;
    pub(super) const SEED: usize = 44;
    pub(super) const FIRST_CELL: usize = 52;
    pub(super) const CELLS: usize = 64;
    pub(super) const DECODERS: usize = 76;
}

/// First byte that the checksum covers.
const CHECKED_FROM: usize = place::CHANNELS;

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::PathBuf;

    use mba_tracker::simd::Level;

    use super::*;
    use crate::triplane::TriplaneField;
    use crate::triplane::reference::lively_field;
    use mba_io::BinaryFileError;

    fn written() -> (tempfile::TempDir, PathBuf, TriplaneField) {
        let folder = tempfile::tempdir().unwrap();
        let (path, field) = (folder.path().join("map.mbaf"), lively_field());
        write_field(&path, &field).unwrap();
        (folder, path, field)
    }

    #[test]
    fn a_field_comes_back_within_its_quantisation() {
        let (_folder, path, field) = written();
        let again = read_field(&path).unwrap();
        assert_eq!(again.region, field.region);
        assert_eq!(
            (&again.distance_decoder, &again.colour_decoder),
            (&field.distance_decoder, &field.colour_decoder)
        );
        assert_eq!(
            (again.log_sharpness, again.settings, again.seed),
            (field.log_sharpness, field.settings, field.seed)
        );
        for (again, field) in
            again.geometry.iter().zip(&field.geometry).chain(again.colour.iter().zip(&field.colour))
        {
            for (again, field) in again.values.iter().zip(&field.values) {
                let range = field.0.iter().fold([0.0_f32; 2], |[a, b], x| [a.min(*x), b.max(*x)]);
                let step = (range[1] - range[0]) / 65535.0;
                assert_eq!(again.0.len(), field.0.len());
                assert!(again.0.iter().zip(&field.0).all(|(a, b)| (a - b).abs() <= 0.51 * step + 1e-6));
            }
        }
        let at = |k: usize| [0.0011, 0.0009, 0.0006].map(|step| (k * 131 % 1009) as f64 * step);
        let origin = field.region.origin();
        let points: Vec<[f64; 3]> =
            (0..500).map(|k| [0, 1, 2].map(|axis| origin[axis] + at(k)[axis])).collect();
        let [before, after] = [&field, &again].map(|field| field.colours(Level::new(), &points));
        let pairs = before.as_flattened().iter().zip(after.as_flattened());
        let off = pairs.map(|(a, b)| 255.0 * (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 0.01, "a colour is off by {off} levels");
        // What was read is written as it was.
        let first = fs::read(&path).unwrap();
        write_field(&path, &again).unwrap();
        assert_eq!(fs::read(&path).unwrap().len(), first.len());
        assert!(first.len() < field.bytes() * 6 / 10 + 4000);
    }

    #[test]
    fn every_damage_is_found() {
        let (_folder, path, _) = written();
        let whole = fs::read(&path).unwrap();
        for at in (0..whole.len()).step_by(whole.len() / 97).chain(0..80) {
            let mut damaged = whole.clone();
            damaged[at] ^= 0x10;
            fs::write(&path, &damaged).unwrap();
            let error = read_field(&path).unwrap_err();
            let fits = match at {
                0..8 => matches!(error, FieldFileError::NotAField { .. }),
                8..12 => matches!(error, FieldFileError::Unsound(BinaryFileError::Version { .. })),
                _ => matches!(error, FieldFileError::Unsound(BinaryFileError::Damaged { .. })),
            };
            assert!(fits, "byte {at}: {error}");
        }
        for length in [0, 7, 12, 75, whole.len() - 1] {
            fs::write(&path, &whole[..length]).unwrap();
            assert!(read_field(&path).is_err(), "{length} bytes");
        }
    }

    #[test]
    fn a_box_that_is_not_in_the_file_is_not_made_room_for() {
        let (_folder, path, _) = written();
        let mut bytes = fs::read(&path).unwrap();
        let set = |bytes: &mut Vec<u8>, at: usize, value: u32| {
            bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
            let checksum = crc32fast::hash(&bytes[CHECKED_FROM..]);
            bytes[12..16].copy_from_slice(&checksum.to_le_bytes());
            fs::write(&path, &*bytes).unwrap();
            read_field(&path).unwrap_err()
        };
        let cut = set(&mut bytes.clone(), 64, 512);
        assert!(matches!(cut, FieldFileError::Unsound(BinaryFileError::Length { .. })));
        assert!(matches!(set(&mut bytes.clone(), 64, 1 << 31), FieldFileError::Header { .. }));
        assert!(matches!(set(&mut bytes.clone(), 28, 0), FieldFileError::Header { .. }));
        assert!(matches!(set(&mut bytes.clone(), 32, f32::NAN.to_bits()), FieldFileError::Header { .. }));
        assert!(matches!(set(&mut bytes, 80, f32::INFINITY.to_bits()), FieldFileError::NotFinite { .. }));
    }
}
