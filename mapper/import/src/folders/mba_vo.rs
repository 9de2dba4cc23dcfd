//! Sequences of MBA-VO (Liu et al., ICCV 2021), which Unreal rendered with severe blur, ArchViz among them: `rgb_blur/` and
//! `rgb_sharp_middle/` with colour, `depth_sharp_middle/` with distances along the rays as text, `im_list.txt` with the times
//! of images, `groundtruth.txt` with poses of the body that carries the camera, and a `.json`, the configuration of their
//! program, with the camera.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mba_io::dataset::Shutter;
use mba_io::text_lines::{Line, TextFile};
use mba_io::whole_file::read_text;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use serde::Deserialize;

use crate::destination::Destination;
use crate::facts::Facts;
use crate::format::{Format, Reading, files, first_file, read_json, stem};
use crate::picture::{Picture, UNITS_OF_METRES, metres_png};
use crate::time::Time;
use crate::{ImportError, pose};

pub(crate) const FORMAT: Format = Format {
    name: "MBA-VO, ArchViz",
    looked_for: "rgb_blur/, depth_sharp_middle/ and groundtruth.txt",
    recognise: |path| path.join(BLURRED).is_dir() && path.join(DEPTH).is_dir() && path.join(TRUTH).is_file(),
    read,
};

const BLURRED: &str = "rgb_blur";
const SHARP: &str = "rgb_sharp_middle";
const DEPTH: &str = "depth_sharp_middle";
const TRUTH: &str = "groundtruth.txt";
const TIMES: &str = "im_list.txt";

/// Distances from here on are the sky, metres.
const SKY: f64 = 100.0;

/// The file with the camera.
#[derive(Debug, Deserialize)]
struct Settings {
    #[serde(rename = "Configuration")]
    configuration: Configuration,
}

/// What it says of the camera; without it that of ArchViz.
#[derive(Debug, Deserialize)]
#[serde(default)]
struct Configuration {
    #[serde(rename = "W")]
    width: usize,
    #[serde(rename = "H")]
    height: usize,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    /// Between frames, seconds.
    dt_frame: f64,
    /// Seconds.
    exposure_time: f64,
    // From the camera to the axes of the body.
    #[serde(rename = "extrinsic_Rb2w_qw")]
    qw: f64,
    #[serde(rename = "extrinsic_Rb2w_qx")]
    qx: f64,
    #[serde(rename = "extrinsic_Rb2w_qy")]
    qy: f64,
    #[serde(rename = "extrinsic_Rb2w_qz")]
    qz: f64,
}

impl Default for Configuration {
    fn default() -> Self {
        Self {
            width: 768,
            height: 480,
            fx: 548.409,
            fy: 548.409,
            cx: 384.0,
            cy: 240.0,
            dt_frame: 0.0369,
            exposure_time: 0.015_628_8,
            // The body has x ahead, y left and z up.
            qw: 0.5,
            qx: -0.5,
            qy: 0.5,
            qz: -0.5,
        }
    }
}

impl Configuration {
    fn camera(&self) -> PinholeCamera {
        let Self { width, height, fx, fy, cx, cy, .. } = *self;
        PinholeCamera { width, height, fx, fy, cx, cy }
    }

    fn body_from_camera(&self, path: &Path) -> Result<RigidTransform, ImportError> {
        let quaternion = [self.qx, self.qy, self.qz, self.qw];
        pose::from_quaternion([0.0; 3], quaternion)
            .ok_or_else(|| ImportError::damaged(path, "extrinsic_Rb2w is no rotation"))
    }
}

fn read(reading: &Reading<'_>, destination: &mut Destination) -> Result<Facts, ImportError> {
    let folder = reading.path;
    let found = files(folder, "", &[".json"])?;
    let (path, configuration) = match found.first() {
        Some(path) => (path.as_path(), read_json::<Settings>(path)?.configuration),
        None => {
            destination.note(
                "there is no .json with a Configuration: camera and exposure time are those of ArchViz",
            );
            (folder, Configuration::default())
        }
    };
    let images = timed_images(folder, configuration.dt_frame, destination)?;
    let camera = configuration.camera();
    reading.each(&images, |(time, image)| frame(*time, image, folder, &camera, destination))?;
    read_truth(&folder.join(TRUTH), &configuration.body_from_camera(path)?, destination)?;
    // Rendered, so that all rows are of one moment.
    let mut facts = Facts::new(camera, UNITS_OF_METRES);
    facts.frame_rate = (configuration.dt_frame > 0.0).then(|| 1.0 / configuration.dt_frame);
    facts.exposure_seconds = Some(configuration.exposure_time);
    facts.readout = Some(Shutter::Global);
    Ok(facts)
}

/// The blurred images with their times, in the order of time.
fn timed_images(
    folder: &Path,
    interval: f64,
    destination: &mut Destination,
) -> Result<Vec<(Time, PathBuf)>, ImportError> {
    let images = files(&folder.join(BLURRED), "", &[".png", ".jpg", ".jpeg"])?;
    let list = folder.join(TIMES);
    let times = if list.is_file() { listed_times(&list)? } else { BTreeMap::new() };
    let mut timed = Vec::new();
    for path in images {
        let Ok(number) = stem(&path).parse::<u32>() else { continue };
        let time = match times.get(&number) {
            Some(time) => *time,
            None if times.is_empty() => {
                destination.note(format!("there are no times of images: one every {interval} s is assumed"));
                Time::from_seconds(f64::from(number) * interval)
                    .ok_or_else(|| ImportError::damaged(&path, "its number is no time"))?
            }
            None => {
                destination.note(format!("images that are not in {TIMES} are left out"));
                continue;
            }
        };
        timed.push((time, path));
    }
    timed.sort();
    Ok(timed)
}

/// Times by the number of the image: lines with an image or its number, and with its time, one before the other.
fn listed_times(path: &Path) -> Result<BTreeMap<u32, Time>, ImportError> {
    const EXPECTED: &str = "image time, or time image";
    let file = TextFile::read(path)?;
    let mut times = BTreeMap::new();
    for line in file.lines() {
        let fields: Vec<&str> = line.fields().collect();
        let &[first, second] = fields.as_slice() else { return Err(line.malformed(EXPECTED).into()) };
        let number = |field: &str| stem(Path::new(field)).parse::<u32>().ok();
        // A time has a decimal point, which looks like the ending of a name.
        let is_time = |field: &str| field.contains('.') && field.parse::<f64>().is_ok();
        let (image, time) =
            if is_time(first) && !is_time(second) { (second, first) } else { (first, second) };
        let time = Time::from_seconds(line.number(time, EXPECTED)?);
        let (Some(number), Some(time)) = (number(image), time) else {
            return Err(line.malformed(EXPECTED).into());
        };
        times.insert(number, time);
    }
    Ok(times)
}

fn frame(
    time: Time,
    image: &Path,
    folder: &Path,
    camera: &PinholeCamera,
    destination: &mut Destination,
) -> Result<(), ImportError> {
    let name = stem(image);
    let depth = folder.join(DEPTH).join(format!("{name}.depth"));
    if !depth.is_file() {
        destination.note(format!("images without a file in {DEPTH} are left out"));
        return Ok(());
    }
    let stored = destination.add_colour(time, &Picture::File(image.to_owned()), image)?;
    let (png, beyond) = metres_png((camera.width, camera.height), along_axis(&depth, camera)?.into_iter())
        .map_err(|error| ImportError::damaged(&depth, error.to_string()))?;
    if beyond > 0 {
        destination.note("depth beyond 13 m is left out");
    }
    destination.add_depth(time, &Picture::Encoded(png), &depth)?;
    let sharp = ["png", "jpg", "jpeg"].map(|ending| folder.join(SHARP).join(format!("{name}.{ending}")));
    first_file(sharp).map_or(Ok(()), |sharp| destination.add_sharp(&stored, &sharp))
}

/// Depth along the axis of the camera, metres, of a text with distances along the rays; not a number where there is none.
fn along_axis(path: &Path, camera: &PinholeCamera) -> Result<Vec<f32>, ImportError> {
    let text = read_text(path)?;
    let distances: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
    let distances = distances.map_err(|_| ImportError::damaged(path, "it should have numbers only"))?;
    let expected = camera.width.checked_mul(camera.height);
    if expected != Some(distances.len()) {
        let (count, width, height) = (distances.len(), camera.width, camera.height);
        return Err(ImportError::damaged(path, format!("it has {count} numbers, not {width} x {height}")));
    }
    let of_pixel = |(index, distance): (usize, f64)| {
        if distance > SKY {
            return f32::NAN;
        }
        let ray = camera.ray((index % camera.width) as f64, (index / camera.width) as f64);
        (distance / ray.norm()) as f32
    };
    Ok(distances.into_iter().enumerate().map(of_pixel).collect())
}

/// Lines of time, quaternion with w last, and position of the body, and more numbers that are not read: the axes of its
/// accelerometer are not documented.
fn read_truth(
    path: &Path,
    body_from_camera: &RigidTransform,
    destination: &mut Destination,
) -> Result<(), ImportError> {
    const EXPECTED: &str = "time qx qy qz qw x y z";
    let file = TextFile::read(path)?;
    for line in file.lines() {
        let [time, qx, qy, qz, qw, x, y, z] = first_numbers(&line, EXPECTED)?;
        let pose = pose::from_quaternion([x, y, z], [qx, qy, qz, qw]);
        let (Some(time), Some(world_from_body)) = (Time::from_seconds(time), pose) else {
            return Err(line.malformed(EXPECTED).into());
        };
        destination.poses.push((time, world_from_body.compose(body_from_camera)));
    }
    Ok(())
}

fn first_numbers<const N: usize>(line: &Line<'_>, expected: &'static str) -> Result<[f64; N], ImportError> {
    let numbers: Result<Vec<f64>, _> =
        line.fields().take(N).map(|field| line.number(field, expected)).collect();
    numbers?.try_into().map_err(|_| line.malformed(expected).into())
}
