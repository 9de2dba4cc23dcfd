//! Meshes as Wavefront OBJ, with colours behind the positions (`v x y z r g b`, from 0 to 1, as displays show them), which
//! MeshLab, Blender and others read.

use std::fmt::Write as _;

use crate::triangles::Mesh;

/// The first line.
const TITLE: &str = "# mesh of mba, lengths in metres\n";

/// The content of a file. Colours are left out unless there is one per vertex.
#[must_use]
pub(super) fn format_obj(mesh: &Mesh) -> String {
    let mut text = TITLE.to_owned();
    let has_colours = mesh.colours.len() == mesh.vertices.len();
    for (index, [x, y, z]) in mesh.vertices.iter().enumerate() {
        // Writing to a string cannot fail.
        let _ = write!(text, "v {x} {y} {z}");
        if has_colours {
            let [r, g, b] = mesh.colours[index].map(|byte| f64::from(byte) / 255.0);
            let _ = write!(text, " {r:.4} {g:.4} {b:.4}");
        }
        text.push('\n');
    }
    for triangle in &mesh.triangles {
        // Vertices are counted from 1.
        let [a, b, c] = triangle.map(|vertex| u64::from(vertex) + 1);
        let _ = writeln!(text, "f {a} {b} {c}");
    }
    text
}

/// Whether a file that begins with `start` is one of [`format_obj`].
#[must_use]
pub(super) fn is_own_obj(start: &[u8]) -> bool {
    start.starts_with(TITLE.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_have_colours_and_are_counted_from_one() {
        let mut mesh = Mesh {
            vertices: vec![[0.0, 0.5, 1e-7], [1.0, -0.25, 3.0], [0.1, 1.0, 2.0]],
            colours: vec![[0, 51, 255], [255; 3], [1, 2, 3]],
            triangles: vec![[2, 0, 1]],
        };
        let text = format_obj(&mesh);
        let lines: Vec<&str> = text.lines().skip(1).collect();
        let expected = [
            "v 0 0.5 0.0000001 0.0000 0.2000 1.0000",
            "v 1 -0.25 3 1.0000 1.0000 1.0000",
            "v 0.1 1 2 0.0039 0.0078 0.0118",
            "f 3 1 2",
        ];
        assert_eq!(lines, expected);
        assert!(is_own_obj(text.as_bytes()) && !is_own_obj(b"# Blender\n"));
        mesh.colours.clear();
        assert!(format_obj(&mesh).contains("v 1 -0.25 3\n"));
    }
}
