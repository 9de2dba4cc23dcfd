//! `mba synth`.

use std::ops::ControlFlow;
use std::path::Path;

use mba_mapper::synth::{SynthConfig, SynthError, SynthSequence, write_dataset_while};
use serde::Serialize;

use crate::args::synth::Synth;
use crate::console::Console;
use crate::failure::{OrBadInput, interrupted, is_disk_full};
use crate::interrupt::{self, Resumption};
use crate::report::table::pairs;
use crate::written_run::{OUT_HINT, refuse};

/// What is printed.
#[derive(Clone, Debug, Serialize)]
pub struct Written {
    folder: String,
    frames: usize,
    mean_blur_px: f64,
    largest_p95_blur_px: f64,
    largest_subframe_count: usize,
}

/// Renders a sequence and prints what was written.
///
/// # Errors
/// Bad input when a setting is out of range, the response unreadable or the folder in use; failure when it cannot be
/// written.
pub fn run(args: &Synth, console: &Console) -> anyhow::Result<()> {
    let config = args.config().or_bad_input("see `mba synth --help` for what a response is")?;
    let written = synthesise(config, &args.out, console)?;
    console.result(&written, table)
}

/// Renders the sequence of `config` into the folder `out`.
///
/// # Errors
/// As [`run`].
pub fn synthesise(config: SynthConfig, out: &Path, console: &Console) -> anyhow::Result<Written> {
    console.detail(format!("{config:?}"));
    let sequence = SynthSequence::new(config).or_else(advise)?;
    let progress = console.progress(sequence.len(), "rendering");
    let summary = write_dataset_while(&sequence, out, |_, _| {
        interrupt::flow()?;
        progress.inc(1);
        ControlFlow::Continue(())
    });
    progress.finish_and_clear();
    let summary = summary.or_else(advise)?;
    Ok(Written {
        folder: out.display().to_string(),
        frames: summary.frames,
        mean_blur_px: summary.mean_blur_px,
        largest_p95_blur_px: summary.largest_p95_px,
        largest_subframe_count: summary.most_sub_frames,
    })
}

fn advise<T>(error: SynthError) -> anyhow::Result<T> {
    let hint = match error {
        SynthError::File(error) if is_disk_full(&error) => return Err(error.into()),
        SynthError::Output(error) => return refuse(error),
        SynthError::Stopped => return Err(interrupted(error.to_string(), Resumption::Never.advice())),
        SynthError::File(_) => OUT_HINT,
        SynthError::FolderNotEmpty { .. } => "nothing that exists is overwritten",
        _ => "see `mba synth --help` for the ranges",
    };
    Err(error).or_bad_input(hint)
}

fn table(written: &Written) -> String {
    pairs(&[
        ("data set", written.folder.clone()),
        ("frames", written.frames.to_string()),
        ("mean blur", format!("{:.1} px", written.mean_blur_px)),
        ("largest blur (p95)", format!("{:.1} px", written.largest_p95_blur_px)),
        ("sub-frames, at most", written.largest_subframe_count.to_string()),
    ])
}
