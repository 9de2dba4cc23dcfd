//! Covariances of poses, and their file.

use std::fmt::Write as _;

use mba_io::trajectory_file::TimedExposure;
use mba_tracker::geometry::RigidTransform;
use nalgebra::Matrix6;

/// The first line of the file.
const HEADER: &str = "# timestamp, then the covariance of the pose at mid exposure, six rows of six: tx ty tz in world axes (m), \
                      then rx ry rz in the camera's (rad)\n";

/// The covariances as text, a line for each frame that has one. Numbers have ten digits: so rounding leaves a matrix positive
/// definite whose directions are as different as those of a plain wall.
pub(super) fn format_covariances(
    exposures: &[TimedExposure],
    covariances: &[Option<Matrix6<f64>>],
) -> String {
    let mut text = HEADER.to_owned();
    for (exposure, covariance) in exposures.iter().zip(covariances) {
        let Some(covariance) = covariance else { continue };
        // Writing to a string cannot fail.
        let _ = write!(text, "{:.6}", exposure.timestamp);
        for number in covariance.transpose().iter() {
            let _ = write!(text, " {number:.9e}");
        }
        text.push('\n');
    }
    text
}

/// A covariance in another world. The rotation, in the camera's axes, does not know of worlds.
pub(super) fn turned(covariance: &Matrix6<f64>, new_world_from_world: &RigidTransform) -> Matrix6<f64> {
    let mut turn = Matrix6::identity();
    turn.fixed_view_mut::<3, 3>(0, 0).copy_from(&new_world_from_world.rotation_matrix());
    let turned = turn * covariance * turn.transpose();
    // Rounding leaves the halves a little different.
    (turned + turned.transpose()) * 0.5
}

#[cfg(test)]
mod tests {
    use mba_tracker::FrameStatus;
    use mba_tracker::geometry::so3;
    use nalgebra::{Vector3, Vector6};

    use super::super::{FrameRecord, RunCamera, RunSettings, RunWriter};
    use super::*;

    #[test]
    fn covariances_turn_with_the_world_and_frames_without_have_no_line() {
        let folder = tempfile::tempdir().unwrap();
        let camera = Some(RunCamera::simple(64, 48, 50.0));
        let (program, dataset) = (String::new(), String::new());
        let settings =
            RunSettings { program, dataset, frame_rate: 32.0, camera, options: Default::default() };
        let mut writer = RunWriter::create_in(folder.path(), settings).unwrap();
        for timestamp in [0.0, 0.03125, 0.0625] {
            let [start, mid, end] = [RigidTransform::identity(); 3];
            let record = FrameRecord::without_figures(timestamp, FrameStatus::Ok);
            writer.push(TimedExposure { timestamp, start, mid, end }, record).unwrap();
        }
        // Errors along x and about the camera's y that go together.
        let mut covariance = Matrix6::from_diagonal(&Vector6::new(2.0, 1.0, 1.0, 1.0, 2.0, 1.0));
        (covariance[(0, 4)], covariance[(4, 0)]) = (1.0, 1.0);
        writer.record_mut().set_covariances(vec![None, Some(covariance), None]);
        // x becomes y.
        let quarter = Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2);
        let turn = RigidTransform::new(so3::exp(&quarter), Vector3::new(5.0, 0.0, 0.0));
        writer.record_mut().move_world(|_| turn);
        let path = writer.folder().join(mba_io::run_layout::COVARIANCES_FILE);
        writer.finish(|_| ()).unwrap();
        let text = std::fs::read_to_string(path).unwrap();
        let lines: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
        let [line] = lines[..] else { panic!("{text}") };
        let numbers: Vec<f64> = line.split(' ').map(|number| number.parse().unwrap()).collect();
        assert_eq!(numbers[0], 0.03125);
        let found = Matrix6::from_row_slice(&numbers[1..]);
        let mut expected = Matrix6::from_diagonal(&Vector6::new(1.0, 2.0, 1.0, 1.0, 2.0, 1.0));
        (expected[(1, 4)], expected[(4, 1)]) = (1.0, 1.0);
        assert!((found - expected).amax() < 1e-12, "{found}");
    }
}
