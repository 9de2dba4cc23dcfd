//! Trajectories in the format of the TUM RGB-D benchmark (Sturm et al., "A benchmark for the evaluation of RGB-D SLAM
//! systems", IROS 2012).
//!
//! Lines `timestamp tx ty tz qx qy qz qw`: seconds, metres and the unit quaternion from the camera to the world. The
//! camera looks along z, x is right and y down. Lines with `#` are comments.

use std::fmt::Write as _;

use super::PosedFrame;

/// The first line.
const TITLE: &str =
    "# mba export: timestamp tx ty tz qx qy qz qw (seconds, metres, camera-to-world at mid exposure)\n";

/// The text of a trajectory: timestamps with six decimals, poses with twelve.
#[must_use]
pub fn format_tum(frames: &[PosedFrame]) -> String {
    let mut text = TITLE.to_owned();
    for frame in frames {
        let (p, q) = (frame.world_from_camera.translation, frame.world_from_camera.rotation);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:.6} {:.12} {:.12} {:.12} {:.12} {:.12} {:.12} {:.12}",
            frame.timestamp, p.x, p.y, p.z, q.i, q.j, q.k, q.w
        );
    }
    text
}

/// Whether a file that begins with `start` is one of [`format_tum`].
#[must_use]
pub fn is_own_tum(start: &[u8]) -> bool {
    start.starts_with(TITLE.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::super::poses::sample_frame;
    use super::*;

    #[test]
    fn a_line_has_seconds_metres_and_the_quaternion_with_w_last() {
        let text = format_tum(&[sample_frame()]);
        let (title, line) = text.split_once('\n').unwrap();
        assert!(title.starts_with('#') && is_own_tum(text.as_bytes()));
        assert_eq!(
            line,
            "12.500000 1.000000000000 2.000000000000 3.000000000000 \
             0.000000000000 0.000000000000 0.707106781187 0.707106781187\n"
        );
        // The trajectory of a run is another file.
        assert!(!is_own_tum(b"# timestamp tx ty tz qx qy qz qw (camera-to-world at mid exposure)\n"));
    }
}
