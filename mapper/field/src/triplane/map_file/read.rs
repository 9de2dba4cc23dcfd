//! Reading a field.

use std::path::Path;

use mba_io::BinaryFileError;
use mba_io::binary_file::{check_checksum, check_length, check_version};
use mba_io::whole_file::read;

use super::{CHECKED_FROM, FieldFileError, MAGIC, VERSION, place};
use crate::triplane::field::TriplaneField;
use crate::triplane::layers::Layers;
use crate::triplane::planes::FeaturePlanes;
use crate::triplane::region::{MOST_CELLS, Region};
use crate::triplane::settings::{CHANNELS, FieldSettings, HIDDEN, MOST_REFINEMENT};

/// Bytes before the decoders.
const HEADER_LEN: usize = place::DECODERS;

/// Largest logarithm of a sharpness, either way: surfaces of 1e-9 truncations, beyond single precision.
const LARGEST_LOG_SHARPNESS: f32 = 20.0;

/// Bytes of the weights of both decoders.
const DECODERS_LEN: usize = 4 * (Layers::<1>::COUNT + Layers::<3>::COUNT);

/// Reads the map file `path`. Nothing is believed: a file that was cut, changed or made up is refused, and there is never
/// more memory taken than the file is long.
///
/// # Errors
/// All of [`FieldFileError`]; of several defects the one that explains the others.
pub fn read_field(path: &Path) -> Result<TriplaneField, FieldFileError> {
    let bytes = read(path, &MAGIC)?;
    let mut file = Reader { path, bytes: &bytes };
    file.check_start()?;
    let header = file.header()?;
    file.check_length(&header)?;
    file.bytes = &bytes[HEADER_LEN..];
    let distance_decoder = file.decoder()?;
    let colour_decoder = file.decoder()?;
    let Header { region, settings, seed, log_sharpness } = header;
    let mut field = TriplaneField {
        region,
        settings,
        seed,
        geometry: [1, settings.geometry_cells].map(|cells| FeaturePlanes::zeros(&region, cells)),
        colour: [1, settings.colour_cells].map(|cells| FeaturePlanes::zeros(&region, cells)),
        distance_decoder,
        colour_decoder,
        log_sharpness,
    };
    for planes in field.geometry.iter_mut().chain(&mut field.colour) {
        planes.values.iter_mut().try_for_each(|plane| file.plane(&mut plane.0))?;
    }
    Ok(field)
}

/// Where the numbers of the three axes begin, of which that of x begins at `first`.
fn axes(first: usize) -> [usize; 3] {
    [first, first + 4, first + 8]
}

/// What the header says.
struct Header {
    region: Region,
    settings: FieldSettings,
    seed: u64,
    log_sharpness: f32,
}

/// A file, and what of it is still to be read.
struct Reader<'a> {
    path: &'a Path,
    bytes: &'a [u8],
}

impl Reader<'_> {
    /// Checks everything that needs no understanding of the content.
    fn check_start(&self) -> Result<(), FieldFileError> {
        let (path, bytes) = (self.path, self.bytes);
        if !bytes.starts_with(&MAGIC[..MAGIC.len().min(bytes.len())]) || bytes.is_empty() {
            return Err(FieldFileError::NotAField { path: path.to_owned() });
        }
        if bytes.len() < HEADER_LEN {
            let (expected, found) = (HEADER_LEN as u64, bytes.len() as u64);
            return Err(BinaryFileError::Length { path: path.to_owned(), expected, found }.into());
        }
        check_version(path, "the layout of fields", VERSION, self.u32_at(place::VERSION))?;
        Ok(check_checksum(path, self.u32_at(place::CHECKSUM), crc32fast::hash(&bytes[CHECKED_FROM..]))?)
    }

    /// The four bytes at a place inside of the header.
    fn u32_at(&self, at: usize) -> u32 {
        u32::from_le_bytes([0, 1, 2, 3].map(|k| self.bytes[at + k]))
    }

    fn f32_at(&self, at: usize) -> f32 {
        f32::from_bits(self.u32_at(at))
    }

    fn header(&self) -> Result<Header, FieldFileError> {
        self.check_header()?;
        let settings = FieldSettings {
            geometry_cells: self.u32_at(place::GEOMETRY_CELLS),
            colour_cells: self.u32_at(place::COLOUR_CELLS),
            truncation: self.f32_at(place::TRUNCATION),
            sharpness: self.f32_at(place::SHARPNESS),
        };
        let region = Region {
            first: axes(place::FIRST_CELL).map(|at| self.u32_at(at) as i32),
            cells: axes(place::CELLS).map(|at| self.u32_at(at)),
        };
        let seed = u64::from(self.u32_at(place::SEED)) | (u64::from(self.u32_at(place::SEED + 4)) << 32);
        Ok(Header { region, settings, seed, log_sharpness: self.f32_at(place::LOG_SHARPNESS) })
    }

    /// Checks that every number of the header is in its range.
    fn check_header(&self) -> Result<(), FieldFileError> {
        self.check(place::CHANNELS, "features per node", "8", |channels| channels == CHANNELS as u32)?;
        self.check(place::HIDDEN, "units per hidden layer", "16", |units| units == HIDDEN as u32)?;
        let refinement = |cells: u32| (1..=MOST_REFINEMENT).contains(&cells);
        for at in [place::GEOMETRY_CELLS, place::COLOUR_CELLS] {
            self.check(at, "fine cells per coarse cell", "1 to 64", refinement)?;
        }
        for (at, name) in [(place::TRUNCATION, "truncation"), (place::SHARPNESS, "first sharpness")] {
            let value = self.f32_at(at);
            if !(value.is_finite() && value > 0.0) {
                return Err(self.refused(name, value.to_string(), "a positive number"));
            }
        }
        let log_sharpness = self.f32_at(place::LOG_SHARPNESS);
        if log_sharpness.is_nan() || log_sharpness.abs() > LARGEST_LOG_SHARPNESS {
            return Err(self.refused("logarithm of the sharpness", log_sharpness.to_string(), "-20 to 20"));
        }
        for at in axes(place::FIRST_CELL) {
            self.check(at, "first cell", "-512 to 512", |cell| (cell as i32).unsigned_abs() <= MOST_CELLS)?;
        }
        for at in axes(place::CELLS) {
            self.check(at, "number of cells", "1 to 512", |cells| (1..=MOST_CELLS).contains(&cells))?;
        }
        Ok(())
    }

    fn check(
        &self,
        at: usize,
        field: &'static str,
        expected: &'static str,
        fits: impl Fn(u32) -> bool,
    ) -> Result<(), FieldFileError> {
        let value = self.u32_at(at);
        if fits(value) { Ok(()) } else { Err(self.refused(field, value.to_string(), expected)) }
    }

    fn refused(&self, field: &'static str, value: String, expected: &'static str) -> FieldFileError {
        FieldFileError::Header { path: self.path.to_owned(), field, value, expected }
    }

    /// Checks that the file is as long as its header says, before there is room made for it.
    fn check_length(&self, header: &Header) -> Result<(), FieldFileError> {
        let Header { region, settings, .. } = header;
        let plane = |cells: u32| -> u64 {
            let [x, y, z] = region.cells.map(|coarse| u64::from(coarse) * u64::from(cells) + 1);
            // Three times least value and step, four bytes each, and two bytes for each feature of a node.
            3 * 8 + (x * y + x * z + y * z) * CHANNELS as u64 * 2
        };
        let planes = 2 * plane(1) + plane(settings.geometry_cells) + plane(settings.colour_cells);
        let expected = (HEADER_LEN + DECODERS_LEN) as u64 + planes;
        Ok(check_length(self.path, expected, self.bytes.len() as u64)?)
    }

    /// The next four bytes as a number; the length was checked.
    fn f32(&mut self) -> f32 {
        let (number, rest) = self.bytes.split_first_chunk().unwrap_or((&[0; 4], &[]));
        self.bytes = rest;
        f32::from_le_bytes(*number)
    }

    fn decoder<const OUTPUTS: usize>(&mut self) -> Result<Layers<OUTPUTS>, FieldFileError> {
        let mut layers = Layers::default();
        layers.parts_mut().into_iter().flatten().for_each(|weight| *weight = self.f32());
        if layers.parts().iter().any(|part| part.iter().any(|weight| !weight.is_finite())) {
            return Err(self.not_finite("a decoder"));
        }
        Ok(layers)
    }

    fn plane(&mut self, values: &mut [f32]) -> Result<(), FieldFileError> {
        let [least, step] = [self.f32(), self.f32()];
        let most = least + step * f32::from(u16::MAX);
        if !(least.is_finite() && step.is_finite() && most.is_finite()) {
            return Err(self.not_finite("a plane"));
        }
        let (numbers, rest) = self.bytes.split_at(2 * values.len());
        self.bytes = rest;
        for (value, number) in values.iter_mut().zip(numbers.as_chunks::<2>().0) {
            *value = least + step * f32::from(u16::from_le_bytes(*number));
        }
        Ok(())
    }

    fn not_finite(&self, part: &'static str) -> FieldFileError {
        FieldFileError::NotFinite { path: self.path.to_owned(), part }
    }
}
