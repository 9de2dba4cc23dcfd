//! Stray Scanner: `camera_matrix.csv`, `odometry.csv`, `depth/` and `confidence/` of 256 x 192 pixels, and the colour video
//! `rgb.mp4`, or its images in `rgb/`.

use std::path::{Path, PathBuf};

use mba_io::text_lines::TextFile;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};

use super::camera;
use crate::destination::Destination;
use crate::facts::Facts;
use crate::format::{Format, Reading, files, first_file, stem};
use crate::picture::Picture;
use crate::time::Time;
use crate::{ImportError, pose};

pub(crate) const FORMAT: Format = Format {
    name: "Stray Scanner",
    looked_for: "camera_matrix.csv and odometry.csv",
    recognise: |path| path.join("camera_matrix.csv").is_file() && path.join("odometry.csv").is_file(),
    read,
};

/// A line of `odometry.csv`.
struct Row {
    time: Time,
    frame: String,
    world_from_camera: Option<RigidTransform>,
    /// fx, fy, cx, cy of this very frame, which newer versions write.
    intrinsics: Option<[f64; 4]>,
}

fn read(reading: &Reading<'_>, destination: &mut Destination) -> Result<Facts, ImportError> {
    let folder = reading.path;
    let images = colour_images(folder)?;
    let rows = odometry(&folder.join("odometry.csv"))?;
    let shared = camera_matrix(&folder.join("camera_matrix.csv"))?;
    let mut cameras = Vec::new();
    reading.each(&rows, |row| {
        let colour = images.iter().find(|path| same_number(&stem(path), &row.frame));
        let depth = folder.join("depth").join(format!("{}.png", row.frame));
        let (Some(colour), true) = (colour, depth.is_file()) else {
            destination.note("frames without a colour or a depth image are left out");
            return Ok(());
        };
        destination.add_colour(row.time, &Picture::File(colour.clone()), colour)?;
        let name = destination.add_depth(row.time, &Picture::File(depth.clone()), &depth)?;
        let confidence = folder.join("confidence").join(format!("{}.png", row.frame));
        if confidence.is_file() {
            destination.add_confidence(&name, &Picture::File(confidence.clone()), &confidence)?;
        }
        destination.poses.extend(row.world_from_camera.map(|pose| (row.time, pose)));
        let (width, height) = destination.colour_size().unwrap_or_default();
        // Newer recordings have the camera of every frame, older ones one for all.
        let [fx, fy, cx, cy] = row.intrinsics.unwrap_or(shared);
        cameras.push(PinholeCamera { width, height, fx, fy, cx, cy });
        Ok(())
    })?;
    if folder.join("imu.csv").is_file() {
        destination.note("imu.csv is left out: the app does not say which way its axes point");
    }
    let camera = camera::median(cameras, destination, &folder.join("camera_matrix.csv"))?;
    Ok(Facts::new(camera, 1000.0).telephone())
}

/// The images of `rgb/`; the video has to be unpacked first.
fn colour_images(folder: &Path) -> Result<Vec<PathBuf>, ImportError> {
    let images = folder.join("rgb");
    if images.is_dir() {
        return files(&images, "", &[".jpg", ".jpeg", ".png"]);
    }
    let video = first_file([folder.join("rgb.mp4")]);
    let Some(video) = video else {
        return Err(ImportError::unusable(
            folder,
            "it has neither rgb/ nor rgb.mp4",
            "copy all of the recording",
        ));
    };
    let place = folder.display();
    Err(ImportError::unusable(
        &video,
        "colour is a video, which mba does not decode",
        format!(
            "mkdir {place}/rgb && ffmpeg -i {place}/rgb.mp4 -vsync 0 -start_number 0 -q:v 1 {place}/rgb/%06d.jpg"
        ),
    ))
}

/// Whether two names are the same number, with any zeros before it.
fn same_number(a: &str, b: &str) -> bool {
    a == b || matches!((a.parse::<u32>(), b.parse::<u32>()), (Ok(a), Ok(b)) if a == b)
}

fn odometry(path: &Path) -> Result<Vec<Row>, ImportError> {
    const EXPECTED: &str = "timestamp, frame, x, y, z, qx, qy, qz, qw";
    let file = TextFile::read(path)?;
    // The first line names the columns.
    file.lines()
        .skip(1)
        .map(|line| {
            let fields: Vec<&str> = line.text.split(',').map(str::trim).collect();
            let [time, frame, pose @ ..] = fields.as_slice() else {
                return Err(line.malformed(EXPECTED).into());
            };
            let numbers: Vec<f64> =
                pose.iter().map(|field| line.number(field, EXPECTED)).collect::<Result<_, _>>()?;
            let &[x, y, z, qx, qy, qz, qw, ref more @ ..] = numbers.as_slice() else {
                return Err(line.malformed(EXPECTED).into());
            };
            let time =
                Time::from_seconds(line.number(time, EXPECTED)?).ok_or_else(|| line.malformed(EXPECTED))?;
            Ok(Row {
                time,
                frame: (*frame).to_owned(),
                world_from_camera: pose::from_quaternion([x, y, z], [qx, qy, qz, qw]),
                intrinsics: more.first_chunk().copied(),
            })
        })
        .collect()
}

/// fx, fy, cx, cy of three lines of three numbers.
fn camera_matrix(path: &Path) -> Result<[f64; 4], ImportError> {
    let file = TextFile::read(path)?;
    let rows: Vec<[f64; 3]> = file
        .lines()
        .map(|line| line.numbers("three numbers of a camera matrix"))
        .collect::<Result<_, _>>()?;
    match rows.as_slice() {
        [[fx, _, cx], [_, fy, cy], _] => Ok([*fx, *fy, *cx, *cy]),
        _ => Err(ImportError::damaged(path, "it should have three lines of three numbers")),
    }
}
