//! Models of COLMAP as binary files, `cameras.bin`, `images.bin` and `points3D.bin`, beside those of [text](super::colmap) with
//! the same content: programs differ in which they read.
//!
//! All numbers are little-endian. Counts and sizes have 8 bytes, numbers of cameras and images 4, of points 8; all others are
//! doubles but for colours and names, which end with a zero.

use mba_mesh::Mesh;

use super::{PIXEL_CENTRE, PosedFrame, image_name};
use crate::run::RunCamera;

/// Name of the binary file of cameras.
pub const BINARY_CAMERAS_FILE: &str = "sparse/0/cameras.bin";

/// Name of the binary file of images.
pub const BINARY_IMAGES_FILE: &str = "sparse/0/images.bin";

/// Name of the binary file of points.
pub const BINARY_POINTS3D_FILE: &str = "sparse/0/points3D.bin";

/// The number of the camera model PINHOLE.
const PINHOLE: i32 = 1;

/// The file of cameras: one that is undistorted.
#[must_use]
pub fn format_cameras_binary(camera: &RunCamera) -> Vec<u8> {
    let mut bytes = count(1);
    bytes.extend(1_u32.to_le_bytes());
    bytes.extend(PINHOLE.to_le_bytes());
    bytes.extend([camera.width, camera.height].into_iter().flat_map(count));
    let numbers = [camera.fx, camera.fy, camera.cx + PIXEL_CENTRE, camera.cy + PIXEL_CENTRE];
    bytes.extend(numbers.into_iter().flat_map(f64::to_le_bytes));
    bytes
}

/// The file of images: poses from the world to the camera, without points.
#[must_use]
pub fn format_images_binary(frames: &[PosedFrame]) -> Vec<u8> {
    let mut bytes = count(frames.len());
    for (number, frame) in (1_u32..).zip(frames) {
        let camera_from_world = frame.world_from_camera.inverse();
        let (p, q) = (camera_from_world.translation, camera_from_world.rotation);
        bytes.extend(number.to_le_bytes());
        bytes.extend([q.w, q.i, q.j, q.k, p.x, p.y, p.z].into_iter().flat_map(f64::to_le_bytes));
        bytes.extend(1_u32.to_le_bytes());
        bytes.extend(image_name(frame).into_bytes());
        bytes.push(0);
        bytes.extend(count(0));
    }
    bytes
}

/// The file of points, without errors of reprojection and tracks.
#[must_use]
pub fn format_points3d_binary(cloud: &Mesh) -> Vec<u8> {
    let mut bytes = count(cloud.vertices.len());
    for (number, (place, colour)) in (1_u64..).zip(cloud.vertices.iter().zip(&cloud.colours)) {
        bytes.extend(number.to_le_bytes());
        bytes.extend(place.iter().flat_map(|x| f64::from(*x).to_le_bytes()));
        bytes.extend(colour);
        bytes.extend(0.0_f64.to_le_bytes());
        bytes.extend(count(0));
    }
    bytes
}

fn count(count: usize) -> Vec<u8> {
    (count as u64).to_le_bytes().to_vec()
}

#[cfg(test)]
mod tests {
    use super::super::poses::sample_frame;
    use super::*;

    fn numbers(bytes: &[u8]) -> Vec<f64> {
        bytes.chunks_exact(8).map(|eight| f64::from_le_bytes(eight.try_into().unwrap())).collect()
    }

    #[test]
    fn a_camera_has_56_bytes_behind_the_count() {
        let camera = RunCamera { fy: 101.25, cx: 31.0, ..RunCamera::simple(64, 48, 100.0) };
        let bytes = format_cameras_binary(&camera);
        assert_eq!(bytes.len(), 8 + 56);
        assert_eq!(bytes[..16], [1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]);
        assert_eq!((bytes[16], bytes[24]), (64, 48));
        assert_eq!(numbers(&bytes[32..]), [100.0, 101.25, 31.5, 24.0]);
    }

    #[test]
    fn an_image_has_its_pose_from_the_world_and_its_name() {
        let frame = sample_frame();
        let bytes = format_images_binary(&[frame]);
        let name = image_name(&sample_frame());
        assert_eq!(bytes.len(), 8 + 4 + 56 + 4 + name.len() + 1 + 8);
        let found = numbers(&bytes[12..68]);
        let half = 0.5_f64.sqrt();
        // The inverse turns by -90 degrees about z, so that the world's origin is at (-2, 1, -3).
        for (found, expected) in found.iter().zip([half, 0.0, 0.0, -half, -2.0, 1.0, -3.0]) {
            assert!((found - expected).abs() < 1e-12, "{found} instead of {expected}");
        }
        assert_eq!(bytes[72..72 + name.len()], *name.as_bytes());
    }

    #[test]
    fn a_point_has_51_bytes() {
        let cloud =
            Mesh { vertices: vec![[1.0, -2.0, 3.5]], colours: vec![[255, 51, 0]], triangles: Vec::new() };
        let bytes = format_points3d_binary(&cloud);
        assert_eq!(bytes.len(), 8 + 51);
        assert_eq!(numbers(&bytes[16..40]), [1.0, -2.0, 3.5]);
        assert_eq!((bytes[8], &bytes[40..43]), (1, &[255, 51, 0][..]));
    }
}
