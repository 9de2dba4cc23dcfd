//! Raw data of Polycam: `keyframes/images/`, `cameras/`, `depth/` and `confidence/`, named by the time in microseconds; the
//! cameras that Polycam refined are in `corrected_cameras/`, with their images.

use std::path::{Path, PathBuf};

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
    name: "Polycam raw data",
    looked_for: "keyframes/cameras/ and keyframes/depth/",
    recognise: |path| keyframes(path).is_some(),
    read,
};

/// A file of `cameras/`. The pose is that of ARKit.
#[derive(Deserialize)]
struct Camera {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    width: usize,
    height: usize,
    t_00: f64,
    t_01: f64,
    t_02: f64,
    t_03: f64,
    t_10: f64,
    t_11: f64,
    t_12: f64,
    t_13: f64,
    t_20: f64,
    t_21: f64,
    t_22: f64,
    t_23: f64,
}

/// The folder of the keyframes: the one given, or in it.
fn keyframes(folder: &Path) -> Option<PathBuf> {
    let candidates = [folder.join("keyframes"), folder.to_owned()];
    candidates.into_iter().find(|path| path.join("cameras").is_dir() && path.join("depth").is_dir())
}

fn read(reading: &Reading<'_>, destination: &mut Destination) -> Result<Facts, ImportError> {
    let Some(folder) = keyframes(reading.path) else {
        return Err(ImportError::damaged(reading.path, "its keyframes have gone"));
    };
    // Depth belongs to the images as they were captured, and so do their cameras.
    let cameras = files(&folder.join("cameras"), "", &[".json"])?;
    let mut pinholes = Vec::new();
    reading.each(&cameras, |path| {
        let name = stem(path);
        let image = |inner: &str, ending: &str| folder.join(inner).join(format!("{name}.{ending}"));
        let colour = first_file([image("images", "jpg"), image("images", "png")]);
        let depth = image("depth", "png");
        let (Some(colour), true) = (colour, depth.is_file()) else {
            destination.note("keyframes without a colour or a depth image are left out");
            return Ok(());
        };
        let microseconds: Option<u64> = name.parse().ok();
        let time = microseconds.and_then(|time| time.checked_mul(1000)).and_then(Time::from_nanoseconds);
        let Some(time) = time else {
            return Err(ImportError::damaged(path, "its name is no time in microseconds"));
        };
        let c: Camera = read_json(path)?;
        destination.add_colour(time, &Picture::File(colour.clone()), &colour)?;
        let added = destination.add_depth(time, &Picture::File(depth.clone()), &depth)?;
        let confidence = image("confidence", "png");
        if confidence.is_file() {
            destination.add_confidence(&added, &Picture::File(confidence.clone()), &confidence)?;
        }
        let rows =
            [c.t_00, c.t_01, c.t_02, c.t_03, c.t_10, c.t_11, c.t_12, c.t_13, c.t_20, c.t_21, c.t_22, c.t_23];
        let world_from_camera = pose::from_rows(&rows).map(|pose| pose::from_opengl(&pose));
        destination.poses.extend(world_from_camera.map(|pose| (time, pose)));
        let Camera { fx, fy, cx, cy, width, height, .. } = c;
        pinholes.push(PinholeCamera { width, height, fx, fy, cx, cy });
        Ok(())
    })?;
    Ok(Facts::new(camera::median(pinholes, destination, &folder)?, 1000.0).telephone())
}
