//! Trajectories as text: TUM lines with one pose per frame, and exposure lines with three.
//!
//! All poses are `world_from_camera`: translation in metres, then the unit quaternion as `qx qy qz qw`. Lines
//! starting with `#` are comments.

use std::fmt::Write as _;
use std::path::Path;

use mba_tracker::geometry::RigidTransform;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::FileError;
use crate::pose_matrix::pose_from_rows;
use crate::text_lines::{Line, TextFile};
use crate::whole_file::write_text;

/// How far the length of a quaternion in a file may be from 1; what is accepted is normalised.
///
/// The TUM ground truth has four decimals, which leaves errors near 1e-4; a wrong order of the columns or a
/// rotation vector in place of the quaternion is off by far more.
pub const QUATERNION_LENGTH_TOLERANCE: f64 = 1e-2;

/// The camera's pose at one instant, one line of a TUM trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedPose {
    /// Seconds; mid exposure for a frame's pose.
    pub timestamp: f64,
    /// The camera's pose in the world.
    pub world_from_camera: RigidTransform,
}

/// The camera's poses during the exposure of one frame, all `world_from_camera`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedExposure {
    /// Mid exposure, seconds.
    pub timestamp: f64,
    /// Pose at shutter opening.
    pub start: RigidTransform,
    /// Pose at mid exposure.
    pub mid: RigidTransform,
    /// Pose at shutter closing.
    pub end: RigidTransform,
}

impl TimedExposure {
    /// The same exposure in another world.
    #[must_use]
    pub fn seen_from(&self, other_from_world: &RigidTransform) -> Self {
        let [start, mid, end] = [self.start, self.mid, self.end].map(|pose| other_from_world.compose(&pose));
        Self { timestamp: self.timestamp, start, mid, end }
    }
}

/// Reads a trajectory: lines `timestamp tx ty tz qx qy qz qw` of TUM with increasing timestamps. Lines of nanoseconds,
/// position and quaternion with w first, as EuRoC's ground truth has them, and lines of 16 numbers, as Replica's `traj.txt`
/// has them at 30 per second, are told by the first of them.
///
/// # Errors
///
/// [`FileError`] if the file is unreadable, a line malformed, a number not finite, a quaternion further than
/// [`QUATERNION_LENGTH_TOLERANCE`] from unit length, or timestamps are doubled or out of order.
pub fn read_trajectory(path: &Path) -> Result<Vec<TimedPose>, FileError> {
    let file = TextFile::read(path)?;
    match Form::of(&file) {
        Form::Tum => parsed(&file, POSE_LINE, pose_of_line).collect(),
        Form::Euroc => in_order(file.lines().map(|line| Ok((line, pose_of_euroc(&line)?)))),
        Form::Matrices => in_order(file.lines().enumerate().map(|(index, line)| {
            let rows = line.numbers("the 16 numbers of a 4x4 camera-to-world matrix, row by row")?;
            let world_from_camera = pose_from_rows(&rows, path, line.number)?;
            Ok((line, TimedPose { timestamp: index as f64 / MATRIX_RATE, world_from_camera }))
        })),
    }
}

/// Lines per second of a trajectory without times: those of Replica as rendered for NICE-SLAM.
const MATRIX_RATE: f64 = 30.0;

/// Least number that is taken for a time in nanoseconds: half a day, or 12 million years in seconds.
const LEAST_NANOSECONDS: f64 = 4e13;

/// How a trajectory is written.
enum Form {
    Tum,
    Euroc,
    Matrices,
}

impl Form {
    fn of(file: &TextFile) -> Self {
        let Some(first) = file.lines().next() else { return Self::Tum };
        let time = first.fields().next().and_then(|field| field.parse().ok());
        match first.fields().count() {
            16 if time.is_none_or(|time| time < LEAST_NANOSECONDS) => Self::Matrices,
            8.. if time.is_some_and(|time: f64| time >= LEAST_NANOSECONDS) => Self::Euroc,
            _ => Self::Tum,
        }
    }
}

/// Poses in order of time.
fn in_order<'a>(
    poses: impl Iterator<Item = Result<(Line<'a>, TimedPose), FileError>>,
) -> Result<Vec<TimedPose>, FileError> {
    let mut previous = None;
    poses
        .map(|pose| {
            let (line, pose) = pose?;
            line.check_order(pose.timestamp, previous)?;
            previous = Some(pose.timestamp);
            Ok(pose)
        })
        .collect()
}

/// Nanoseconds, position, quaternion with w first, and more columns that are not read.
fn pose_of_euroc(line: &Line<'_>) -> Result<TimedPose, FileError> {
    const EXPECTED: &str = "nanoseconds, position x y z, quaternion w x y z";
    let mut fields = line.fields();
    let mut next = || line.number(fields.next().ok_or_else(|| line.malformed(EXPECTED))?, EXPECTED);
    let nanoseconds = next()?;
    let [x, y, z] = [next()?, next()?, next()?];
    let [qw, qx, qy, qz] = [next()?, next()?, next()?, next()?];
    let world_from_camera = pose_from_numbers(line, &[x, y, z, qx, qy, qz, qw])?;
    Ok(TimedPose { timestamp: nanoseconds * 1e-9, world_from_camera })
}

/// A trajectory that was recorded, lines that are no poses left out.
#[derive(Debug)]
pub struct Recorded<T> {
    /// In order of time.
    pub poses: Vec<T>,
    /// How many lines are left out.
    pub left_out: usize,
    /// What is wrong with the first of them.
    pub first_error: Option<FileError>,
}

/// As [`read_trajectory`], but only an unreadable file is an error.
pub(crate) fn read_recorded_trajectory(path: &Path) -> Result<Recorded<TimedPose>, FileError> {
    sound(path, POSE_LINE, pose_of_line)
}

/// As [`read_exposures`], but only an unreadable file is an error.
pub(crate) fn read_recorded_exposures(path: &Path) -> Result<Recorded<TimedExposure>, FileError> {
    sound(path, EXPOSURE_LINE, exposure_of_line)
}

/// Reads exposure lines: `timestamp`, then `tx ty tz qx qy qz qw` at opening, mid exposure and closing.
///
/// # Errors
///
/// As [`read_trajectory`].
pub fn read_exposures(path: &Path) -> Result<Vec<TimedExposure>, FileError> {
    let file = TextFile::read(path)?;
    parsed(&file, EXPOSURE_LINE, exposure_of_line).collect()
}

/// Whether the first line of numbers of a file is one of exposures, with three poses, rather than one of a trajectory.
///
/// # Errors
///
/// [`FileError`] if the file is unreadable.
pub fn has_exposures(path: &Path) -> Result<bool, FileError> {
    const NUMBERS_PER_EXPOSURE: usize = 22;
    let file = TextFile::read(path)?;
    Ok(file.lines().next().is_some_and(|line| line.fields().count() == NUMBERS_PER_EXPOSURE))
}

/// Writes a TUM trajectory, timestamps with six decimals and poses with nine. The file appears whole or not at
/// all.
///
/// # Errors
///
/// [`FileError::Unwritable`].
pub fn write_trajectory(path: &Path, poses: &[TimedPose]) -> Result<(), FileError> {
    write_text(path, &format_trajectory(poses))
}

/// The text of [`write_trajectory`].
pub fn format_trajectory(poses: &[TimedPose]) -> String {
    let mut text = String::from("# timestamp tx ty tz qx qy qz qw (camera-to-world at mid exposure)\n");
    for pose in poses {
        push_timestamp(&mut text, pose.timestamp);
        push_pose(&mut text, &pose.world_from_camera);
        text.push('\n');
    }
    text
}

/// Writes exposure lines in the format of [`read_exposures`]; precision and atomicity as [`write_trajectory`].
///
/// # Errors
///
/// [`FileError::Unwritable`].
pub fn write_exposures(path: &Path, exposures: &[TimedExposure]) -> Result<(), FileError> {
    write_text(path, &format_exposures(exposures))
}

/// The text of [`write_exposures`].
pub fn format_exposures(exposures: &[TimedExposure]) -> String {
    let mut text = String::from(
        "# timestamp, then tx ty tz qx qy qz qw at exposure start, mid, end (camera-to-world)\n",
    );
    for exposure in exposures {
        push_timestamp(&mut text, exposure.timestamp);
        for pose in [&exposure.start, &exposure.mid, &exposure.end] {
            push_pose(&mut text, pose);
        }
        text.push('\n');
    }
    text
}

/// Form of a line of a trajectory.
const POSE_LINE: &str = "timestamp tx ty tz qx qy qz qw";

/// Form of a line of exposures.
const EXPOSURE_LINE: &str = "timestamp and three poses tx ty tz qx qy qz qw (22 numbers)";

fn pose_of_line(line: &Line<'_>, numbers: [f64; 8]) -> Result<TimedPose, FileError> {
    let [timestamp, pose @ ..] = numbers;
    Ok(TimedPose { timestamp, world_from_camera: pose_from_numbers(line, &pose)? })
}

fn exposure_of_line(line: &Line<'_>, numbers: [f64; 22]) -> Result<TimedExposure, FileError> {
    Ok(TimedExposure {
        timestamp: numbers[0],
        start: pose_from_numbers(line, &numbers[1..8])?,
        mid: pose_from_numbers(line, &numbers[8..15])?,
        end: pose_from_numbers(line, &numbers[15..22])?,
    })
}

/// Every line as `N` numbers, the first of which is the timestamp, and as a value. Times increase over the lines that are
/// good.
fn parsed<'a, const N: usize, T>(
    file: &'a TextFile,
    expected: &'static str,
    parse: impl Fn(&Line<'_>, [f64; N]) -> Result<T, FileError> + 'a,
) -> impl Iterator<Item = Result<T, FileError>> + 'a {
    let mut previous = None;
    file.lines().map(move |line| {
        let numbers = line.numbers(expected)?;
        line.check_order(numbers[0], previous)?;
        let value = parse(&line, numbers)?;
        previous = Some(numbers[0]);
        Ok(value)
    })
}

fn sound<const N: usize, T>(
    path: &Path,
    expected: &'static str,
    parse: impl Fn(&Line<'_>, [f64; N]) -> Result<T, FileError>,
) -> Result<Recorded<T>, FileError> {
    let file = TextFile::read(path)?;
    let mut recorded = Recorded { poses: Vec::new(), left_out: 0, first_error: None };
    for line in parsed(&file, expected, parse) {
        match line {
            Ok(pose) => recorded.poses.push(pose),
            Err(error) => {
                recorded.left_out += 1;
                recorded.first_error.get_or_insert(error);
            }
        }
    }
    Ok(recorded)
}

/// The pose of the seven finite numbers `tx ty tz qx qy qz qw`.
fn pose_from_numbers(line: &Line<'_>, numbers: &[f64]) -> Result<RigidTransform, FileError> {
    let quaternion = Quaternion::new(numbers[6], numbers[3], numbers[4], numbers[5]);
    let norm = quaternion.norm();
    if (norm - 1.0).abs() > QUATERNION_LENGTH_TOLERANCE {
        return Err(FileError::NotUnitQuaternion { path: line.path().to_owned(), line: line.number, norm });
    }
    let translation = Vector3::new(numbers[0], numbers[1], numbers[2]);
    Ok(RigidTransform::new(UnitQuaternion::new_normalize(quaternion), translation))
}

fn push_timestamp(text: &mut String, timestamp: f64) {
    // Writing to a string cannot fail.
    let _ = write!(text, "{timestamp:.6}");
}

fn push_pose(text: &mut String, pose: &RigidTransform) {
    for value in pose.translation.iter().chain(pose.rotation.coords.iter()) {
        let _ = write!(text, " {value:.9}");
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn message(text: &str) -> String {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), text).unwrap();
        let message = read_trajectory(file.path()).unwrap_err().to_string();
        message.replace(&file.path().display().to_string(), "FILE")
    }

    fn sample_pose(angle: f64) -> RigidTransform {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -angle, 0.2));
        RigidTransform::new(rotation, Vector3::new(1.25, -angle, 1e-3))
    }

    #[test]
    fn columns_are_translation_then_quaternion_with_w_last() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let half = 0.5_f64.sqrt();
        let text =
            format!("# comment\n\n  1305031229.0333\t1 2 3 0 0 {half} {half}\n1305031230,4,5,6,0,0,0,-1\n");
        fs::write(file.path(), text).unwrap();
        let poses = read_trajectory(file.path()).unwrap();
        assert_eq!(poses.len(), 2);
        assert_eq!(poses[0].timestamp, 1305031229.0333);
        // A quarter turn about z takes x to y.
        let image = poses[0].world_from_camera.transform_point(&Vector3::x());
        assert!((image - Vector3::new(1.0, 3.0, 3.0)).norm() < 1e-12);
        assert!(poses[1].world_from_camera.rotation.angle() < 1e-12);
    }

    #[test]
    fn references_of_euroc_and_replica_are_told_by_their_first_line() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let half = 0.5_f64.sqrt();
        let row = |time: u64| format!("{time},1,2,3,{half},0,0,{half},0.1,0.2,0.3,0,0,0,0,0,0\n");
        let header = "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], ...\n";
        fs::write(
            file.path(),
            format!("{header}{}{}", row(1_403_636_580_838_555_648), row(1_403_636_580_843_555_648)),
        )
        .unwrap();
        let euroc = read_trajectory(file.path()).unwrap();
        assert_eq!(euroc[1].timestamp, 1_403_636_580.843_555_7);
        let matrix = "0 -1 0 1 1 0 0 2 0 0 1 3 0 0 0 1\n";
        fs::write(file.path(), matrix.repeat(2)).unwrap();
        let replica = read_trajectory(file.path()).unwrap();
        assert_eq!((replica.len(), replica[1].timestamp), (2, 1.0 / 30.0));
        // A quarter turn about z takes x to y in both.
        for pose in [euroc[0], replica[0]] {
            let image = pose.world_from_camera.transform_point(&Vector3::x());
            assert!((image - Vector3::new(1.0, 3.0, 3.0)).norm() < 1e-12, "{image}");
        }
        assert!(
            message(&format!("{matrix}0 -1 0\n"))
                .starts_with("FILE, line 2: expected the 16 numbers of a 4x4")
        );
        assert!(message(&row(1_403_636_580_838_555_648).repeat(2)).contains("line 2: timestamp"));
    }

    #[test]
    fn rounded_quaternions_are_normalised() {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), "0 0 0 0 0.6853 0.5405 -0.0074 -0.4921\n").unwrap();
        let pose = read_trajectory(file.path()).unwrap()[0].world_from_camera;
        assert!((pose.rotation.coords.norm() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn written_files_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trajectory.txt");
        let poses = [0.1, 0.7].map(|t| TimedPose { timestamp: 1e9 + t, world_from_camera: sample_pose(t) });
        write_trajectory(&path, &poses).unwrap();
        for (read, written) in read_trajectory(&path).unwrap().iter().zip(&poses) {
            assert!((read.timestamp - written.timestamp).abs() < 1e-6);
            assert!(read.world_from_camera.tangent_to(&written.world_from_camera).norm() < 4e-9);
        }

        let exposures = [TimedExposure {
            timestamp: 0.1,
            start: sample_pose(0.1),
            mid: sample_pose(0.2),
            end: sample_pose(0.3),
        }];
        write_exposures(&path, &exposures).unwrap();
        let read = read_exposures(&path).unwrap()[0];
        assert_eq!(read.timestamp, 0.1);
        for (read, written) in [(read.start, 0.1), (read.mid, 0.2), (read.end, 0.3)] {
            assert!(read.tangent_to(&sample_pose(written)).norm() < 4e-9);
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no partial file is left");
    }

    #[test]
    fn messages_name_file_line_and_value() {
        assert_eq!(
            message("# c\n1 0 0 0 0 0 0 1\n2 0 0 0 0 0 1\n"),
            "FILE, line 3: expected timestamp tx ty tz qx qy qz qw, found \"2 0 0 0 0 0 1\""
        );
        assert_eq!(
            message("1 0 0 x 0 0 0 1"),
            "FILE, line 1: expected timestamp tx ty tz qx qy qz qw, found \"1 0 0 x 0 0 0 1\""
        );
        assert_eq!(message("1 0 nan 0 0 0 0 1"), "FILE, line 1: nan is not a finite number");
        assert_eq!(
            message("1 0 0 0 0 0 0.5 0.5"),
            "FILE, line 1: the quaternion has length 0.7071, expected 1; \
             the order of a pose is tx ty tz qx qy qz qw"
        );
        assert_eq!(
            message("2 0 0 0 0 0 0 1\n\n1.5 0 0 0 0 0 0 1"),
            "FILE, line 3: timestamp 1.5 comes after 2; sort the lines by time, \
             or move the file away if it is not needed"
        );
        assert_eq!(
            message("1305031229.5 0 0 0 0 0 0 1\n1305031229.50 0 0 0 0 0 0 1"),
            "FILE, line 2: timestamp 1305031229.5 occurs twice; remove one of the lines"
        );
    }

    #[test]
    fn exposure_lines_have_22_numbers() {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), "1 0 0 0 0 0 0 1\n").unwrap();
        let message = read_exposures(file.path()).unwrap_err().to_string();
        assert!(message.contains("line 1: expected timestamp and three poses"), "{message}");
    }

    #[test]
    fn files_that_cannot_be_read_or_written_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("missing/trajectory.txt");
        let read = read_trajectory(&path).unwrap_err().to_string();
        assert!(read.starts_with(&format!("cannot read {}: ", path.display())), "{read}");
        let written = write_trajectory(&path, &[]).unwrap_err().to_string();
        assert!(written.starts_with(&format!("cannot write {}: ", path.display())), "{written}");
    }
}
