//! The map of a run: its size, and what it looks like.

use std::fs;

use image::RgbImage;
use mba_mapper::dataset::Dataset;
use mba_mapper::rendering::{Behind, ViewRenderer};
use mba_mapper::run::{FIELD_FILE, MAP_FILE, Run, RunCamera, StoredMap};

use super::html::escape;
use super::pictures::jpeg_base64;

/// Width in pixels that pictures are reduced to.
const WIDTH: u32 = 480;

/// The section of the page; empty for a run without a map. A map that cannot be read is told, not an error: the
/// rest of the report does not need it.
///
/// # Errors
/// When a picture cannot be encoded.
pub(super) fn section(run: &Run, dataset: Option<&Dataset>) -> anyhow::Result<String> {
    let Some(path) = StoredMap::path(&run.folder) else { return Ok(String::new()) };
    let Ok(file) = fs::metadata(&path) else { return Ok(String::new()) };
    let map = match StoredMap::read(&path) {
        Ok(map) => map,
        Err(error) => {
            return Ok(format!("<h2>Map</h2>\n<p class=\"notice\">{}</p>\n", escape(&error.to_string())));
        }
    };
    let megabytes = file.len() as f64 / 1e6;
    let about = match &map {
        StoredMap::Gaussians(map) => format!(
            "{} Gaussians, {megabytes:.1} MB: <code>{MAP_FILE}</code> opens in any viewer of Gaussian splats.",
            map.len()
        ),
        StoredMap::Field(_) => format!("A tri-plane field, {megabytes:.1} MB: <code>{FIELD_FILE}</code>."),
    };
    let own = run.summary.settings.camera.clone();
    let camera = own.or_else(|| dataset.map(|dataset| RunCamera::from(dataset.calibration())));
    let views = match &camera {
        Some(camera) => views(run, &map, camera)?,
        None => String::new(),
    };
    Ok(format!("<h2>Map</h2>\n<p class=\"note\">{about}</p>\n<section class=\"panes\">\n{views}</section>\n"))
}

/// The map from where some frames were taken.
fn views(run: &Run, map: &StoredMap, camera: &RunCamera) -> anyhow::Result<String> {
    let mut renderer =
        ViewRenderer::new(map, camera.pinhole(), &camera.inverse_response()?, camera.depth_scale);
    let mut html = String::new();
    for index in shown_frames(run) {
        let view = renderer.render(&run.exposures[index].mid, Behind::Surroundings);
        let [width, height] = view.size.map(|side| side as u32);
        let Some(image) = RgbImage::from_raw(width, height, view.rgb) else { continue };
        html.push_str(&format!(
            "<figure><div class=\"pane\"><img src=\"data:image/jpeg;base64,{}\" width=\"{width}\" \
             height=\"{height}\" alt=\"the map from frame {index}\"></div>\
             <figcaption>Rendered from frame {index}.</figcaption></figure>\n",
            jpeg_base64(&image, WIDTH)?
        ));
    }
    Ok(html)
}

/// First, middle and last keyframe that has poses; of all frames when there is no keyframe.
fn shown_frames(run: &Run) -> Vec<usize> {
    let frames = 0..run.exposures.len().min(run.frames.len());
    let keyframes: Vec<usize> = frames.clone().filter(|index| run.frames[*index].keyframe != 0).collect();
    let all = if keyframes.is_empty() { frames.collect() } else { keyframes };
    let Some(last) = all.len().checked_sub(1) else { return Vec::new() };
    let mut shown = [0, last / 2, last].map(|k| all[k]).to_vec();
    shown.dedup();
    shown
}
