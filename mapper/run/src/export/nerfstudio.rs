//! The data sets of nerfstudio: `transforms.json` beside `images/`, `depth/` and a cloud of points
//! (<https://docs.nerf.studio/quickstart/data_conventions.html>).
//!
//! `transform_matrix` goes from the camera to the world. Cameras have the axes of OpenGL: x right, y up, looking along -z,
//! so that the second and third column change sign. The world is that of the run. The top-left corner of an image is
//! (0, 0), the centre of its first pixel (0.5, 0.5). Depth is along the optical axis in millimetres: readers differ in
//! whether they look at `depth_unit_scale_factor`, and those that do not take a thousandth.

use serde::Serialize;

use super::kitti::matrix_rows;
use super::{PIXEL_CENTRE, PosedFrame, image_name};
use crate::run::RunCamera;

/// Name of the file of cameras.
pub const TRANSFORMS_FILE: &str = "transforms.json";

/// Name of the cloud of points.
pub const POINTS_FILE: &str = "sparse_pc.ply";

/// Metres per unit of depth.
pub const DEPTH_UNIT: f64 = 0.001;

/// What the file holds, in its order.
#[derive(Serialize)]
struct Transforms {
    camera_model: &'static str,
    w: usize,
    h: usize,
    fl_x: f64,
    fl_y: f64,
    cx: f64,
    cy: f64,
    k1: f64,
    k2: f64,
    p1: f64,
    p2: f64,
    depth_unit_scale_factor: f64,
    ply_file_path: &'static str,
    frames: Vec<Frame>,
}

#[derive(Serialize)]
struct Frame {
    file_path: String,
    depth_file_path: String,
    timestamp: f64,
    transform_matrix: [[f64; 4]; 4],
}

/// The text of the file: the undistorted camera and, for every frame, its image, its depth and its pose.
#[must_use]
pub fn format_transforms(camera: &RunCamera, frames: &[PosedFrame]) -> String {
    let transforms = Transforms {
        camera_model: "OPENCV",
        w: camera.width,
        h: camera.height,
        fl_x: camera.fx,
        fl_y: camera.fy,
        cx: camera.cx + PIXEL_CENTRE,
        cy: camera.cy + PIXEL_CENTRE,
        k1: 0.0,
        k2: 0.0,
        p1: 0.0,
        p2: 0.0,
        depth_unit_scale_factor: DEPTH_UNIT,
        ply_file_path: POINTS_FILE,
        frames: frames.iter().map(Frame::from).collect(),
    };
    // Strings and finite numbers always have a text.
    serde_json::to_string_pretty(&transforms).unwrap_or_default() + "\n"
}

impl From<&PosedFrame> for Frame {
    fn from(frame: &PosedFrame) -> Self {
        let [x, y, z] = matrix_rows(&frame.world_from_camera).map(|[x, y, z, p]| [x, -y, -z, p]);
        Self {
            file_path: format!("images/{}", image_name(frame)),
            depth_file_path: format!("depth/{}", image_name(frame)),
            timestamp: frame.timestamp,
            transform_matrix: [x, y, z, [0.0, 0.0, 0.0, 1.0]],
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::poses::sample_frame;
    use super::*;

    #[test]
    fn cameras_look_along_minus_z_and_pixels_have_their_centre_at_one_half() {
        let camera = RunCamera { fy: 101.25, cx: 31.0, ..RunCamera::simple(64, 48, 100.0) };
        let text = format_transforms(&camera, &[sample_frame()]);
        let found: Value = serde_json::from_str(&text).unwrap();
        let [w, h, fl_x, fl_y, cx, cy] = ["w", "h", "fl_x", "fl_y", "cx", "cy"].map(|key| &found[key]);
        assert_eq!((w, h), (&json!(64), &json!(48)));
        assert_eq!((fl_x, fl_y, cx, cy), (&json!(100.0), &json!(101.25), &json!(31.5), &json!(24.0)));
        assert_eq!((&found["depth_unit_scale_factor"], &found["k1"]), (&json!(0.001), &json!(0.0)));
        let frame = &found["frames"][0];
        assert_eq!((&frame["file_path"], &frame["timestamp"]), (&json!("images/000007.png"), &json!(12.5)));
        assert_eq!(frame["depth_file_path"], "depth/000007.png");
        // Right is the world's y; up, against the camera's y, is its x; backwards is its -z.
        let expected = [[0, 1, 0, 1], [1, 0, 0, 2], [0, 0, -1, 3], [0, 0, 0, 1]];
        for (row, expected) in expected.iter().enumerate() {
            for (column, expected) in expected.iter().enumerate() {
                let value = frame["transform_matrix"][row][column].as_f64().unwrap();
                assert!((value - f64::from(*expected)).abs() < 1e-15, "{row}, {column}: {value}");
            }
        }
    }
}
