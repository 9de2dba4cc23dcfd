//! Models of COLMAP as text: `cameras.txt`, `images.txt` and `points3D.txt` in `sparse/0`, beside `images/`
//! (<https://colmap.github.io/format.html>).
//!
//! A pose is the quaternion `qw qx qy qz` and the translation from the world to the camera, which looks along z with x to
//! the right and y down. The top-left corner of an image is (0, 0), the centre of its first pixel (0.5, 0.5). Numbers of
//! cameras, images and points start with 1. Points have no tracks.

use std::fmt::Write as _;

use mba_mesh::Mesh;

use super::{PIXEL_CENTRE, PosedFrame, image_name};
use crate::run::RunCamera;

/// Name of the file of cameras.
pub const CAMERAS_FILE: &str = "sparse/0/cameras.txt";

/// Name of the file of images.
pub const IMAGES_FILE: &str = "sparse/0/images.txt";

/// Name of the file of points.
pub const POINTS3D_FILE: &str = "sparse/0/points3D.txt";

/// The text of the file of cameras: one that is undistorted.
#[must_use]
pub fn format_cameras(camera: &RunCamera) -> String {
    let RunCamera { width, height, fx, fy, cx, cy, .. } = camera;
    let (cx, cy) = (cx + PIXEL_CENTRE, cy + PIXEL_CENTRE);
    format!(
        "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n# Number of cameras: 1\n\
         1 PINHOLE {width} {height} {fx} {fy} {cx} {cy}\n"
    )
}

/// The text of the file of images: two lines per frame, the second, for points, empty. Twelve decimals.
#[must_use]
pub fn format_images(frames: &[PosedFrame]) -> String {
    let mut text = format!(
        "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[] as (X, Y, POINT3D_ID)\n\
         # Number of images: {}, mean observations per image: 0\n",
        frames.len()
    );
    for (index, frame) in frames.iter().enumerate() {
        let camera_from_world = frame.world_from_camera.inverse();
        let (p, q) = (camera_from_world.translation, camera_from_world.rotation);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{} {:.12} {:.12} {:.12} {:.12} {:.12} {:.12} {:.12} 1 {}\n",
            index + 1,
            q.w,
            q.i,
            q.j,
            q.k,
            p.x,
            p.y,
            p.z,
            image_name(frame)
        );
    }
    text
}

/// The text of the file of points, without errors of reprojection and tracks.
#[must_use]
pub fn format_points3d(cloud: &Mesh) -> String {
    let mut text = format!(
        "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n\
         # Number of points: {}, mean track length: 0\n",
        cloud.vertices.len()
    );
    for (index, ([x, y, z], [r, g, b])) in cloud.vertices.iter().zip(&cloud.colours).enumerate() {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{} {x} {y} {z} {r} {g} {b} 0", index + 1);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::poses::sample_frame;
    use super::*;

    #[test]
    fn pixels_have_their_centre_at_one_half() {
        let camera = RunCamera { fy: 101.25, cx: 31.0, ..RunCamera::simple(64, 48, 100.0) };
        assert_eq!(format_cameras(&camera).lines().last(), Some("1 PINHOLE 64 48 100 101.25 31.5 24"));
    }

    #[test]
    fn poses_go_from_the_world_to_the_camera() {
        let text = format_images(&[sample_frame()]);
        let lines: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
        // The inverse turns by -90 degrees about z: (x, y) becomes (y, -x), so that the world's origin is at (-2, 1, -3).
        assert_eq!(lines.len(), 2);
        assert_eq!(lines[1], "");
        let words: Vec<&str> = lines[0].split(' ').collect();
        assert_eq!((words[0], words[8], words[9]), ("1", "1", "000007.png"));
        let numbers: Vec<f64> = words[1..8].iter().map(|word| word.parse().unwrap()).collect();
        let half = 0.5_f64.sqrt();
        for (number, expected) in numbers.iter().zip([half, 0.0, 0.0, -half, -2.0, 1.0, -3.0]) {
            assert!((number - expected).abs() < 1e-12, "{numbers:?}");
        }
    }

    #[test]
    fn points_have_colours_and_no_tracks() {
        let cloud = Mesh {
            vertices: vec![[0.5, -0.25, 2.0], [0.1, 1e-7, 3.0]],
            colours: vec![[1, 2, 3], [255, 0, 128]],
            triangles: Vec::new(),
        };
        let text = format_points3d(&cloud);
        let lines: Vec<&str> = text.lines().skip(2).collect();
        assert_eq!(lines, ["1 0.5 -0.25 2 1 2 3 0", "2 0.1 0.0000001 3 255 0 128 0"]);
    }
}
