//! Runs in the formats of other programs.
//!
//! | format | what is written | pose | where |
//! |---|---|---|---|
//! | [TUM](format_tum) | a file of poses | camera to world, quaternion with w last | every frame |
//! | [EuRoC](format_euroc) | a file of poses | camera to world, quaternion with w first | every frame |
//! | [KITTI](format_kitti_poses) | poses and times | camera to world, 3x4 matrix | every frame |
//! | [nerfstudio](format_transforms) | images, depth, points, cameras | camera to world, 4x4 matrix, axes of OpenGL | keyframes or every frame |
//! | [COLMAP](format_images) | images, points, cameras, as text and [binary](format_images_binary) | world to camera, quaternion with w first | keyframes or every frame |
//!
//! All of them get the poses at mid exposure, in the world of the run, in metres. Lost frames are left out. Images are
//! undistorted; those of keyframes are the deblurred ones where the run has them.

mod colmap;
mod colmap_binary;
mod error;
mod euroc;
mod frame_images;
mod kitti;
mod nerfstudio;
mod points;
mod poses;
mod scene;
#[cfg(test)]
mod tests;
mod tum;

pub use colmap::{CAMERAS_FILE, IMAGES_FILE, POINTS3D_FILE, format_cameras, format_images, format_points3d};
pub use colmap_binary::{
    BINARY_CAMERAS_FILE, BINARY_IMAGES_FILE, BINARY_POINTS3D_FILE, format_cameras_binary,
    format_images_binary, format_points3d_binary,
};
pub use error::ExportError;
pub use euroc::{format_euroc, is_own_euroc};
pub use kitti::{POSES_FILE, TIMES_FILE, format_kitti_poses, format_kitti_times};
pub use nerfstudio::{DEPTH_UNIT, POINTS_FILE, TRANSFORMS_FILE, format_transforms};
pub use points::cloud_of_gaussians;
pub use poses::{PosedFrame, PosedFrames};
pub use scene::{ExportedImages, SceneExport, SceneLayout};
pub use tum::{format_tum, is_own_tum};

/// The centre of the top-left pixel where its corner is (0, 0); here it is (0, 0) itself.
const PIXEL_CENTRE: f64 = 0.5;

/// Name of a frame's images: its index in the data set.
fn image_name(frame: &PosedFrame) -> String {
    format!("{:06}.png", frame.index)
}
