//! Films a blurred sequence, tracks it and makes a sharp map of it, all in a temporary folder, in less than a minute.
//!
//! `cargo run --release -p mba-mapper --example small_map`

use std::ops::ControlFlow;

use mba_mapper::dataset;
use mba_mapper::mapping::{MapSettings, map_dataset};
use mba_mapper::output::{OutputFolder, Permission};
use mba_mapper::run::{Merit, Run, RunSettings, RunWriter};
use mba_mapper::synth::{SynthConfig, SynthSequence, write_dataset};
use mba_mapper::tracking::{TrackingOptions, track_dataset};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let place = tempfile::tempdir()?;
    let [data, tracked, mapped] = ["data", "tracked", "mapped"].map(|name| place.path().join(name));
    let config = SynthConfig { frames: 12, width: 160, height: 120, mean_blur_px: 3.0, ..Default::default() };
    write_dataset(&SynthSequence::new(config)?, &data, |_, _| ())?;

    let dataset = dataset::open(&data)?;
    let settings = RunSettings::new("small_map", &dataset);
    let mut writer = RunWriter::create_in(&tracked, settings.clone())?;
    track_dataset(&dataset, &TrackingOptions::default(), &mut writer, |_| ControlFlow::Continue(()))?;
    let trajectory = Merit::of(writer.record().exposures(), &dataset).trajectory;
    writer.finish(|summary| summary.trajectory.clone_from(&trajectory))?;
    let run = Run::open(&tracked)?;

    let folder = OutputFolder::for_run(&mapped, &Permission::default())?;
    let go_on = |_| ControlFlow::Continue(());
    let summary = map_dataset(&dataset, &run, &MapSettings::default(), folder, false, settings, go_on)?;

    let map = summary.map.ok_or("there is no map")?;
    let error = 1e3 * trajectory.ok_or("the trajectory cannot be compared")?.ate_m.rmse;
    println!("{} keyframes, {} Gaussians, {error:.2} mm from the true path", map.keyframes, map.gaussians);
    for (psnr, what) in [(map.keyframe_psnr_captured, "captured"), (map.keyframe_psnr, "deblurred")] {
        println!("keyframes {what}: {:.1} dB", psnr.ok_or("there are no true images")?);
    }
    Ok(())
}
