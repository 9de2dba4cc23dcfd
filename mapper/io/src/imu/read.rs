//! The files of an IMU.

use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::{ImuRecording, TimedVector};
use crate::FileError;
use crate::text_lines::{Line, TextFile};

/// Which form a file has.
#[derive(Clone, Copy)]
enum Form {
    /// Columns by their names, seconds.
    Named,
    /// Nanoseconds, three rates, three specific forces.
    Euroc,
    /// Seconds, three specific forces.
    TumAccelerometer,
}

/// Files and forms; the first that has a sensor counts.
const FILES: [(&str, Form); 5] = [
    ("imu.csv", Form::Named),
    ("imu0/data.csv", Form::Euroc),
    ("mav0/imu0/data.csv", Form::Euroc),
    ("gyro.csv", Form::Named),
    ("accelerometer.txt", Form::TumAccelerometer),
];

/// Samples of the two sensors in one file.
#[derive(Default)]
struct Samples {
    angular_velocities: Vec<TimedVector>,
    specific_forces: Vec<TimedVector>,
}

/// What the files in the folder hold, in the axes of the camera; nothing if there are none.
///
/// # Errors
///
/// [`FileError`] with file and line.
pub(crate) fn read_folder(
    folder: &Path,
    imu_from_camera: Option<&Rotation3<f64>>,
) -> Result<Option<ImuRecording>, FileError> {
    let (mut rates, mut forces) = (Vec::new(), Vec::new());
    for (name, form) in FILES {
        let path: PathBuf = folder.join(name);
        if !path.is_file() {
            continue;
        }
        let Samples { angular_velocities, specific_forces } = read(&path, form)?;
        // Everything is turned into the axes of the camera.
        let camera_from_imu = imu_from_camera.copied().unwrap_or_else(|| usual_axes(form)).inverse();
        let read = ImuRecording::new(angular_velocities, specific_forces).seen_from(&camera_from_imu);
        // The first file that has something counts.
        if rates.is_empty() {
            rates = read.angular_velocities().to_vec();
        }
        if forces.is_empty() {
            forces = read.specific_forces().to_vec();
        }
    }
    let is_empty = rates.is_empty() && forces.is_empty();
    Ok((!is_empty).then(|| ImuRecording::new(rates, forces)))
}

/// `imu_from_camera` where the calibration says nothing.
fn usual_axes(form: Form) -> Rotation3<f64> {
    match form {
        Form::Named | Form::Euroc => Rotation3::identity(),
        // The accelerometer of the Kinect; the recorded truth of freiburg1_rpy agrees within 4 degrees.
        Form::TumAccelerometer => {
            Rotation3::from_matrix_unchecked(Matrix3::from_diagonal(&Vector3::new(-1.0, -1.0, 1.0)))
        }
    }
}

fn read(path: &Path, form: Form) -> Result<Samples, FileError> {
    let file = TextFile::read(path)?;
    match form {
        Form::Named => read_named(&file, path),
        Form::Euroc => collect(file.lines(), |line| {
            let numbers =
                line.numbers("nanoseconds, three rates in rad/s, three specific forces in m/s^2")?;
            let [nanoseconds, wx, wy, wz, ax, ay, az] = numbers;
            Ok((nanoseconds * 1e-9, Some([wx, wy, wz]), Some([ax, ay, az])))
        }),
        Form::TumAccelerometer => collect(file.lines(), |line| {
            let [time, ax, ay, az] = line.numbers("timestamp ax ay az")?;
            Ok((time, None, Some([ax, ay, az])))
        }),
    }
}

/// Time, angular velocity and specific force of one line.
type Row = (f64, Option<[f64; 3]>, Option<[f64; 3]>);

/// Collects lines whose times do not decrease.
fn collect<'a>(
    lines: impl Iterator<Item = Line<'a>>,
    parse: impl Fn(&Line<'_>) -> Result<Row, FileError>,
) -> Result<Samples, FileError> {
    let mut samples = Samples::default();
    let mut latest = None;
    for line in lines {
        let (time, rate, force) = parse(&line)?;
        // Sensors that are read more often than they measure say things twice.
        if latest != Some(time) {
            line.check_order(time, latest)?;
        }
        latest = Some(time);
        let timed = |value: [f64; 3]| TimedVector { time, value: Vector3::from(value) };
        samples.angular_velocities.extend(rate.map(timed));
        samples.specific_forces.extend(force.map(timed));
    }
    Ok(samples)
}

const RATE_COLUMNS: [&str; 3] = ["wx_rad_s", "wy_rad_s", "wz_rad_s"];
const FORCE_COLUMNS: [&str; 3] = ["ax_m_s2", "ay_m_s2", "az_m_s2"];

fn read_named(file: &TextFile, path: &Path) -> Result<Samples, FileError> {
    const HEADER: &str =
        "a header line with timestamp and wx_rad_s,wy_rad_s,wz_rad_s or ax_m_s2,ay_m_s2,az_m_s2 or both";
    const ROW: &str = "as many finite numbers as the header has columns";
    let mut lines = file.lines();
    let header = lines.next().ok_or_else(|| FileError::MalformedLine {
        path: path.to_owned(),
        line: 1,
        found: String::new(),
        expected: HEADER,
    })?;
    let names: Vec<&str> = header.text.split(',').map(str::trim).collect();
    let position = |name: &str| names.iter().position(|column| *column == name);
    let positions = |columns: [&str; 3]| match columns.map(position) {
        [Some(x), Some(y), Some(z)] => Some([x, y, z]),
        _ => None,
    };
    let (rates, forces) = (positions(RATE_COLUMNS), positions(FORCE_COLUMNS));
    // A file may hold one of the two sensors, or both.
    let time = position("timestamp").filter(|_| rates.is_some() || forces.is_some());
    let Some(time) = time else { return Err(header.malformed(HEADER)) };
    collect(lines, |line| {
        let fields: Vec<&str> = line.text.split(',').map(str::trim).collect();
        if fields.len() != names.len() {
            return Err(line.malformed(ROW));
        }
        let number = |column: usize| line.number(fields[column], ROW);
        let vector = |columns: [usize; 3]| {
            let [x, y, z] = columns.map(number);
            Ok::<_, FileError>([x?, y?, z?])
        };
        Ok((number(time)?, rates.map(vector).transpose()?, forces.map(vector).transpose()?))
    })
}
