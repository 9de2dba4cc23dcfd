//! The table of a benchmark as text, laid out as in papers: a row for each method, a column for each sequence.

use std::collections::BTreeMap;

use super::benchmark::{BenchmarkedCommand, MEAN, PublishedFigures};
use super::outcome::{Measured, Outcome};
use crate::commands::repeats::{Spread, cell};

/// Spaces between two columns.
const GAP: usize = 2;

/// What may have been measured and published.
struct Kind {
    title: &'static str,
    digits: usize,
    measured: fn(&Measured) -> Spread,
    published: fn(&PublishedFigures) -> &BTreeMap<String, f64>,
}

const KINDS: [Kind; 3] = [
    Kind {
        title: "ATE, cm (RMSE)",
        digits: 2,
        measured: |measured| measured.ate_cm,
        published: |published| &published.ate_cm,
    },
    Kind {
        title: "PSNR, dB",
        digits: 2,
        measured: |measured| measured.psnr_db,
        published: |published| &published.psnr_db,
    },
    Kind {
        title: "SSIM",
        digits: 3,
        measured: |measured| measured.ssim,
        published: |published| &published.ssim,
    },
];

/// A table for each kind of figure that there is, how fast and how much was tracked, and the sources.
pub(super) fn table(outcome: &Outcome) -> String {
    let mut text = format!("{}\n", outcome.benchmark.title);
    for kind in &KINDS {
        let is_measured = outcome.measured.iter().any(|measured| (kind.measured)(measured).is_some());
        let is_published =
            outcome.benchmark.published.iter().any(|published| !(kind.published)(published).is_empty());
        if is_measured || is_published {
            let rows = figures(outcome, kind);
            text += &format!("\n{}", aligned(&headed(outcome, kind.title, MEAN, rows)));
        }
    }
    let own = vec![
        own_row(outcome, "tracked, %", 0, |measured| measured.tracked_percent, None),
        own_row(outcome, "frames/s", 1, |measured| measured.frames_per_second, None),
    ];
    text += &format!("\n{}", aligned(&headed(outcome, own_name(outcome), "", own)));
    let sources = outcome.benchmark.published.iter().map(|published| &published.source);
    let sources: String =
        (1..).zip(sources).map(|(number, source)| format!("[{number}] {source}\n")).collect();
    if !sources.is_empty() {
        text += &format!("\n{sources}");
    }
    if !outcome.benchmark.notes.is_empty() {
        text += &format!("\n{}\n", outcome.benchmark.notes);
    }
    text
}

fn own_name(outcome: &Outcome) -> &'static str {
    match outcome.benchmark.of {
        BenchmarkedCommand::Track => "mba track",
        BenchmarkedCommand::Slam => "mba slam",
    }
}

/// The rows with one of names above them.
fn headed(outcome: &Outcome, title: &str, last: &str, rows: Vec<Vec<String>>) -> Vec<Vec<String>> {
    let mut head = vec![title.to_owned()];
    head.extend(outcome.benchmark.sequences.iter().map(|sequence| sequence.name.clone()));
    head.push(last.to_owned());
    std::iter::once(head).chain(rows).collect()
}

/// The row of this program and those of what was published.
fn figures(outcome: &Outcome, kind: &Kind) -> Vec<Vec<String>> {
    let all: Option<Vec<f64>> = outcome
        .benchmark
        .sequences
        .iter()
        .map(|sequence| Some((kind.measured)(measured(outcome, &sequence.name)?)?[0]))
        .collect();
    let whole = all.map(|all| mean(&all));
    let mut rows = vec![own_row(outcome, own_name(outcome), kind.digits, kind.measured, Some(whole))];
    for (number, published) in (1..).zip(&outcome.benchmark.published) {
        let figures = (kind.published)(published);
        if !figures.is_empty() {
            rows.push(published_row(
                outcome,
                &format!("{} [{number}]", published.method),
                kind.digits,
                figures,
            ));
        }
    }
    rows
}

fn measured<'a>(outcome: &'a Outcome, sequence: &str) -> Option<&'a Measured> {
    outcome.measured.iter().find(|measured| measured.sequence == sequence)
}

/// A row of figures that were measured; with a last cell for all sequences, where `whole` is given.
fn own_row(
    outcome: &Outcome,
    name: &str,
    digits: usize,
    figure: fn(&Measured) -> Spread,
    whole: Option<Option<f64>>,
) -> Vec<String> {
    let of_sequence = |sequence: &str| match measured(outcome, sequence) {
        Some(measured) => cell(figure(measured), digits),
        None if outcome.failed.iter().any(|name| name == sequence) => "failed".to_owned(),
        None => "-".to_owned(),
    };
    let cells = outcome.benchmark.sequences.iter().map(|sequence| of_sequence(&sequence.name));
    let whole = whole.map(|whole| number(whole, digits));
    std::iter::once(name.to_owned()).chain(cells).chain(whole).collect()
}

/// Figures as they were published; a mean that was not is that of all sequences.
fn published_row(
    outcome: &Outcome,
    name: &str,
    digits: usize,
    figures: &BTreeMap<String, f64>,
) -> Vec<String> {
    let names = outcome.benchmark.sequences.iter().map(|sequence| sequence.name.as_str());
    let all: Vec<Option<f64>> = names.map(|name| figures.get(name).copied()).collect();
    let of_all = all.iter().copied().collect::<Option<Vec<f64>>>().map(|all| mean(&all));
    let whole = figures.get(MEAN).copied().or(of_all);
    let cells = all.into_iter().chain([whole]).map(|value| number(value, digits));
    std::iter::once(name.to_owned()).chain(cells).collect()
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Columns as wide as their widest cells, the first to the left and the others to the right.
fn aligned(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width =
        |column: usize| rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max();
    let widths: Vec<usize> = (0..columns).map(|column| width(column).unwrap_or(0)).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).enumerate().map(|(column, (cell, &width))| match column {
            0 => format!("{cell:width$}"),
            _ => format!("{cell:>width$}", width = width + GAP),
        });
        cells.collect::<String>().trim_end().to_owned() + "\n"
    };
    rows.iter().map(line).collect()
}
