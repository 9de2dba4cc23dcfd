//! Writing, in the form that all viewers know.

use std::path::Path;

use crate::triangles::Mesh;
use mba_io::FileError;
use mba_io::whole_file::write_together;

/// What every mesh of this program starts with.
const START: &str = "ply\nformat binary_little_endian 1.0\ncomment lengths in metres\n";

/// Writes a mesh, see [`format_mesh`]; beside its place and then renamed, so that a full disk never leaves half a
/// file.
///
/// # Errors
/// [`FileError::Unwritable`].
pub fn write_mesh(path: &Path, mesh: &Mesh) -> Result<(), FileError> {
    write_together(&[(path.to_owned(), format_mesh(mesh))])
}

/// Whether a file that begins with `start` is a mesh as [`format_mesh`] makes it.
#[must_use]
pub fn is_own_mesh(start: &[u8]) -> bool {
    start.starts_with(START.as_bytes())
}

/// The content of a little-endian PLY file: positions as `float x y z`, colours, if there are any, as
/// `uchar red green blue`, triangles as lists `uchar int vertex_indices`.
#[must_use]
pub fn format_mesh(mesh: &Mesh) -> Vec<u8> {
    let coloured = mesh.colours.len() == mesh.vertices.len();
    let mut bytes = header(mesh, coloured).into_bytes();
    bytes.reserve(15 * mesh.vertices.len() + 13 * mesh.triangles.len());
    for (index, vertex) in mesh.vertices.iter().enumerate() {
        bytes.extend(vertex.iter().flat_map(|coordinate| coordinate.to_le_bytes()));
        if coloured {
            bytes.extend(mesh.colours[index]);
        }
    }
    for triangle in &mesh.triangles {
        bytes.push(3);
        bytes.extend(triangle.iter().flat_map(|vertex| vertex.to_le_bytes()));
    }
    bytes
}

fn header(mesh: &Mesh, coloured: bool) -> String {
    let mut text = String::from(START);
    text += &format!("element vertex {}\n", mesh.vertices.len());
    text += "property float x\nproperty float y\nproperty float z\n";
    if coloured {
        text += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    }
    text += &format!("element face {}\n", mesh.triangles.len());
    text + "property list uchar int vertex_indices\nend_header\n"
}
