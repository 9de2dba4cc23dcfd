//! All data of 3D Scanner App, and what other exports of ARKit look like: `frame_00000.json` with `frame_00000.jpg`,
//! `depth_00000.png` and `conf_00000.png`.

use mba_tracker::geometry::PinholeCamera;
use serde::Deserialize;

use super::camera;
use crate::destination::Destination;
use crate::facts::Facts;
use crate::format::{Format, Reading, files, first_file, read_json, stem};
use crate::picture::Picture;
use crate::time::Time;
use crate::{ImportError, pose};

pub(crate) const FORMAT: Format = Format {
    name: "3D Scanner App",
    looked_for: "frame_00000.json and depth_00000.png",
    recognise: |path| {
        let has =
            |start: &str, ending: &str| files(path, start, &[ending]).is_ok_and(|files| !files.is_empty());
        path.is_dir() && has("frame_", ".json") && has("depth_", ".png")
    },
    read,
};

/// What is read of the file of a frame.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Frame {
    /// Row by row.
    intrinsics: [f64; 9],
    /// Camera-to-world, row by row.
    #[serde(rename = "cameraPoseARFrame")]
    camera_pose: Option<Vec<f64>>,
    /// Seconds.
    time: f64,
    exposure_duration: Option<f64>,
}

fn read(reading: &Reading<'_>, destination: &mut Destination) -> Result<Facts, ImportError> {
    let folder = reading.path;
    let frames = files(folder, "frame_", &[".json"])?;
    let mut cameras = Vec::new();
    reading.each(&frames, |path| {
        let name = stem(path);
        let number = name.trim_start_matches("frame_");
        let colour = first_file(["jpg", "jpeg", "png"].map(|ending| folder.join(format!("{name}.{ending}"))));
        let depth = folder.join(format!("depth_{number}.png"));
        let (Some(colour), true) = (colour, depth.is_file()) else {
            destination.note("frames without a colour or a depth image are left out");
            return Ok(());
        };
        let Frame { intrinsics, camera_pose, time, exposure_duration } = read_json(path)?;
        let time = Time::from_seconds(time)
            .ok_or_else(|| ImportError::damaged(path, format!("{time} is no time")))?;
        destination.add_colour(time, &Picture::File(colour.clone()), &colour)?;
        let added = destination.add_depth(time, &Picture::File(depth.clone()), &depth)?;
        let confidence = folder.join(format!("conf_{number}.png"));
        if confidence.is_file() {
            destination.add_confidence(&added, &Picture::File(confidence.clone()), &confidence)?;
        }
        destination.exposures.extend(exposure_duration.map(|seconds| (time, seconds)));
        let world_from_camera = camera_pose.and_then(|rows| pose::from_rows(&rows));
        destination.poses.extend(world_from_camera.map(|pose| (time, pose::from_opengl(&pose))));
        // The files do not say the size; the images have it.
        let (width, height) = destination.colour_size().unwrap_or_default();
        let [fx, _, cx, _, fy, cy, ..] = intrinsics;
        cameras.push(PinholeCamera { width, height, fx, fy, cx, cy });
        Ok(())
    })?;
    // Autofocus changes the camera a little from frame to frame. Depth is millimetres.
    Ok(Facts::new(camera::median(cameras, destination, folder)?, 1000.0).telephone())
}
