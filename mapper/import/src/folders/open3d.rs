//! What the recorders of Open3D and its readers of RealSense and Azure Kinect files write: `color/`, `depth/` registered to
//! it, and `camera_intrinsic.json` or `intrinsic.json`.

use std::path::{Path, PathBuf};

use mba_tracker::geometry::PinholeCamera;
use serde::Deserialize;

use crate::ImportError;
use crate::destination::Destination;
use crate::facts::Facts;
use crate::format::{Format, Reading, files, first_file, read_json, stem};
use crate::picture::Picture;
use crate::time::Time;

pub(crate) const FORMAT: Format = Format {
    name: "Open3D recorder",
    looked_for: "color/, depth/ and camera_intrinsic.json or intrinsic.json",
    recognise: |path| path.join("color").is_dir() && path.join("depth").is_dir() && intrinsic(path).is_some(),
    read,
};

/// What is read of the file of the camera.
#[derive(Deserialize)]
struct Intrinsic {
    width: usize,
    height: usize,
    /// Column by column.
    intrinsic_matrix: [f64; 9],
    depth_scale: Option<f64>,
    fps: Option<f64>,
}

fn intrinsic(folder: &Path) -> Option<PathBuf> {
    first_file(["camera_intrinsic.json", "intrinsic.json"].map(|name| folder.join(name)))
}

fn read(reading: &Reading<'_>, destination: &mut Destination) -> Result<Facts, ImportError> {
    let folder = reading.path;
    let Some(path) = intrinsic(folder) else {
        return Err(ImportError::damaged(folder, "its camera_intrinsic.json has gone"));
    };
    let Intrinsic { width, height, intrinsic_matrix, depth_scale, fps } = read_json(&path)?;
    let [fx, _, _, _, fy, _, cx, cy, _] = intrinsic_matrix;
    // Millimetres, as both recorders write them.
    let scale = depth_scale.unwrap_or(1000.0);
    let mut facts = Facts::new(PinholeCamera { width, height, fx, fy, cx, cy }, scale);
    let rate = fps.filter(|rate| *rate > 0.0).unwrap_or_else(|| {
        destination.note("frames have no times: 30 per second are assumed");
        30.0
    });
    facts.frame_rate = Some(rate);
    let colours = files(&folder.join("color"), "", &[".jpg", ".jpeg", ".png"])?;
    reading.each(&colours, |colour| {
        let name = stem(colour);
        let depth = folder.join("depth").join(format!("{name}.png"));
        let Ok(number) = name.parse::<u32>() else { return Ok(()) };
        if !depth.is_file() {
            destination.note("colour images without a depth image are left out");
            return Ok(());
        }
        let time = Time::from_seconds(f64::from(number) / rate)
            .ok_or_else(|| ImportError::damaged(colour, "its number is no time"))?;
        destination.add_colour(time, &Picture::File(colour.clone()), colour)?;
        destination.add_depth(time, &Picture::File(depth.clone()), &depth)?;
        Ok(())
    })?;
    Ok(facts)
}
