//! `mba localise`.

use mba_mapper::dataset::Dataset;
use mba_mapper::localisation::{KnownMap, LocaliseError, localise};
use mba_mapper::map::StoredMap;
use mba_mapper::run::{Merit, Run, RunWriter, Summary, plausibility};
use mba_mapper::tracking::{TrackingOptions, tracker_config};
use mba_tracker::{SimdLevel, TrackerConfig};
use serde_json::json;

use super::{calibrate, open, outcome};
use crate::args::localise::Localise;
use crate::console::Console;
use crate::failure::{OrBadInput, bad_input, failed, interrupted};
use crate::interrupt::{self, Resumption};
use crate::report::table;
use crate::written_run::{self, CAMERA_HINT, absolute, announce, claim};

/// Finds a recording in the map of a run and prints the summary.
///
/// # Errors
/// Bad input when map or recording cannot be used; failure when no frame is found or the results cannot be written.
pub fn run(args: &Localise, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let run = open::run(&args.run)?;
    let map = open::map(&run)?;
    if map.is_empty() {
        let message = format!("the map of {} is empty", run.folder.display());
        return Err(bad_input(message, "`mba map` makes one from the data set and a tracked run"));
    }
    let dataset = open::dataset(&args.recording, simd)?;
    let dataset = calibrate::completed(dataset, args.self_calibrate, console)?;
    let config = tracker_config(&dataset, &TrackingOptions::default());
    config.validate().or_bad_input(CAMERA_HINT)?;
    // Without images the size of the camera is a mere claim, for which no memory is taken.
    if !dataset.has_images() {
        return Err(outcome::failure(&dataset, ""));
    }
    let summary = localise_into((&run, &map), (&dataset, &config), args, console)?;
    console.result(&summary, table::summary)
}

/// Finds the frames of the recording and writes the run.
fn localise_into(
    (run, map): (&Run, &StoredMap),
    (dataset, config): (&Dataset, &TrackerConfig),
    args: &Localise,
    console: &Console,
) -> anyhow::Result<Summary> {
    let _saving = interrupt::saving();
    let folder = claim(&args.out, args.force, &[dataset.folder(), &run.folder])?;
    let describe = written_run::settings(dataset, &json!({ "map": absolute(&run.folder) }));
    let mut writer = RunWriter::create(folder, describe)?;
    dataset.warnings().iter().for_each(|warning| writer.record_mut().warn(warning.to_string()));
    let progress = console.progress(dataset.len(), "localising");
    let mut known = KnownMap::new(map.into(), run, dataset, config);
    let localised = localise(dataset, config, &mut known, &mut writer, || {
        progress.inc(1);
        interrupt::flow()
    });
    progress.finish_and_clear();
    let figures = match localised {
        Err(LocaliseError::Stopped) => {
            let (frames, all) = (writer.record().frames().len(), dataset.len());
            let message = format!("stopped after {frames} of {all} frames");
            return Err(interrupted(message, Resumption::Never.advice()));
        }
        other => other?,
    };
    if outcome::nothing_tracked(writer.record().frames()) {
        if writer.has_earlier() {
            writer.give_up();
        }
        let message =
            format!("no place of {} was recognised in {}", run.folder.display(), dataset.folder().display());
        return Err(failed(
            message,
            "the recording must show what the map shows, from near where its camera was",
        ));
    }
    if let Some(upright) = run.summary.upright {
        writer.record_mut().set_upright(upright);
    }
    writer.replace_earlier()?;
    calibrate::keep(dataset, &args.out)?;
    let track = writer.record();
    let merit = Merit::of(track.exposures(), dataset);
    let plausibility = plausibility(track.exposures(), track.frames(), dataset);
    let summary = writer.finish(|summary| {
        summary.localisation = Some(figures);
        summary.plausibility = plausibility;
        summary.trajectory = merit.trajectory;
        summary.blur = merit.blur;
    })?;
    announce(&summary, &args.out, console);
    outcome::check(&summary, dataset, console)?;
    Ok(summary)
}
