//! 7-Scenes (Shotton et al., CVPR 2013) and BundleFusion (Dai et al., TOG 2017): `frame-000000.color.png`,
//! `frame-000000.depth.png` and `frame-000000.pose.txt`, and for BundleFusion `info.txt` with the cameras.

use std::collections::HashMap;
use std::path::Path;

use mba_io::dataset::{DepthCamera, Shutter};
use mba_io::text_lines::TextFile;
use mba_io::whole_file::read_text;
use mba_tracker::geometry::{Distortion, PinholeCamera, RigidTransform};
use nalgebra::Vector3;

use crate::destination::Destination;
use crate::facts::Facts;
use crate::format::{Format, Reading, files, first_file};
use crate::picture::Picture;
use crate::time::Time;
use crate::{ImportError, pose};

pub(crate) const FORMAT: Format = Format {
    name: "7-Scenes, BundleFusion",
    looked_for: "frame-*.color.png and frame-*.depth.png",
    recognise: |path| {
        ["png", "jpg"].iter().any(|ending| path.join(format!("frame-000000.color.{ending}")).is_file())
    },
    read,
};

/// Frames per second of both.
const FRAME_RATE: f64 = 30.0;

fn read(reading: &Reading<'_>, destination: &mut Destination) -> Result<Facts, ImportError> {
    let folder = reading.path;
    let info = first_file([folder.join("info.txt"), folder.join("_info.txt")]);
    let mut facts = match &info {
        Some(path) => bundle_fusion(path)?,
        None => {
            destination.note(
                "there is no info.txt: the cameras are those of 7-Scenes, 525 and 585 px, the depth camera 26 mm beside",
            );
            seven_scenes()
        }
    };
    destination.note("frames have no times: 30 per second are assumed");
    facts.frame_rate = Some(FRAME_RATE);
    facts.readout = Some(Shutter::Rolling { seconds: None });
    // Poses are those of the depth camera.
    let depth_from_colour =
        facts.depth_camera.map_or_else(RigidTransform::identity, |depth| depth.colour_from_depth.inverse());
    let colours = files(folder, "frame-", &[".color.png", ".color.jpg"])?;
    reading.each(&colours, |colour| frame(colour, &depth_from_colour, destination))?;
    Ok(facts)
}

fn frame(
    colour: &Path,
    depth_from_colour: &RigidTransform,
    destination: &mut Destination,
) -> Result<(), ImportError> {
    let name = colour.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    // `frame-000123.color.png` lies beside `frame-000123.depth.png` and `frame-000123.pose.txt`.
    let stem = name.split('.').next().unwrap_or_default().to_owned();
    let number = stem.strip_prefix("frame-").and_then(|number| number.parse::<u32>().ok());
    let (Some(number), depth) = (number, colour.with_file_name(format!("{stem}.depth.png"))) else {
        return Ok(());
    };
    if !depth.is_file() {
        destination.note("colour images without a depth image are left out");
        return Ok(());
    }
    let time = Time::from_seconds(f64::from(number) / FRAME_RATE)
        .ok_or_else(|| ImportError::damaged(colour, "its number is no time"))?;
    destination.add_colour(time, &Picture::File(colour.to_owned()), colour)?;
    destination.add_depth(time, &Picture::File(depth.clone()), &depth)?;
    let path = colour.with_file_name(format!("{stem}.pose.txt"));
    if path.is_file() {
        match pose_of(&path)? {
            Some(world_from_depth) => {
                destination.poses.push((time, world_from_depth.compose(depth_from_colour)))
            }
            None => destination.note("some poses are none, and are left out"),
        }
    }
    Ok(())
}

/// Four lines of four numbers, infinite where the camera was lost.
fn pose_of(path: &Path) -> Result<Option<RigidTransform>, ImportError> {
    let numbers: Result<Vec<f64>, _> = read_text(path)?.split_whitespace().map(str::parse).collect();
    match numbers {
        Ok(numbers) if numbers.len() == 16 => Ok(pose::from_rows(&numbers)),
        _ => Err(ImportError::damaged(path, "it should have 16 numbers")),
    }
}

/// The Kinect of the recordings: what is published of its depth camera, and of colour what is usual for it.
fn seven_scenes() -> Facts {
    let camera =
        |focal: f64| PinholeCamera { width: 640, height: 480, fx: focal, fy: focal, cx: 320.0, cy: 240.0 };
    let mut facts = Facts::new(camera(525.0), 1000.0);
    facts.depth_camera = Some(DepthCamera {
        camera: camera(585.0),
        distortion: Distortion::default(),
        colour_from_depth: RigidTransform {
            translation: Vector3::new(-0.026, 0.0, 0.0),
            ..RigidTransform::identity()
        },
    });
    facts
}

/// The cameras of `info.txt`: lines `name = values`.
fn bundle_fusion(path: &Path) -> Result<Facts, ImportError> {
    let file = TextFile::read(path)?;
    let mut values: HashMap<String, Vec<f64>> = HashMap::new();
    for line in file.lines() {
        if let Some((name, text)) = line.text.split_once('=') {
            let numbers = text.split_whitespace().map_while(|number| number.parse().ok()).collect();
            values.insert(name.trim().to_owned(), numbers);
        }
    }
    let get = |name: &str, count: usize| {
        let found = values.get(name).filter(|numbers| numbers.len() >= count);
        found
            .cloned()
            .ok_or_else(|| ImportError::damaged(path, format!("{name} with {count} numbers is missing")))
    };
    let camera = |kind: &str| -> Result<PinholeCamera, ImportError> {
        let matrix = get(&format!("m_calibration{kind}Intrinsic"), 16)?;
        let side = |side: &str| {
            Ok::<_, ImportError>(get(&format!("m_{}{side}", kind.to_lowercase()), 1)?[0] as usize)
        };
        // Rows of a 4 x 4 matrix.
        let [fx, cx, fy, cy] = [matrix[0], matrix[2], matrix[5], matrix[6]];
        Ok(PinholeCamera { width: side("Width")?, height: side("Height")?, fx, fy, cx, cy })
    };
    // Depth that was brought to the view of colour already has the same camera.
    let (colour, depth) = (camera("Color")?, camera("Depth")?);
    let mut facts = Facts::new(colour, get("m_depthShift", 1)?[0]);
    if depth != colour {
        let colour_from_depth =
            get("m_calibrationColorExtrinsic", 16).ok().and_then(|rows| pose::from_rows(&rows));
        facts.depth_camera = Some(DepthCamera {
            camera: depth,
            distortion: Distortion::default(),
            colour_from_depth: colour_from_depth.unwrap_or_default(),
        });
    }
    Ok(facts)
}
