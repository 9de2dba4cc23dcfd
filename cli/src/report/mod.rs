//! Results for people: tables in the terminal, charts, and the report of a run.

mod chart;
mod compare;
mod detail;
mod html;
pub mod image_table;
mod map_views;
mod pictures;
mod plots;
pub mod table;
mod view;

use std::fs;
use std::path::{Path, PathBuf};

use mba_mapper::FileError;
use mba_mapper::dataset::Dataset;
use mba_mapper::output::{OutputFile, Permission};
use mba_mapper::run::Run;

use crate::commands::written_run::refuse;

pub use plots::{Plot, plots};
pub use view::RunView;

/// Name of the report in a RUN folder.
pub const REPORT_FILE: &str = "report.html";
/// Name of the folder of charts in a RUN folder.
pub const PLOTS_FOLDER: &str = "plots";

/// What the charts start with.
const CHART_START: &str = "<svg style=\"background: white; color: black\" ";

/// Writes the charts of a run as `plots/*.svg` and the report, over earlier ones, and with `force` over files of others;
/// `dataset` supplies the ground truth and the captured images. Returns the report's path.
///
/// # Errors
/// When a file cannot be written or a chart or picture cannot be made.
pub fn write(run: &Run, dataset: Option<&Dataset>, force: bool) -> anyhow::Result<PathBuf> {
    let plots = plots(run, &RunView::new(run, dataset))?;
    let permission = Permission { force, inputs: &[] };
    let claim =
        |path: &Path, is_own: fn(&[u8]) -> bool| OutputFile::claim(path, &permission, is_own).or_else(refuse);
    let report = run.folder.join(REPORT_FILE);
    let page = claim(&report, html::is_own_page)?;
    let folder = run.folder.join(PLOTS_FOLDER);
    fs::create_dir_all(&folder).map_err(|reason| FileError::Unwritable { path: folder.clone(), reason })?;
    let is_own_chart = |start: &[u8]| start.starts_with(CHART_START.as_bytes());
    let charts = plots.iter().map(|plot| {
        let file = claim(&folder.join(plot.name).with_extension("svg"), is_own_chart)?;
        Ok((file, stand_alone(&plot.svg)))
    });
    // None is written before all of them may be.
    let charts = charts.collect::<anyhow::Result<Vec<_>>>()?;
    for (file, chart) in charts {
        file.write(chart.as_bytes())?;
    }
    let keyframes = compare::section(&pictures::keyframe_pictures(run, dataset)?);
    let pictures = keyframes + &map_views::section(run, dataset)?;
    page.write(html::page(run, &plots, &pictures).as_bytes())?;
    Ok(report)
}

/// The chart as a file of its own: black on white, whatever the viewer's theme.
fn stand_alone(svg: &str) -> String {
    svg.replacen("<svg ", CHART_START, 1)
}
