//! What the scripts of the viewer know of a run.

use image::RgbImage;
use mba_mapper::dataset::{Dataset, read_image};
use mba_mapper::gaussians::{Gaussians, MEAN};
use mba_mapper::run::{FrameStatus, Run, RunCamera, deblurred_path, start_view, up_direction};
use mba_mapper::sensor::DisplayCurve;
use mba_tracker::geometry::RigidTransform;
use nalgebra::Vector3;
use serde::Serialize;

use super::pack::{COLOURS, SCALES};
use crate::pictures::jpeg_base64;

/// How much of a run a page shows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    /// Most keyframes, evenly chosen.
    pub(crate) keyframes: usize,
    /// Columns that their pictures are reduced to.
    pub(crate) columns: u32,
}

/// Knots of the curve from light to display values, at the squares of even steps.
const KNOTS: u16 = 1024;

/// See the scripts for how each is used. Lengths are in metres, in the world of the run.
#[derive(Serialize)]
pub(super) struct Scene {
    camera: Camera,
    /// Display values in steps of 1/65535.
    curve: Vec<u16>,
    scales: [f32; 2],
    colours: [f32; 2],
    up: [f64; 3],
    /// About how large things are.
    size: f64,
    start: Pose,
    /// Positions at opening, middle and closing of the shutter, of frames that are not lost.
    exposures: Vec<[[f32; 3]; 3]>,
    keyframes: Vec<Keyframe>,
}

/// Pixels; the centre of the first one is (0, 0).
#[derive(Serialize)]
struct Camera {
    width: usize,
    height: usize,
    focal: [f64; 2],
    centre: [f64; 2],
}

/// Camera-to-world, quaternion x y z w.
#[derive(Serialize)]
struct Pose {
    place: [f64; 3],
    rotation: [f64; 4],
}

#[derive(Serialize)]
struct Keyframe {
    frame: usize,
    #[serde(flatten)]
    pose: Pose,
    /// JPEG in base64.
    captured: Option<String>,
    deblurred: Option<String>,
}

impl Scene {
    pub(super) fn new(
        run: &Run,
        (map, camera): (&Gaussians, &RunCamera),
        dataset: Option<&Dataset>,
        extent: Extent,
    ) -> anyhow::Result<Self> {
        let start = start_view(&run.exposures, &run.frames).unwrap_or_default();
        let frames = run.exposures.iter().zip(&run.frames);
        let tracked = frames.filter(|(_, frame)| frame.status != FrameStatus::Lost);
        let places = |exposure: &mba_mapper::trajectory_file::TimedExposure| {
            [&exposure.start, &exposure.mid, &exposure.end]
                .map(|pose| pose.translation.map(|x| x as f32).into())
        };
        Ok(Self {
            camera: Camera {
                width: camera.width,
                height: camera.height,
                focal: [camera.fx, camera.fy],
                centre: [camera.cx, camera.cy],
            },
            curve: curve(&DisplayCurve::new(&camera.inverse_response()?)),
            scales: SCALES,
            colours: COLOURS,
            up: up_direction(run.summary.upright.as_ref(), &run.exposures, &run.frames).into(),
            size: size(map, &start),
            start: Pose::from(&start),
            exposures: tracked.map(|(exposure, _)| places(exposure)).collect(),
            keyframes: keyframes(run, dataset, extent)?,
        })
    }
}

impl From<&RigidTransform> for Pose {
    fn from(world_from_camera: &RigidTransform) -> Self {
        let q = world_from_camera.rotation;
        Self { place: world_from_camera.translation.into(), rotation: [q.i, q.j, q.k, q.w] }
    }
}

fn curve(display: &DisplayCurve) -> Vec<u16> {
    let last = f32::from(KNOTS - 1);
    let value = |k: u16| display.at((f32::from(k) / last).powi(2))[0].clamp(0.0, 1.0);
    (0..KNOTS).map(|k| (65535.0 * value(k)).round() as u16).collect()
}

/// Median distance of the Gaussians from where the view starts.
fn size(map: &Gaussians, start: &RigidTransform) -> f64 {
    let [x, y, z] = [MEAN, MEAN + 1, MEAN + 2].map(|plane| &map.planes()[plane]);
    let places = x.iter().zip(y).zip(z).map(|((x, y), z)| Vector3::new(*x, *y, *z).cast::<f64>());
    let mut distances: Vec<f64> = places
        .map(|place| (place - start.translation).norm())
        .filter(|distance| distance.is_finite())
        .collect();
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() / 2).copied().unwrap_or(1.0)
}

/// Keyframes with a pose, evenly chosen; what cannot be read of their pictures is left out.
fn keyframes(run: &Run, dataset: Option<&Dataset>, extent: Extent) -> anyhow::Result<Vec<Keyframe>> {
    let frames = run.exposures.iter().zip(&run.frames).enumerate();
    let with_pose = frames.filter(|(_, (_, frame))| frame.keyframe != 0 && frame.status != FrameStatus::Lost);
    let all: Vec<usize> = with_pose.map(|(index, _)| index).collect();
    let count = all.len().min(extent.keyframes);
    let jpeg = |image: Option<RgbImage>| image.map(|image| jpeg_base64(&image, extent.columns)).transpose();
    let keyframe = |k: usize| {
        let index = all[k * all.len() / count];
        let deblurred = read_image(&deblurred_path(&run.folder, index)).ok().map(|image| image.into_rgb8());
        Ok(Keyframe {
            frame: index,
            pose: Pose::from(&run.exposures[index].mid),
            captured: jpeg(dataset.and_then(|dataset| captured(dataset, index)))?,
            deblurred: jpeg(deblurred)?,
        })
    };
    (0..count).map(keyframe).collect()
}

fn captured(dataset: &Dataset, index: usize) -> Option<RgbImage> {
    let frame = dataset.frame(index).ok()?;
    RgbImage::from_raw(frame.width as u32, frame.height as u32, frame.rgb)
}
