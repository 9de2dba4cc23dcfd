//! Reading, whatever else the file has.

use std::path::Path;

use crate::triangles::Mesh;
use mba_io::ply::{Element, Header, MAGIC, PlyError, Records};
use mba_io::whole_file::read;

/// Names of the list of a face's corners; writers disagree.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

/// Reads a mesh or a cloud of points, ascii or little-endian; see [`parse_mesh`].
///
/// # Errors
/// If the file cannot be read or is not such a file.
pub fn read_mesh(path: &Path) -> Result<Mesh, PlyError> {
    parse_mesh(path, &read(path, MAGIC)?)
}

/// The mesh of a file with the content `bytes`; `path` only names it in errors.
///
/// Vertices need `x`, `y` and `z`. Colours are read if vertices have `red`, `green` and `blue` from 0 to 255. Faces,
/// which come after the vertices, are cut into triangles around their first corner. Everything else is ignored. Memory
/// grows with the size of the content, not with the numbers in its header.
///
/// # Errors
/// If the content is no such file, ends early, has positions that are not finite or faces without vertices.
pub fn parse_mesh(path: &Path, bytes: &[u8]) -> Result<Mesh, PlyError> {
    let header = Header::parse(path, bytes)?;
    let mut records = Records::new(path, &header);
    let mut mesh = Mesh::default();
    let mut has_vertices = false;
    for element in &header.elements {
        match &*element.name {
            "vertex" => {
                read_vertices(path, element, &mut records, &mut mesh)?;
                has_vertices = true;
            }
            "face" => read_faces(path, element, &mut records, &mut mesh)?,
            // Other elements have to be walked over: records have no index.
            _ => records.read(element, &[], |_, _| Ok(()))?,
        }
    }
    if has_vertices { Ok(mesh) } else { Err(missing(path, "vertices", "x")) }
}

fn read_vertices(
    path: &Path,
    element: &Element,
    records: &mut Records<'_, '_>,
    mesh: &mut Mesh,
) -> Result<(), PlyError> {
    let place = |name| element.number(name).ok_or_else(|| missing(path, "vertices", name));
    let position = [place("x")?, place("y")?, place("z")?];
    // Colours are optional, but only whole ones.
    let colour = match ["red", "green", "blue"].map(|name| element.number(name)) {
        [Some(red), Some(green), Some(blue)] => Some([red, green, blue]),
        _ => None,
    };
    records.read(element, &position, |_, record| {
        mesh.vertices.push(position.map(|place| record.numbers[place] as f32));
        mesh.colours.extend(colour.map(|colour| colour.map(|place| record.numbers[place] as u8)));
        Ok(())
    })
}

fn read_faces(
    path: &Path,
    element: &Element,
    records: &mut Records<'_, '_>,
    mesh: &mut Mesh,
) -> Result<(), PlyError> {
    let list = element.list(&CORNERS).ok_or_else(|| missing(path, "faces", CORNERS[0]))?;
    let vertices = mesh.vertices.len();
    records.read(element, &[list], |face, record| {
        let corners = &record.lists[list];
        let is_vertex = |corner: f64| corner.fract() == 0.0 && (0.0..vertices as f64).contains(&corner);
        if let Some(&found) = corners.iter().find(|corner| !is_vertex(**corner)) {
            return Err(PlyError::NoSuchVertex { path: path.to_owned(), face, found, vertices });
        }
        if let [first, rest @ ..] = corners.as_slice() {
            // A face with n corners is n - 2 triangles about its first.
            let fan = rest.windows(2).map(|pair| [*first, pair[0], pair[1]]);
            mesh.triangles.extend(fan.map(|corners| corners.map(|corner| corner as u32)));
        }
        Ok(())
    })
}

fn missing(path: &Path, records: &'static str, name: &'static str) -> PlyError {
    PlyError::MissingProperty { path: path.to_owned(), records, name, kind: "a mesh or a cloud of points" }
}
