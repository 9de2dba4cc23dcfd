//! Writing, in the order of properties that all viewers know.

use std::path::Path;

use mba_io::FileError;
use mba_io::whole_file::write_together;

use crate::gaussians::display_colour::coefficient_of;
use crate::gaussians::store::{Gaussian, Gaussians};

/// Properties in the order of the original implementation. Normals are always zero; some viewers insist on them.
const PROPERTIES: [&str; 17] = [
    "x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1",
    "scale_2", "rot_0", "rot_1", "rot_2", "rot_3",
];

/// Writes a file of Gaussians, see [`format_ply`]; beside its place and then renamed, so that a full disk never
/// leaves half a file.
///
/// # Errors
///
/// [`FileError::Unwritable`].
pub fn write_ply(path: &Path, gaussians: &Gaussians) -> Result<(), FileError> {
    write_together(&[(path.to_owned(), format_ply(gaussians))])
}

/// The content of a file of Gaussians: little-endian, display colours, unit quaternions.
///
/// Gaussians with a parameter that is not finite, which no renderer draws, are left out.
#[must_use]
pub fn format_ply(gaussians: &Gaussians) -> Vec<u8> {
    let all = (0..gaussians.len()).filter_map(|index| gaussians.get(index));
    let kept: Vec<Gaussian> = all.filter(|g| g.to_array().iter().all(|value| value.is_finite())).collect();
    let mut bytes = b"ply\nformat binary_little_endian 1.0\n".to_vec();
    bytes.extend(format!("element vertex {}\n", kept.len()).bytes());
    for name in PROPERTIES {
        bytes.extend(format!("property float {name}\n").bytes());
    }
    bytes.extend(b"end_header\n");
    bytes.extend(kept.iter().flat_map(vertex).flat_map(f32::to_le_bytes));
    bytes
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
