//! The formats that meshes are written in, by the endings of their names.

use std::path::Path;

use super::glb::{MeshTooLarge, YAxis, format_glb, is_own_glb};
use super::obj::{format_obj, is_own_obj};
use super::{format_mesh, is_own_mesh};
use crate::triangles::Mesh;

/// A format of meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshFormat {
    /// Polygon file format, binary.
    Ply,
    /// Binary glTF 2.0.
    Glb,
    /// Wavefront OBJ with colours of vertices.
    Obj,
}

impl MeshFormat {
    /// The endings of all formats, for messages.
    pub const ENDINGS: &str = ".ply, .glb or .obj";

    /// The format of a file of this name, in small or capital letters; PLY for one without an ending.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let Some(ending) = path.extension() else { return Some(Self::Ply) };
        let known = [("ply", Self::Ply), ("glb", Self::Glb), ("obj", Self::Obj)];
        known.into_iter().find(|(name, _)| ending.eq_ignore_ascii_case(name)).map(|(_, format)| format)
    }

    /// The content of a file. `y_axis` turns a GLB, which is y-up; the other formats do not say where up is.
    ///
    /// # Errors
    /// [`MeshTooLarge`].
    pub fn format(self, mesh: &Mesh, y_axis: YAxis) -> Result<Vec<u8>, MeshTooLarge> {
        match self {
            Self::Ply => Ok(format_mesh(mesh)),
            Self::Glb => format_glb(mesh, y_axis),
            Self::Obj => Ok(format_obj(mesh).into_bytes()),
        }
    }

    /// Whether a file that begins with `start` is a mesh of this program, of any format.
    #[must_use]
    pub fn is_own(start: &[u8]) -> bool {
        is_own_mesh(start) || is_own_glb(start) || is_own_obj(start)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_tells_the_format() {
        let of = |name: &str| MeshFormat::of(Path::new(name));
        assert_eq!(
            [of("a.ply"), of("a.b.GLB"), of("-")],
            [MeshFormat::Ply, MeshFormat::Glb, MeshFormat::Ply].map(Some)
        );
        assert_eq!((of("a.obj"), of("a.stl"), of("a.ply.gz")), (Some(MeshFormat::Obj), None, None));
        for format in [MeshFormat::Ply, MeshFormat::Glb, MeshFormat::Obj] {
            assert!(MeshFormat::is_own(&format.format(&Mesh::default(), YAxis::AsIs).unwrap()));
        }
    }
}
