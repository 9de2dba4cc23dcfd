//! Runs that are repeated with a camera that differs by next to nothing, and the spread of their figures.

use std::path::{Path, PathBuf};

use mba_mapper::dataset::{Calibration, Dataset, DatasetError};
use mba_mapper::run::{Run, Summary};

use crate::console::Console;
use crate::written_run::absolute;

/// Relative step between the focal lengths of repeated runs: a twentieth of a pixel in the corner, which nobody knows better.
const NUDGE: f64 = 1e-4;

/// Width of a column of the table, and of the names of its rows.
const WIDTH: usize = 22;

/// Middle, least and most of a figure over repeated runs; none where a run has none.
pub(super) type Spread = Option<[f64; 3]>;

/// What is run, how often, and where.
#[derive(Clone, Copy, Debug)]
pub(super) struct Repeats<'a> {
    /// Folder of the data set.
    pub(super) dataset: &'a Path,
    /// Whether the runs are those of SLAM, or else of the tracker alone.
    pub(super) maps: bool,
    /// Folder for the runs.
    pub(super) out: &'a Path,
    /// Runs of each row.
    pub(super) count: u16,
}

/// The summaries of the repeated runs of the row `name`. A run of the same kind and data set that was finished before is not made
/// again; `run` makes one, with its number from 0 and its folder.
pub(super) fn summaries(
    repeats: Repeats<'_>,
    name: &str,
    console: &Console,
    run: impl Fn(u16, &Path) -> anyhow::Result<Summary>,
) -> anyhow::Result<Vec<Summary>> {
    let one = |repeat| {
        let out = folder(repeats.out, name, repeat);
        if let Some(summary) = finished(&out).filter(|summary| repeats.is_of(summary)) {
            return Ok(summary);
        }
        console.note(format!("{name}, run {} of {}:", repeat + 1, repeats.count));
        run(repeat, &out)
    };
    (0..repeats.count).map(one).collect()
}

impl Repeats<'_> {
    /// Whether a run is one of these, rather than what something else left in its folder.
    fn is_of(&self, run: &Summary) -> bool {
        run.slam.is_some() == self.maps && run.settings.dataset == absolute(self.dataset)
    }
}

/// Folder in `out` of run `repeat`, counted from 0, of the row `name`. No name of a row has a plus sign.
fn folder(out: &Path, name: &str, repeat: u16) -> PathBuf {
    let name = name.replace(' ', "-");
    let name = if repeat == 0 { name } else { format!("{name}+{}", repeat + 1) };
    out.join(name)
}

/// The summary of a run that was finished before.
fn finished(out: &Path) -> Option<Summary> {
    Run::open(out).ok().map(|run| run.summary).filter(|summary| summary.complete)
}

/// The data set with focal lengths that differ a little from those on record, except in the first run.
pub(super) fn nudged(dataset: &Dataset, repeat: u16) -> Result<Dataset, DatasetError> {
    if repeat == 0 {
        return Ok(dataset.clone());
    }
    // 1, -1, 2, -2 and so on.
    let steps = f64::from(repeat.div_ceil(2)) * if repeat % 2 == 1 { 1.0 } else { -1.0 };
    let mut calibration = dataset.calibration().clone();
    calibration.camera.fx *= 1.0 + steps * NUDGE;
    calibration.camera.fy *= 1.0 + steps * NUDGE;
    with_same_sensors(dataset, calibration)
}

/// The data set with another calibration, and without an IMU if it had none that is used.
pub(super) fn with_same_sensors(
    dataset: &Dataset,
    calibration: Calibration,
) -> Result<Dataset, DatasetError> {
    let has_imu = dataset.imu().is_some();
    let dataset = dataset.clone().with_calibration(calibration)?;
    let is_back = !has_imu && dataset.imu().is_some();
    Ok(if is_back { dataset.without_imu("it is not used in this run".to_owned()) } else { dataset })
}

/// The spread of a figure over the runs of a row.
pub(super) fn spread(summaries: &[Summary], figure: fn(&Summary) -> Option<f64>) -> Spread {
    spread_of(summaries.iter().map(figure))
}

fn spread_of(values: impl Iterator<Item = Option<f64>>) -> Spread {
    let mut values: Vec<f64> = values.collect::<Option<_>>()?;
    values.sort_by(f64::total_cmp);
    let (first, last) = (*values.first()?, *values.last()?);
    let middle = 0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2]);
    Some([middle, first, last])
}

/// A table with a line for each row: its name, and each figure with its number of digits.
pub(super) fn table<'a, const N: usize>(
    head: [&str; N],
    rows: impl Iterator<Item = (&'a str, [(Spread, usize); N])>,
) -> String {
    let mut text = format!("{:WIDTH$}", "") + &head.map(|name| format!("{name:>WIDTH$}")).concat() + "\n";
    for (name, figures) in rows {
        let cells = figures.map(|(spread, digits)| format!("{:>WIDTH$}", cell(spread, digits)));
        text += &format!("{name:WIDTH$}{}\n", cells.concat());
    }
    text
}

/// A figure with its spread, if there was more than one run.
pub(super) fn cell(spread: Spread, digits: usize) -> String {
    match spread {
        None => "-".to_owned(),
        Some([middle, least, most]) if least == most => format!("{middle:.digits$}"),
        Some([middle, least, most]) => format!("{middle:.digits$} [{least:.digits$} {most:.digits$}]"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeated_runs_have_folders_of_their_own() {
        let folders = [("blur off", 0), ("desk", 0), ("desk", 1), ("desk-2", 0)]
            .map(|(name, repeat)| folder(Path::new("out"), name, repeat));
        assert_eq!(folders, ["out/blur-off", "out/desk", "out/desk+2", "out/desk-2"].map(PathBuf::from));
    }

    #[test]
    fn repeated_figures_have_a_middle_and_a_spread() {
        let values = [3.0, 1.0, 2.0, 5.0];
        assert_eq!(spread_of(values.iter().copied().map(Some)), Some([2.5, 1.0, 5.0]));
        assert_eq!(spread_of([Some(1.0), None].into_iter()), None);
        assert_eq!(cell(Some([2.5, 1.0, 5.0]), 1), "2.5 [1.0 5.0]");
        assert_eq!((cell(Some([2.5; 3]), 2), cell(None, 2)), ("2.50".into(), "-".into()));
    }
}
