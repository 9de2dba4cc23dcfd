//! Meshes and clouds of points as PLY files, which are read too, and meshes as GLB and OBJ files.

mod format;
mod glb;
mod obj;
mod read;
mod write;

pub use format::MeshFormat;
pub use glb::{MeshTooLarge, YAxis};
pub use read::{parse_mesh, read_mesh};
pub use write::{format_mesh, is_own_mesh, write_mesh};

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::triangles::Mesh;
    use mba_io::ply::PlyError;

    fn square() -> Mesh {
        Mesh {
            vertices: vec![[0.0, 0.5, 1e-7], [1.0, 0.0, 0.0], [1.0, 1.0, -3.25], [0.0, 1.0, 0.1]],
            colours: vec![[0, 1, 2], [255, 254, 253], [9; 3], [128; 3]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    fn parse(text: &[u8]) -> Result<Mesh, PlyError> {
        parse_mesh(Path::new("mesh.ply"), text)
    }

    fn message(text: &str) -> String {
        parse(text.as_bytes()).expect_err("the file is damaged").to_string()
    }

    #[test]
    fn a_mesh_returns_from_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.ply");
        let plain = Mesh { colours: Vec::new(), ..square() };
        let cloud = Mesh { triangles: Vec::new(), ..square() };
        for mesh in [square(), plain, cloud, Mesh::default()] {
            write_mesh(&path, &mesh).unwrap();
            assert_eq!(read_mesh(&path).unwrap(), mesh);
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "a partial file is left");
    }

    /// A quadrilateral of other types, with properties and elements in between.
    const TEXT: &str = "ply\nformat ascii 1.0\nelement camera 1\nproperty float fx\nelement vertex 4\n\
        property uchar blue\nproperty double z\nproperty float confidence\nproperty int y\nproperty float x\n\
        property uchar green\nproperty uchar red\nelement face 1\nproperty uchar flags\n\
        property list uchar uint vertex_index\nelement tail 1\nproperty int end\nend_header\n\
        500\n2 0.25 nan 1 0 1 0\n\n5 0.5 1 2 3 4 3\n8 0.75 1 2 4 7 6\n11 1 1 2 5 10 9\n1 4 0 1 2 3\n7\n";

    #[test]
    fn other_writers_files_are_read() {
        let expected = Mesh {
            vertices: vec![[0.0, 1.0, 0.25], [3.0, 2.0, 0.5], [4.0, 2.0, 0.75], [5.0, 2.0, 1.0]],
            colours: vec![[0, 1, 2], [3, 4, 5], [6, 7, 8], [9, 10, 11]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        assert_eq!(parse(TEXT.as_bytes()).unwrap(), expected);
    }

    #[test]
    fn damaged_files_are_named() {
        let with = |from: &str, to: &str| message(&TEXT.replace(from, to));
        assert!(with("property float x\n", "").contains("vertices have no property \"x\""));
        assert!(with("vertex_index", "corners").contains("faces have no property \"vertex_indices\""));
        assert!(with("element vertex", "element point").contains("none of the 0 vertices"));
        assert!(with("8 0.75", "8 inf").contains("vertex 2: z is \"inf\""));
        assert!(
            with("1 4 0 1 2 3", "1 4 0 1 2 4").contains("face 0: corner \"4\" is none of the 4 vertices")
        );
        assert!(with("1 4 0 1 2 3", "1 4 0 1 -2 3").contains("corner \"-2\""));
        assert!(with("1 4 0 1 2 3", "1 5 0 1 2 3").contains("face 0: vertex_index is \"\""));
        assert!(with("tail 1", "tail 2").contains("announces 2 tails, the file ends after 1"));
        assert!(with("list uchar", "list quad").contains("expected a known type"));
        assert!(message("# a mesh\n").contains("not a PLY file"));
        assert!(read_mesh(Path::new("absent.ply")).unwrap_err().to_string().contains("absent.ply"));
    }

    #[test]
    fn announced_sizes_are_not_believed() {
        let huge = u64::MAX.to_string();
        let count = |element: &str| {
            message(&TEXT.replace(element, &format!("{} {huge}", &element[..element.len() - 2])))
        };
        assert!(count("vertex 4").contains("vertex 5: z"), "{}", count("vertex 4"));
        assert!(count("tail 1").contains("ends after 1"));
        let empty = "ply\nformat ascii 1.0\nelement nothing 18446744073709551615\nelement vertex 0\n\
            property float x\nproperty float y\nproperty float z\nend_header\n";
        assert_eq!(parse(empty.as_bytes()).unwrap(), Mesh::default());
        let mut bytes = format_mesh(&square());
        let length = bytes.len() - 13;
        bytes[length] = 255;
        assert!(parse(&bytes).unwrap_err().to_string().contains("announces 2 faces, the file ends after 1"));
    }
}
