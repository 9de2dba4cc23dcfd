//! `mba bench`.

mod benchmark;
mod outcome;
mod table;

use std::path::Path;
use std::time::Duration;

use mba_mapper::dataset::Dataset;
use mba_mapper::run::Summary;
use mba_tracker::SimdLevel;

use super::repeats::{self, Repeats, nudged};
use super::{calibrate, open, slam, track};
use crate::args::bench::Bench;
use crate::args::slam::Slamming;
use crate::args::{Switch, Tracking};
use crate::console::Console;
use crate::failure::{Interrupted, OrBadInput, bad_input, causes, failed};
use crate::interrupt::Resumption;
use benchmark::{Benchmark, BenchmarkSequence, BenchmarkedCommand};
use outcome::{Measured, Outcome};

/// Time between two checkpoints of a tracked sequence, seconds.
const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(20);

/// Runs every sequence of a benchmark that is there and prints a table with what has been published.
///
/// # Errors
/// Bad input when the file cannot be used or none of its sequences is there; failure when a sequence cannot be run, after the
/// table of the others.
pub fn run(args: &Bench, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let benchmark =
        Benchmark::read(&args.file).or_bad_input("`mba bench --help` shows what a benchmark looks like")?;
    let beside = args.file.parent().unwrap_or(Path::new(""));
    let data = args.data.as_deref().unwrap_or(beside);
    let is_there = |sequence: &&BenchmarkSequence| data.join(&sequence.dataset).exists();
    let (there, missing): (Vec<_>, Vec<_>) = benchmark.sequences.iter().partition(is_there);
    if there.is_empty() {
        let first = data.join(&benchmark.sequences[0].dataset);
        let message = format!("none of the sequences is there; the first would be {}", first.display());
        return Err(bad_input(message, "name the folder that they lie in with --data"));
    }
    for sequence in missing {
        console.note(format!("{} is not there: {}", sequence.name, data.join(&sequence.dataset).display()));
    }
    let mut measured = Vec::new();
    let mut failures = Vec::new();
    for sequence in there {
        match summaries(&benchmark, sequence, (data, simd), args, console) {
            Ok(summaries) => measured.push(Measured::new(&sequence.name, &summaries)),
            Err(error) if error.is::<Interrupted>() => return Err(error),
            Err(error) => failures.push((sequence.name.clone(), causes(&error))),
        }
    }
    let failed_names: Vec<String> = failures.iter().map(|(name, _)| name.clone()).collect();
    console.result(&Outcome { benchmark, measured, failed: failed_names }, table::table)?;
    match failures.first() {
        Some((name, reason)) => Err(failed(
            format!("{} sequences could not be run; {name}: {reason}", failures.len()),
            "`mba info` says what is odd about a data set",
        )),
        None => Ok(()),
    }
}

/// The summaries of all runs of a sequence.
fn summaries(
    benchmark: &Benchmark,
    sequence: &BenchmarkSequence,
    (data, simd): (&Path, SimdLevel),
    args: &Bench,
    console: &Console,
) -> anyhow::Result<Vec<Summary>> {
    let dataset = open::dataset(&data.join(&sequence.dataset), simd)?;
    let dataset = calibrate::completed(dataset, Switch::On, console)?;
    let maps = benchmark.of == BenchmarkedCommand::Slam;
    let repeats = Repeats { dataset: dataset.folder(), maps, out: &args.out, count: args.repeats };
    repeats::summaries(repeats, &sequence.name, console, |repeat, out| {
        one_run(benchmark.of, &nudged(&dataset, repeat)?, out, console)
    })
}

fn one_run(
    command: BenchmarkedCommand,
    dataset: &Dataset,
    out: &Path,
    console: &Console,
) -> anyhow::Result<Summary> {
    let how = (false, Resumption::Always);
    match command {
        BenchmarkedCommand::Track => {
            let tracking = Tracking { keyframes: Switch::Off, ..Tracking::default() };
            track::track_into(dataset, out, how, CHECKPOINT_INTERVAL, &tracking, console)
        }
        BenchmarkedCommand::Slam => slam::slam_into(dataset, out, how, &Slamming::default(), console),
    }
}
