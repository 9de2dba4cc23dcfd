//! Meshes of coloured triangles: what they are, their files (PLY, GLB, OBJ), and the depth that a camera sees of one.

mod depth_image;
mod file;
mod simplify;
mod triangles;

pub use depth_image::depth_image;
pub use file::{
    MeshFormat, MeshTooLarge, YAxis, format_mesh, is_own_mesh, parse_mesh, read_mesh, write_mesh,
};
pub use mba_io::ply::PlyError;
pub use triangles::Mesh;
