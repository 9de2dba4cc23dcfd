//! Trajectories in the form of the EuRoC MAV data set's `state_groundtruth_estimate0/data.csv` (Burri et al., "The EuRoC
//! micro aerial vehicle datasets", IJRR 2016), without velocities and biases.
//!
//! Rows `timestamp, px, py, pz, qw, qx, qy, qz`: whole nanoseconds, metres and the unit quaternion from the camera (C) to
//! the world (W). EuRoC's own rows are of its sensor (S) in a reference frame (R), which the header tells apart.

use std::fmt::Write as _;

use super::PosedFrame;

/// The header.
const HEADER: &str =
    "#timestamp [ns],p_WC_x [m],p_WC_y [m],p_WC_z [m],q_WC_w [],q_WC_x [],q_WC_y [],q_WC_z []\n";

/// Times of a run are whole microseconds.
const MICROSECONDS: f64 = 1e6;

/// The text of a trajectory, poses with twelve decimals.
#[must_use]
pub fn format_euroc(frames: &[PosedFrame]) -> String {
    let mut text = HEADER.to_owned();
    for frame in frames {
        let (p, q) = (frame.world_from_camera.translation, frame.world_from_camera.rotation);
        // A double has too few digits for the nanoseconds of a date.
        let nanoseconds = 1000 * i128::from((frame.timestamp * MICROSECONDS).round() as i64);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{nanoseconds},{:.12},{:.12},{:.12},{:.12},{:.12},{:.12},{:.12}",
            p.x, p.y, p.z, q.w, q.i, q.j, q.k
        );
    }
    text
}

/// Whether a file that begins with `start` is one of [`format_euroc`].
#[must_use]
pub fn is_own_euroc(start: &[u8]) -> bool {
    start.starts_with(HEADER.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::super::poses::sample_frame;
    use super::*;

    #[test]
    fn a_row_has_nanoseconds_metres_and_the_quaternion_with_w_first() {
        let dated = PosedFrame { timestamp: 1_305_031_102.175_304, ..sample_frame() };
        let text = format_euroc(&[sample_frame(), dated]);
        let rows: Vec<&str> = text.lines().skip(1).collect();
        let pose = "1.000000000000,2.000000000000,3.000000000000,\
             0.707106781187,0.000000000000,0.000000000000,0.707106781187";
        assert_eq!(rows, [format!("12500000000,{pose}"), format!("1305031102175304000,{pose}")]);
        assert!(is_own_euroc(text.as_bytes()) && !is_own_euroc(b"#timestamp, p_RS_R_x [m]"));
    }

    #[test]
    fn absurd_times_are_no_panic() {
        let late = PosedFrame { timestamp: 1e300, ..sample_frame() };
        assert!(format_euroc(&[late]).contains(&format!("\n{}000,", i64::MAX)));
    }
}
