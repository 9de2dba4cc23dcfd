//! Trajectories in the format of the KITTI odometry benchmark (Geiger et al., "Are we ready for autonomous driving?",
//! CVPR 2012).
//!
//! A row of `poses.txt` is the upper 3x4 part of the matrix from the camera to the world, row by row, in metres. The
//! camera looks along z, x is right and y down. The same row of `times.txt` is its time in seconds. KITTI has a row for
//! every frame; here the times tell which frames there are.

use std::fmt::Write as _;

use mba_tracker::geometry::RigidTransform;

use super::PosedFrame;

/// Name of the file of poses.
pub const POSES_FILE: &str = "poses.txt";

/// Name of the file of times.
pub const TIMES_FILE: &str = "times.txt";

/// The text of the poses, twelve decimals.
#[must_use]
pub fn format_kitti_poses(frames: &[PosedFrame]) -> String {
    let mut text = String::new();
    for frame in frames {
        let rows = matrix_rows(&frame.world_from_camera);
        let numbers: Vec<String> = rows.as_flattened().iter().map(|value| format!("{value:.12}")).collect();
        text += &numbers.join(" ");
        text.push('\n');
    }
    text
}

/// The text of the times, six decimals.
#[must_use]
pub fn format_kitti_times(frames: &[PosedFrame]) -> String {
    let mut text = String::new();
    for frame in frames {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{:.6}", frame.timestamp);
    }
    text
}

/// The upper three rows of the matrix of a transform.
pub(super) fn matrix_rows(pose: &RigidTransform) -> [[f64; 4]; 3] {
    let (r, p) = (pose.rotation_matrix(), pose.translation);
    std::array::from_fn(|row| [r[(row, 0)], r[(row, 1)], r[(row, 2)], p[row]])
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::super::poses::sample_frame;
    use super::*;

    #[test]
    fn a_row_is_the_matrix_from_camera_to_world() {
        // Its x goes to z, y to x and z to y.
        let third = 2.0 * std::f64::consts::FRAC_PI_3;
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::repeat(-third / 3.0_f64.sqrt()));
        let mut frame = sample_frame();
        frame.world_from_camera.rotation = rotation;
        let text = format_kitti_poses(&[frame]).replace("-0.0", "0.0");
        let expected = [[0, 1, 0, 1], [0, 0, 1, 2], [1, 0, 0, 3]];
        let numbers: Vec<String> =
            expected.as_flattened().iter().map(|value| format!("{value}.000000000000")).collect();
        assert_eq!(text, numbers.join(" ") + "\n");
        assert_eq!(format_kitti_times(&[frame]), "12.500000\n");
    }
}
