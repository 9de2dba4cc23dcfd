//! Maps and meshes.

use std::cell::RefCell;
use std::path::Path;

use mba_mapper::evaluation::evaluate_surface;
use mba_mapper::gaussians::{Gaussians, parse_ply};
use mba_mapper::mesh::{depth_image, format_mesh, parse_mesh};
use mba_mapper::rendering::{Behind, ViewRenderer};
use mba_mapper::surfaces::sample_surface;
use mba_mapper::triplane::read_field;
use mba_tracker::SimdLevel;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::photometric::InverseResponse;

use super::place::{Kept, in_place};

const CAMERA: PinholeCamera = PinholeCamera { width: 16, height: 12, fx: 14.0, fy: 14.0, cx: 7.5, cy: 5.5 };

/// Records up to which a map or mesh is not only read but used.
const FEW: usize = 64;

/// Where the checksum of a field is, and from where on it counts.
const FIELD_CHECKSUM: core::ops::Range<usize> = 12..16;

/// `map.ply`, and a view of it.
pub fn gaussians(data: &[u8]) {
    let Ok(map) = parse_ply(Path::new("map.ply"), data) else { return };
    assert!(map.len() <= data.len());
    if map.len() <= FEW {
        render(&map);
    }
}

fn render(map: &Gaussians) {
    let mut renderer = ViewRenderer::new(SimdLevel::new(), map, CAMERA, &InverseResponse::srgb(), 1000.0);
    let view = renderer.render(&RigidTransform::identity(), Behind::Surroundings);
    assert!((0.0..=1.0).contains(&view.solid), "{}", view.solid);
}

/// A mesh or cloud of points, and what `mba eval mesh` does with it.
pub fn mesh(data: &[u8]) {
    let Ok(mesh) = parse_mesh(Path::new("mesh.ply"), data) else { return };
    assert!(mesh.vertices.len() <= data.len() && mesh.triangles.len() <= data.len());
    if mesh.vertices.len() > FEW || mesh.triangles.len() > FEW {
        return;
    }
    let points = sample_surface(&mesh, FEW);
    assert!(points.len() <= FEW.max(mesh.vertices.len()));
    let _ = evaluate_surface(&points, &mesh.vertices, &[1.0]);
    let _ = depth_image(&mesh, &CAMERA, &RigidTransform::identity());
    let again = parse_mesh(Path::new("again.ply"), &format_mesh(&mesh)).expect("what was written is read");
    assert_eq!(again.triangles, mesh.triangles);
}

/// `map.mbaf`, with a checksum that is made right, and a view of it.
pub fn field(data: &[u8]) {
    thread_local!(static KEPT: Kept = const { RefCell::new(None) });
    let mut bytes = data.to_vec();
    if bytes.len() > FIELD_CHECKSUM.end {
        let checksum = crc32fast::hash(&bytes[FIELD_CHECKSUM.end..]);
        bytes[FIELD_CHECKSUM].copy_from_slice(&checksum.to_le_bytes());
    }
    in_place(
        &KEPT,
        |_| (),
        |place| {
            let path = place.write("map.mbaf", &bytes);
            let Ok(field) = read_field(&path) else { return };
            assert!(field.bytes() <= 8 * bytes.len() + (1 << 20));
            let mut renderer =
                ViewRenderer::new(SimdLevel::new(), &field, CAMERA, &InverseResponse::srgb(), 1000.0);
            let _ = renderer.render(&RigidTransform::identity(), Behind::Black);
        },
    );
}
