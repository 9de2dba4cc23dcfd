//! `mba import`.

use mba_mapper::dataset;
use mba_mapper::import::{ImportError, ImportOptions, Source, import};
use serde::Serialize;

use super::open::dataset_hint;
use crate::args::import::Import;
use crate::console::Console;
use crate::failure::{OrBadInput, is_disk_full};
use crate::report::table::pairs;
use crate::written_run::refuse;

/// What is printed.
#[derive(Clone, Debug, Serialize)]
struct Written {
    source: String,
    kind: &'static str,
    folder: String,
    frames: usize,
    colour_images: usize,
    depth_images: usize,
    exposures: usize,
    poses: usize,
    gyroscope_samples: usize,
    accelerometer_samples: usize,
    notes: Vec<String>,
}

/// Brings a recording in and prints what there is.
///
/// # Errors
/// Bad input when the source is unknown, damaged or lacks something, or the folder may not be written; failure when the disk
/// is full.
pub fn run(args: &Import, console: &Console) -> anyhow::Result<()> {
    let source = Source::recognise(&args.source).or_else(advise)?;
    let options =
        ImportOptions { colour_topic: args.colour_topic.clone(), depth_topic: args.depth_topic.clone() };
    let progress = console.progress(0, "importing");
    let imported = import(&source, &args.out, &options, &|done, all| {
        progress.set_length(all);
        progress.set_position(done);
    });
    progress.finish_and_clear();
    let imported = imported.or_else(advise)?;
    let frames = dataset::open(&args.out).or_bad_input("give the folder again")?.len();
    let [gyroscope_samples, accelerometer_samples] = imported.inertial_samples;
    let written = Written {
        source: args.source.display().to_string(),
        kind: source.kind(),
        folder: args.out.display().to_string(),
        frames,
        colour_images: imported.colour_images,
        depth_images: imported.depth_images,
        exposures: imported.exposures,
        poses: imported.poses,
        gyroscope_samples,
        accelerometer_samples,
        notes: imported.notes,
    };
    console.result(&written, table)?;
    console.note(format!("`mba info {}` says what is recorded and what is assumed", args.out.display()));
    Ok(())
}

fn advise<T>(error: ImportError) -> anyhow::Result<T> {
    let hint = match error {
        ImportError::Output(error) => return refuse(error),
        ImportError::File(error) if is_disk_full(&error) => return Err(error.into()),
        ImportError::Dataset(ref error) | ImportError::Unfit { ref error, .. } => {
            dataset_hint(error).into_owned()
        }
        ImportError::Unusable { ref hint, .. } => hint.clone(),
        ImportError::Unknown { .. } => "see docs/import.md for how each has to lie on the disk".to_owned(),
        ImportError::Damaged { .. } => "restore the file, or record again".to_owned(),
        _ => "correct that line or file".to_owned(),
    };
    Err(error).or_bad_input(hint)
}

fn table(written: &Written) -> String {
    let count = |count: usize| if count == 0 { "none".to_owned() } else { count.to_string() };
    let inertia = match (written.gyroscope_samples, written.accelerometer_samples) {
        (0, 0) => "none".to_owned(),
        (rates, forces) => format!("{rates} of the gyroscope, {forces} of the accelerometer"),
    };
    let mut rows = vec![
        ("data set", written.folder.clone()),
        ("made from", format!("{} ({})", written.source, written.kind)),
        ("frames", written.frames.to_string()),
        ("images", format!("{} of colour, {} of depth", written.colour_images, written.depth_images)),
        ("exposure times", count(written.exposures)),
        ("recorded poses", count(written.poses)),
        ("inertial samples", inertia),
    ];
    rows.extend(written.notes.iter().map(|note| ("note", note.clone())));
    pairs(&rows)
}
