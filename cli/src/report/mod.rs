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

use anyhow::Context;
use mba_mapper::dataset::Dataset;
use mba_mapper::run::Run;

pub use plots::{Plot, plots};
pub use view::RunView;

/// Name of the report in a RUN folder.
pub const REPORT_FILE: &str = "report.html";
/// Name of the folder of charts in a RUN folder.
pub const PLOTS_FOLDER: &str = "plots";

/// Writes the charts of a run as `plots/*.svg` and the report; `dataset` supplies the ground truth and
/// the captured images. Returns the report's path.
///
/// # Errors
/// When a file cannot be written or a chart or picture cannot be made.
pub fn write(run: &Run, dataset: Option<&Dataset>) -> anyhow::Result<PathBuf> {
    let plots = plots(run, &RunView::new(run, dataset))?;
    let folder = run.folder.join(PLOTS_FOLDER);
    fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
    for plot in &plots {
        write_whole(&folder.join(plot.name).with_extension("svg"), &stand_alone(&plot.svg))?;
    }
    let report = run.folder.join(REPORT_FILE);
    let keyframes = compare::section(&pictures::keyframe_pictures(run, dataset)?);
    let pictures = keyframes + &map_views::section(run, dataset)?;
    write_whole(&report, &html::page(run, &plots, &pictures))?;
    Ok(report)
}

/// The chart as a file of its own: black on white, whatever the viewer's theme.
fn stand_alone(svg: &str) -> String {
    svg.replacen("<svg ", "<svg style=\"background: white; color: black\" ", 1)
}

/// Writes beside the file and renames, so that a full disk never leaves half a file.
fn write_whole(path: &Path, text: &str) -> anyhow::Result<()> {
    let partial = path.with_added_extension("partial");
    fs::write(&partial, text).and_then(|()| fs::rename(&partial, path)).map_err(|reason| {
        // Only a left-over is lost if this fails too.
        let _ = fs::remove_file(&partial);
        anyhow::Error::new(reason).context(format!("cannot write {}", path.display()))
    })
}
