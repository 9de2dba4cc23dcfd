//! Films a blurred sequence, tracks it and makes a sharp map of it, all in a temporary folder, in less than a minute.
//!
//! `cargo run --release -p mba-mapper --example small_map`

use std::error::Error;
use std::ops::ControlFlow;

use mba_mapper::dataset;
use mba_mapper::mapping::{MapSettings, map_dataset};
use mba_mapper::output::{OutputFolder, Permission};
use mba_mapper::run::{Merit, Run, RunCamera, RunSettings, RunWriter};
use mba_mapper::synth::{SynthConfig, SynthSequence, write_dataset};
use mba_mapper::tracking::{TrackingOptions, track_dataset};

fn main() -> Result<(), Box<dyn Error>> {
    let place = tempfile::tempdir()?;
    let [data, tracked, mapped] = ["data", "tracked", "mapped"].map(|name| place.path().join(name));

    let config = SynthConfig { frames: 12, width: 160, height: 120, mean_blur_px: 3.0, ..Default::default() };
    write_dataset(&SynthSequence::new(config)?, &data, |_, _| ())?;
    let dataset = dataset::open(&data)?;
    let settings = RunSettings {
        program: "small_map".to_owned(),
        dataset: data.display().to_string(),
        frame_rate: dataset.calibration().frame_rate,
        camera: Some(RunCamera::from(dataset.calibration())),
        options: serde_json::Map::new(),
    };

    let folder = OutputFolder::for_run(&tracked, &Permission::default())?;
    let mut writer = RunWriter::create(folder, settings.clone())?;
    track_dataset(&dataset, &TrackingOptions::default(), &mut writer, |_| ControlFlow::Continue(()))?;
    let trajectory = Merit::of(writer.exposures(), &dataset).trajectory;
    writer.finish(|summary| summary.trajectory = trajectory)?;
    let run = Run::open(&tracked)?;

    let folder = OutputFolder::for_run(&mapped, &Permission::default())?;
    let go_on = |_| ControlFlow::Continue(());
    let summary = map_dataset(&dataset, &run, &MapSettings::default(), folder, false, settings, go_on)?;

    let map = summary.map.ok_or("there is no map")?;
    println!(
        "{} frames tracked, {} Gaussians from {} keyframes",
        run.exposures.len(),
        map.gaussians,
        map.keyframes
    );
    let error = run.summary.trajectory.ok_or("the trajectory cannot be compared")?.ate_m.rmse;
    println!("trajectory: {:.2} mm from the truth", 1e3 * error);
    for (psnr, what) in [(map.keyframe_psnr_captured, "captured"), (map.keyframe_psnr, "deblurred")] {
        println!("keyframes {what}: {:.1} dB", psnr.ok_or("there are no true images")?);
    }
    Ok(())
}
