//! Writing, in the order of properties that all viewers know.

use std::path::Path;

use mba_io::FileError;
use mba_io::whole_file::write_together;

use super::MAP_NAMES;
use crate::gaussians::display_colour::{coefficient_of, coefficient_of_display};
use crate::gaussians::store::{Gaussian, Gaussians};

/// Properties in the order of the original implementation. Normals are always zero; some viewers insist on them.
const PROPERTIES: [&str; 17] = [
    "x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1",
    "scale_2", "rot_0", "rot_1", "rot_2", "rot_3",
];

/// The first of the properties that are colours.
const FIRST_COLOUR: usize = 6;
/// The first of those that are logarithms of deviations.
const FIRST_SCALE: usize = 10;

/// What a file for viewers has besides a map.
#[derive(Clone, Debug, PartialEq)]
pub struct ForViewers {
    /// Display values (0 to 1) of red, green and blue that suit blending of display values, one per Gaussian.
    pub colours: [Vec<f32>; 3],
    /// Natural logarithms of the standard deviations along the own axes that suit viewers, metres, one per Gaussian.
    pub log_scales: [Vec<f32>; 3],
    /// Lines of the header for people and for programs that look for them; without line breaks.
    pub comments: Vec<String>,
}

/// Writes a file of Gaussians, see [`format_ply`]; beside its place and then renamed, so that a full disk never
/// leaves half a file.
///
/// # Errors
///
/// [`FileError::Unwritable`].
pub fn write_ply(path: &Path, gaussians: &Gaussians) -> Result<(), FileError> {
    write_together(&[(path.to_owned(), format_ply(gaussians))])
}

/// The same for a file that viewers show as the map looks, see [`format_ply_for_viewers`].
///
/// # Errors
///
/// [`FileError::Unwritable`].
pub fn write_ply_for_viewers(
    path: &Path,
    gaussians: &Gaussians,
    viewing: &ForViewers,
) -> Result<(), FileError> {
    write_together(&[(path.to_owned(), format_ply_for_viewers(gaussians, viewing))])
}

/// The content of a file of Gaussians: little-endian, display colours, unit quaternions.
///
/// Gaussians with a parameter that is not finite, which no renderer draws, are left out.
#[must_use]
pub fn format_ply(gaussians: &Gaussians) -> Vec<u8> {
    let kept = kept(gaussians);
    let mut bytes = header(kept.len(), &[], &[]);
    bytes.extend(kept.iter().flat_map(|(_, gaussian)| vertex(gaussian)).flat_map(f32::to_le_bytes));
    bytes
}

/// The content of a file of Gaussians that viewers show as the map looks; reading it gives the same map, bit for bit, as
/// reading [`format_ply`] does.
///
/// # Panics
///
/// If there are not colours and sizes for every Gaussian.
#[must_use]
pub fn format_ply_for_viewers(gaussians: &Gaussians, viewing: &ForViewers) -> Vec<u8> {
    for plane in viewing.colours.iter().chain(&viewing.log_scales) {
        let (known, count) = (plane.len(), gaussians.len());
        assert_eq!(known, count, "colours and sizes of {known} Gaussians for a map of {count}");
    }
    let kept = kept(gaussians);
    let mut bytes = header(kept.len(), &MAP_NAMES, &viewing.comments);
    for (index, gaussian) in &kept {
        let mut numbers = vertex(gaussian);
        let own = |first: usize| numbers[first..first + 3].to_vec();
        let own = [own(FIRST_COLOUR), own(FIRST_SCALE)].concat();
        for (number, plane) in numbers[FIRST_COLOUR..].iter_mut().zip(&viewing.colours) {
            *number = coefficient_of_display(plane[*index]);
        }
        for (number, plane) in numbers[FIRST_SCALE..].iter_mut().zip(&viewing.log_scales) {
            *number = plane[*index];
        }
        bytes.extend(numbers.into_iter().chain(own).flat_map(f32::to_le_bytes));
    }
    bytes
}

/// The Gaussians that are written, each with its index.
fn kept(gaussians: &Gaussians) -> Vec<(usize, Gaussian)> {
    let all = (0..gaussians.len()).filter_map(|index| Some((index, gaussians.get(index)?)));
    all.filter(|(_, gaussian)| gaussian.to_array().iter().all(|value| value.is_finite())).collect()
}

fn header(count: usize, more: &[&str], comments: &[String]) -> Vec<u8> {
    let mut text = "ply\nformat binary_little_endian 1.0\n".to_owned();
    text.extend(comments.iter().map(|comment| format!("comment {comment}\n")));
    text += &format!("element vertex {count}\n");
    text.extend(PROPERTIES.iter().chain(more).map(|name| format!("property float {name}\n")));
    (text + "end_header\n").into_bytes()
}

/// The numbers of a Gaussian in the order of [`PROPERTIES`].
fn vertex(gaussian: &Gaussian) -> [f32; 17] {
    let [x, y, z] = gaussian.mean;
    let [red, green, blue] = gaussian.colour.map(coefficient_of);
    let [sx, sy, sz] = gaussian.log_scale;
    let norm = gaussian.rotation.iter().map(|q| q * q).sum::<f32>().sqrt();
    let norm = if norm.is_normal() { norm } else { 1.0 };
    let [qw, qx, qy, qz] = gaussian.rotation.map(|q| q / norm);
    [x, y, z, 0.0, 0.0, 0.0, red, green, blue, gaussian.opacity_logit, sx, sy, sz, qw, qx, qy, qz]
}
