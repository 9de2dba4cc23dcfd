//! Reading, whatever the order of the properties.

use std::path::Path;

use mba_io::ply::{Element, Header, PlyError, Records};
use mba_io::whole_file::read;

use super::{MAP_NAMES, NAMES};
use crate::gaussians::display_colour::linear_of;
use crate::gaussians::store::{COLOUR, Gaussian, Gaussians, LOG_SCALE, OPACITY_LOGIT, PARAMETERS};

/// What stands for an infinite logit of an opacity: the logistic function of it is 1 in single precision.
const OPAQUE_LOGIT: f32 = 30.0;

/// Reads a file of Gaussians, ascii or little-endian; see [`parse_ply`].
///
/// # Errors
///
/// If the file cannot be read or is not a file of Gaussians.
pub fn read_ply(path: &Path) -> Result<Gaussians, PlyError> {
    parse_ply(path, &read(path, mba_io::ply::MAGIC)?)
}

/// The Gaussians of a file with the content `bytes`; `path` only names it in errors.
///
/// Display colours become linear light; those of `mba_dc`, where the file has them, else of `f_dc`. Other properties are ignored, among them spherical harmonics of higher
/// degrees: colours are those seen from the mean direction.
///
/// # Errors
///
/// If the content is not a file of Gaussians, ends early or holds values that are not finite.
pub fn parse_ply(path: &Path, bytes: &[u8]) -> Result<Gaussians, PlyError> {
    let header = Header::parse(path, bytes)?;
    let mut records = Records::new(path, &header);
    for element in &header.elements {
        if element.name != "vertex" {
            records.read(element, &[], |_, _| Ok(()))?;
            continue;
        }
        let fields = fields(path, element)?;
        let mut gaussians = Gaussians::default();
        let needed: Vec<usize> =
            fields.iter().copied().filter(|field| *field != fields[OPACITY_LOGIT]).collect();
        records.read(element, &needed, |index, record| {
            let mut values = fields.map(|field| record.numbers[field] as f32);
            if values[OPACITY_LOGIT].is_nan() {
                let (path, element, property) =
                    (path.to_owned(), element.name.clone(), NAMES[OPACITY_LOGIT].to_owned());
                return Err(PlyError::NotFinite { path, element, index, property, found: "nan".to_owned() });
            }
            // Some trainers write infinity for what hides all behind it; this is as opaque in single precision.
            if values[OPACITY_LOGIT].is_infinite() {
                values[OPACITY_LOGIT] = OPAQUE_LOGIT.copysign(values[OPACITY_LOGIT]);
            }
            gaussians.push(&gaussian(values));
            Ok(())
        })?;
        return Ok(gaussians);
    }
    Err(missing(path, NAMES[0]))
}

/// Where the parameters are, in the order of [`NAMES`]. What is the map's own goes before what is for viewers.
fn fields(path: &Path, vertex: &Element) -> Result<[usize; PARAMETERS], PlyError> {
    let mut fields = [0; PARAMETERS];
    for (field, name) in fields.iter_mut().zip(NAMES) {
        *field = vertex.number(name).ok_or_else(|| missing(path, name))?;
    }
    let own: Vec<usize> = MAP_NAMES.iter().filter_map(|name| vertex.number(name)).collect();
    if own.len() == MAP_NAMES.len() {
        let (colours, scales) = own.split_at(3);
        fields[COLOUR..].copy_from_slice(colours);
        fields[LOG_SCALE..LOG_SCALE + 3].copy_from_slice(scales);
    }
    Ok(fields)
}

/// The Gaussian of numbers as the file has them.
fn gaussian(mut values: [f32; PARAMETERS]) -> Gaussian {
    values[COLOUR..].iter_mut().for_each(|channel| *channel = linear_of(*channel));
    Gaussian::from_array(values)
}

fn missing(path: &Path, name: &'static str) -> PlyError {
    let (path, kind) = (path.to_owned(), "a file of Gaussians");
    PlyError::MissingProperty { path, records: "vertices", name, kind }
}
