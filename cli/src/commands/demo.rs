//! `mba demo`.

use std::path::Path;

use mba_mapper::dataset::Dataset;
use mba_mapper::mapping::MapSettings;
use mba_mapper::run::Run;
use mba_mapper::synth::{DepthSensor, NoiseModel, SynthConfig};
use mba_tracker::SimdLevel;

use super::{map, open, synth, track};
use crate::args::map::Mapping;
use crate::args::{Demo, Tracking};
use crate::console::Console;
use crate::interrupt::Resumption;
use crate::report::{self, table};
use crate::written_run::advise_report;

/// Synthesises a blurred sequence, tracks it, maps it, prints the figures of the map and writes its charts and report.
///
/// # Errors
/// Failure when the folder cannot be written.
pub fn run(args: &Demo, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let (name, config) =
        if args.quick { ("quick", quick()) } else { ("full", SynthConfig { frames: 60, ..realistic() }) };
    let data = args.out.join(format!("data-{name}"));
    let tracked = args.out.join(format!("run-{name}"));
    let mapped = args.out.join(format!("mapped-{name}"));
    let dataset = sequence(config, &data, simd, console)?;
    let how = (false, Resumption::Never);
    let interval = MapSettings::default().checkpoint_interval;
    track::track_into(&dataset, &tracked, how, interval, &Tracking::default(), console)?;
    let run = Run::open(&tracked)?;
    let summary = map::map_into(&dataset, &run, &mapped, how, &Mapping::default(), console)?;
    let path = report::write(&Run::open(&mapped)?, simd, Some(&dataset), false).or_else(advise_report)?;
    console.result(&summary, table::summary)?;
    console.note(format!("open {} in a browser", path.display()));
    Ok(())
}

/// A sequence that is rendered and tracked within seconds, and mapped within a minute.
fn quick() -> SynthConfig {
    SynthConfig { frames: 24, width: 320, height: 240, mean_blur_px: 5.0, ..realistic() }
}

/// A noisy camera and a structured-light depth sensor.
fn realistic() -> SynthConfig {
    SynthConfig {
        mean_blur_px: 10.0,
        noise: Some(NoiseModel::default()),
        depth: DepthSensor::StructuredLight,
        ..SynthConfig::default()
    }
}

/// The sequence of an earlier demo in the same folder, or a new one.
fn sequence(
    config: SynthConfig,
    folder: &Path,
    simd: SimdLevel,
    console: &Console,
) -> anyhow::Result<Dataset> {
    // The lists of a sequence are written last, so one that can be opened is whole.
    if let Ok(dataset) = open::open_with(folder, simd) {
        console.note(format!("using the sequence in {}", folder.display()));
        return Ok(dataset);
    }
    console.note(format!("rendering {} blurred frames into {}", config.frames, folder.display()));
    synth::synthesise(config, folder, console)?;
    open::dataset(folder, simd)
}
