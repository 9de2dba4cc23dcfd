//! `transforms.json` of nerfstudio and instant-ngp, with `depth_file_path`.

use std::path::Path;

use mba_tracker::geometry::{Distortion, PinholeCamera};
use serde::Deserialize;

use super::camera;
use crate::destination::Destination;
use crate::facts::Facts;
use crate::format::{Format, Reading, read_json};
use crate::picture::Picture;
use crate::time::Time;
use crate::{ImportError, pose};

pub(crate) const FORMAT: Format = Format {
    name: "nerfstudio",
    looked_for: "transforms.json",
    recognise: |path| path.join(FILE).is_file(),
    read,
};

const FILE: &str = "transforms.json";

/// Frames per second that are assumed where there are no times.
const FRAME_RATE: f64 = 30.0;

/// What may stand in the file for all frames, or in each.
#[derive(Clone, Copy, Deserialize)]
struct Camera {
    w: Option<f64>,
    h: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
    k3: Option<f64>,
}

#[derive(Deserialize)]
struct File {
    #[serde(flatten)]
    camera: Camera,
    camera_model: Option<String>,
    /// Metres of a raw unit of depth.
    depth_unit_scale_factor: Option<f64>,
    frames: Vec<Frame>,
}

#[derive(Deserialize)]
struct Frame {
    #[serde(flatten)]
    camera: Camera,
    file_path: String,
    depth_file_path: Option<String>,
    mask_path: Option<String>,
    transform_matrix: Vec<Vec<f64>>,
    /// Seconds.
    #[serde(alias = "timestamp")]
    time: Option<f64>,
}

fn read(reading: &Reading<'_>, destination: &mut Destination) -> Result<Facts, ImportError> {
    let path = reading.path.join(FILE);
    let file: File = read_json(&path)?;
    if let Some(model) =
        file.camera_model.as_deref().filter(|model| !["OPENCV", "PINHOLE", "SIMPLE_PINHOLE"].contains(model))
    {
        let hint = "undistort the images first";
        return Err(ImportError::unusable(&path, format!("the camera model {model} is not read"), hint));
    }
    let has_times = file.frames.iter().all(|frame| frame.time.is_some());
    if !has_times {
        destination.note("frames have no times: 30 per second are assumed, in the order of transforms.json");
    }
    let mut cameras = Vec::new();
    let mut lens = Distortion::default();
    let numbered: Vec<(usize, &Frame)> = file.frames.iter().enumerate().collect();
    reading.each(&numbered, |(index, frame)| {
        let Some(depth) = &frame.depth_file_path else {
            destination.note("frames without depth_file_path are left out");
            return Ok(());
        };
        let seconds = frame.time.filter(|_| has_times).unwrap_or(*index as f64 / FRAME_RATE);
        let time = Time::from_seconds(seconds)
            .ok_or_else(|| ImportError::damaged(&path, format!("{seconds} is no time")))?;
        let at = |name: &str| reading.path.join(name);
        let colour = at(&frame.file_path);
        let stem = destination.add_colour(time, &Picture::File(colour.clone()), &colour)?;
        destination.add_depth(time, &Picture::File(at(depth)), &at(depth))?;
        if let Some(mask) = &frame.mask_path {
            destination.add_mask(&stem, &Picture::File(at(mask)), &at(mask))?;
        }
        let rows: Vec<f64> = frame.transform_matrix.concat();
        let world_from_camera = pose::from_rows(&rows).map(|pose| pose::from_opengl(&pose));
        destination.poses.extend(world_from_camera.map(|pose| (time, pose)));
        let (camera, distortion) = pinhole(&file.camera, &frame.camera, destination.colour_size(), &path)?;
        cameras.push(camera);
        lens = distortion;
        Ok(())
    })?;
    if cameras.is_empty() {
        let hint = "mba needs depth: images of 16 bits, registered to colour";
        return Err(ImportError::unusable(&path, "no frame has a depth_file_path", hint));
    }
    // Millimetres, unless the file says otherwise; read as written, and not as 999.99.
    let scale = file.depth_unit_scale_factor.map_or(1000.0, |unit| 1.0 / unit);
    let mut facts = Facts::new(camera::median(cameras, destination, &path)?, scale);
    facts.distortion = lens;
    facts.frame_rate = (!has_times).then_some(FRAME_RATE);
    Ok(facts)
}

/// The camera of a frame; what it does not say stands in the file.
fn pinhole(
    file: &Camera,
    frame: &Camera,
    size: Option<(usize, usize)>,
    path: &Path,
) -> Result<(PinholeCamera, Distortion), ImportError> {
    let (width, height) = size.unwrap_or_default();
    let missing = |name: &str| ImportError::damaged(path, format!("{name} is missing"));
    let fx = frame.fl_x.or(file.fl_x).ok_or_else(|| missing("fl_x"))?;
    let fy = frame.fl_y.or(file.fl_y).unwrap_or(fx);
    // The corner of the top-left pixel is (0, 0) there, its centre here.
    let centre = |own: Option<f64>, shared: Option<f64>, side: usize| {
        own.or(shared).unwrap_or(side as f64 / 2.0) - 0.5
    };
    let sides = [(frame.w.or(file.w), width, "w"), (frame.h.or(file.h), height, "h")];
    if let Some((Some(claimed), side, name)) =
        sides.iter().find(|(claimed, side, _)| claimed.is_some_and(|claimed| claimed != *side as f64))
    {
        return Err(ImportError::damaged(path, format!("{name} is {claimed}, images have {side}")));
    }
    let camera = PinholeCamera {
        width,
        height,
        fx,
        fy,
        cx: centre(frame.cx, file.cx, width),
        cy: centre(frame.cy, file.cy, height),
    };
    let of = |own: Option<f64>, shared: Option<f64>| own.or(shared).unwrap_or(0.0);
    let lens = Distortion {
        k1: of(frame.k1, file.k1),
        k2: of(frame.k2, file.k2),
        p1: of(frame.p1, file.p1),
        p2: of(frame.p2, file.p2),
        k3: of(frame.k3, file.k3),
    };
    Ok((camera, lens))
}
