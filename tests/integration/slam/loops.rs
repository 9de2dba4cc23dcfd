//! Places that are seen again.

use std::fs;
use std::time::Duration;

use mba_mapper::dataset::{self, Dataset};
use mba_mapper::run::{FrameStatus, Run};
use mba_mapper::slam::SlamSettings;
use mba_mapper::synth::{CameraMotion, DepthSensor, NoiseModel, SynthConfig};
use mba_tests::blurred_sequence::BlurredSequence;

/// Once round the room, in seven seconds.
fn round() -> SynthConfig {
    SynthConfig {
        frames: 200,
        width: 320,
        height: 240,
        mean_blur_px: 6.0,
        motion: CameraMotion::Loop,
        noise: Some(NoiseModel::default()),
        depth: DepthSensor::StructuredLight,
        ..SynthConfig::default()
    }
}

/// Without a refinement worth the name: it is about the loop.
fn settings(loops: bool) -> SlamSettings {
    SlamSettings { loops, time_budget: Some(Duration::from_secs(1)), ..SlamSettings::default() }
}

#[test]
fn a_loop_halves_the_drift_and_a_lost_tracker_finds_a_place_it_left_long_ago() {
    let sequence = BlurredSequence::new(round());
    let [on, off] = [true, false].map(|loops| {
        let summary = sequence.slam(if loops { "on" } else { "off" }, &settings(loops));
        (summary.trajectory.unwrap().end_drift_m, summary.slam.unwrap().loops)
    });
    // Measured: 1 mm and 11 mm.
    println!("drift {on:?} with and {off:?} without loops");
    assert!(on.1 >= 1 && off.1 == 0);
    assert!(on.0 < 0.5 * off.0, "{} m instead of {} m", on.0, off.0);

    let data = kidnapped(&sequence);
    let summary = sequence.slam_of(&data, "kidnapped", &settings(true));
    assert!(summary.slam.unwrap().relocalisations >= 1, "{:?}", summary.slam);
    let run = Run::open(&sequence.path("kidnapped")).unwrap();
    assert_eq!(run.frames.last().unwrap().status, FrameStatus::Ok);
    // Measured: 0.4 mm.
    assert!(summary.trajectory.unwrap().end_drift_m < 0.005);
}

#[test]
fn a_path_that_the_keyframes_no_longer_cover_is_tracked_all_the_same() {
    let sequence = BlurredSequence::new(round());
    let few = SlamSettings { max_keyframes: 25, ..settings(true) };
    let figures = sequence.slam("few", &few).slam.unwrap();
    // Measured: 2.7 mm, and 10 mm where the map is judged by keyframes that are far away.
    let ate = figures.tracked_ate_m.unwrap();
    assert!(ate < 0.004 && figures.loops >= 1, "{ate} m, {figures:?}");
}

/// The data set without the frames between a third of the way and nearly its end, where the camera began.
pub(crate) fn kidnapped(sequence: &BlurredSequence) -> Dataset {
    for list in ["rgb.txt", "depth.txt", "associations.txt"] {
        let path = sequence.path("data").join(list);
        let Ok(text) = fs::read_to_string(&path) else { continue };
        let (comments, rows): (Vec<&str>, Vec<&str>) = text.lines().partition(|line| line.starts_with('#'));
        let kept = rows[..70].iter().chain(&rows[185..]);
        let lines: Vec<&str> = comments.iter().chain(kept).copied().collect();
        fs::write(&path, lines.join("\n") + "\n").unwrap();
    }
    dataset::open(&sequence.path("data")).unwrap()
}
