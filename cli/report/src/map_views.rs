//! The map of a run: its size, and what it looks like.

use std::fs;

use image::RgbImage;
use mba_mapper::dataset::Dataset;
use mba_mapper::map::{FIELD_FILE, MAP_FILE, StoredMap};
use mba_mapper::rendering::{Behind, ViewRenderer};
use mba_mapper::run::{Run, RunCamera};
use mba_tracker::SimdLevel;

use super::html::escape;
use super::pictures::jpeg_base64;
use super::viewer::{self, Extent};

/// Width in pixels that pictures are reduced to.
const WIDTH: u32 = 480;

/// What the viewer in a report shows.
const IN_REPORT: Extent = Extent { keyframes: 24, columns: 320 };

/// Most Gaussians in a report: they take 5 MB.
const MOST_GAUSSIANS: usize = 150_000;

/// What is shown of the map of a run.
pub(super) struct MapViews {
    /// The map from where some frames were taken, with the indices of those frames.
    pub(super) views: Vec<(usize, RgbImage)>,
    /// What the map is, or why it cannot be read, as HTML; none for a run without a map.
    about: Option<String>,
    /// The viewer as HTML; empty for a map that it does not show.
    viewer: String,
}

impl MapViews {
    /// Renders the map of `run`, if it has one. A map that cannot be read is told, not an error: the rest of the report
    /// does not need it.
    ///
    /// # Errors
    /// When the response of the run's camera is none.
    pub(super) fn new(run: &Run, simd: SimdLevel, dataset: Option<&Dataset>) -> anyhow::Result<Self> {
        let none = Self { views: Vec::new(), about: None, viewer: String::new() };
        let Some(path) = StoredMap::path(&run.folder) else { return Ok(none) };
        let Ok(file) = fs::metadata(&path) else { return Ok(none) };
        let map = match StoredMap::read(&path) {
            Ok(map) => map,
            Err(error) => {
                let notice = format!("<p class=\"notice\">{}</p>\n", escape(&error.to_string()));
                return Ok(Self { about: Some(notice), ..none });
            }
        };
        let megabytes = file.len() as f64 / 1e6;
        let about = match &map {
            StoredMap::Gaussians(map) => format!(
                "{} Gaussians, {megabytes:.1} MB: <code>{MAP_FILE}</code> opens in any viewer of Gaussian splats.",
                map.len()
            ),
            StoredMap::Field(_) => {
                format!("A tri-plane field, {megabytes:.1} MB: <code>{FIELD_FILE}</code>.")
            }
        };
        let own = run.summary.settings.camera.clone();
        let camera = own.or_else(|| dataset.map(|dataset| RunCamera::from(dataset.calibration())));
        let shown =
            camera.as_ref().map(|camera| views(run, simd, &map, camera)).transpose()?.unwrap_or_default();
        let viewer = match (&map, &camera) {
            (StoredMap::Gaussians(map), Some(camera)) if map.len() <= MOST_GAUSSIANS => {
                viewer::section(run, (map, camera), dataset, IN_REPORT)?
            }
            (StoredMap::Gaussians(_), Some(_)) => {
                "<p class=\"note\">It is too large for this page; <code>mba view</code> shows it.</p>\n"
                    .to_owned()
            }
            _ => String::new(),
        };
        Ok(Self { views: shown, about: Some(format!("<p class=\"note\">{about}</p>\n")), viewer })
    }

    /// The section of the page; empty for a run without a map.
    ///
    /// # Errors
    /// When a picture cannot be encoded.
    pub(super) fn section(&self) -> anyhow::Result<String> {
        let Some(about) = &self.about else { return Ok(String::new()) };
        let figures = self.views.iter().map(figure).collect::<anyhow::Result<String>>()?;
        let panes = match figures.is_empty() {
            true => String::new(),
            false => format!("<section class=\"panes\">\n{figures}</section>\n"),
        };
        Ok(format!("<h2>Map</h2>\n{about}{}{panes}", self.viewer))
    }
}

fn figure((index, image): &(usize, RgbImage)) -> anyhow::Result<String> {
    let (width, height) = image.dimensions();
    Ok(format!(
        "<figure><div class=\"pane\"><img src=\"data:image/jpeg;base64,{}\" width=\"{width}\" \
         height=\"{height}\" alt=\"the map from frame {index}\"></div>\
         <figcaption>Rendered from frame {index}.</figcaption></figure>\n",
        jpeg_base64(image, WIDTH)?
    ))
}

/// The map from where some frames were taken.
fn views(
    run: &Run,
    simd: SimdLevel,
    map: &StoredMap,
    camera: &RunCamera,
) -> anyhow::Result<Vec<(usize, RgbImage)>> {
    let mut renderer =
        ViewRenderer::new(simd, map, camera.pinhole(), &camera.inverse_response()?, camera.depth_scale);
    let render = |index: usize| {
        let view = renderer.render(&run.exposures[index].mid, Behind::Surroundings);
        let [width, height] = view.size.map(|side| side as u32);
        Some((index, RgbImage::from_raw(width, height, view.rgb)?))
    };
    Ok(shown_frames(run).into_iter().filter_map(render).collect())
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
