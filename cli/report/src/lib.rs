//! Results for people: tables in the terminal, charts, and the report of a run.

mod chart;
mod compare;
mod detail;
mod html;
pub mod image_table;
mod lettering;
mod map_views;
mod motion_lines;
mod pictures;
mod plots;
mod side_by_side;
pub mod table;
mod view;
mod viewer;

use std::fs;
use std::path::{Path, PathBuf};

use mba_mapper::FileError;
use mba_mapper::dataset::Dataset;
use mba_mapper::gaussians::Gaussians;
use mba_mapper::output::{OutputFile, Permission};
use mba_mapper::run::{Run, RunCamera};
use mba_tracker::SimdLevel;

pub use plots::{Plot, plots};
pub use view::RunView;

/// Name of the report in a RUN folder.
pub const REPORT_FILE: &str = "report.html";
/// Name of the page with the viewer in a RUN folder.
pub const VIEW_FILE: &str = "view.html";
/// Name of the folder of charts in a RUN folder.
pub const PLOTS_FOLDER: &str = "plots";
/// Name of the folder of pictures in a RUN folder.
pub const PICTURES_FOLDER: &str = "pictures";

/// What the charts start with.
const CHART_START: &str = "<svg style=\"background: white; color: black\" ";

/// Writes the charts of a run as `plots/*.svg`, its pictures as `pictures/*.png` and the report, over earlier ones, and
/// with `force` over files of others; `dataset` supplies the ground truth and the captured images, and the map is rendered
/// with the instructions `simd`. Returns the report's path.
///
/// # Errors
/// [`OutputError`](mba_mapper::output::OutputError) when a file may not be written; else when it cannot be, or a chart or
/// picture cannot be made.
pub fn write(run: &Run, simd: SimdLevel, dataset: Option<&Dataset>, force: bool) -> anyhow::Result<PathBuf> {
    let plots = plots(run, &RunView::new(run, dataset))?;
    let keyframes = pictures::keyframe_images(run, dataset);
    let map = map_views::MapViews::new(run, simd, dataset)?;
    let sections = compare::section(&pictures::keyframe_pictures(&keyframes)?) + &map.section()?;
    let numbered = keyframes.iter().zip(1..).map(|(images, number)| side_by_side::keyframe(number, images));
    let mut pictures = numbered.collect::<anyhow::Result<Vec<_>>>()?.concat();
    pictures.extend(side_by_side::views(&map.views)?);

    let report = run.folder.join(REPORT_FILE);
    let page = claim(&report, force, html::is_own_page)?;
    let charts = plots.iter().map(|plot| (format!("{}.svg", plot.name), stand_alone(&plot.svg).into_bytes()));
    let is_own_chart = |start: &[u8]| start.starts_with(CHART_START.as_bytes());
    let charts = claim_all(&run.folder.join(PLOTS_FOLDER), force, is_own_chart, charts.collect())?;
    let pictures = pictures.into_iter().map(|picture| (format!("{}.png", picture.name), picture.png));
    let is_own = side_by_side::is_own_picture;
    let pictures = claim_all(&run.folder.join(PICTURES_FOLDER), force, is_own, pictures.collect())?;
    // None is written before all of them may be.
    for (file, content) in charts.iter().chain(&pictures) {
        file.write(content)?;
    }
    page.write(html::page(run, &plots, &sections).as_bytes())?;
    Ok(report)
}

/// Writes the page with the viewer of `map` into the folder of a run, over an earlier one, and with `force` over a file of
/// others. Returns its path.
///
/// # Errors
/// As [`write()`].
pub fn write_view(
    run: &Run,
    map: (&Gaussians, &RunCamera),
    dataset: Option<&Dataset>,
    force: bool,
) -> anyhow::Result<PathBuf> {
    let path = run.folder.join(VIEW_FILE);
    let file = claim(&path, force, html::is_own_page)?;
    file.write(viewer::page(run, map, dataset)?.as_bytes())?;
    Ok(path)
}

fn claim(path: &Path, force: bool, is_own: impl Fn(&[u8]) -> bool) -> anyhow::Result<OutputFile> {
    Ok(OutputFile::claim(path, &Permission { force, inputs: &[] }, is_own)?)
}

/// Claims files of a folder that is made for them; without files there is no folder.
fn claim_all(
    folder: &Path,
    force: bool,
    is_own: impl Fn(&[u8]) -> bool,
    files: Vec<(String, Vec<u8>)>,
) -> anyhow::Result<Vec<(OutputFile, Vec<u8>)>> {
    if files.is_empty() {
        return Ok(Vec::new());
    }
    fs::create_dir_all(folder).map_err(|reason| FileError::Unwritable { path: folder.to_owned(), reason })?;
    let claimed =
        |(name, content): (String, Vec<u8>)| Ok((claim(&folder.join(name), force, &is_own)?, content));
    files.into_iter().map(claimed).collect()
}

/// The chart as a file of its own: black on white, whatever the viewer's theme.
fn stand_alone(svg: &str) -> String {
    svg.replacen("<svg ", CHART_START, 1)
}
