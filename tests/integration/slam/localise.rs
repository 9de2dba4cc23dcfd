//! A recording in the map of another one.

use std::ops::ControlFlow;

use mba_mapper::evaluation::align_poses;
use mba_mapper::localisation::{KnownMap, localise};
use mba_mapper::map::StoredMap;
use mba_mapper::run::{FrameStatus, LocalisationFigures, Run, RunWriter, mid_pose};
use mba_mapper::slam::SlamSettings;
use mba_mapper::synth::{CameraMotion, SceneName, SynthConfig};
use mba_mapper::tracking::{TrackingOptions, tracker_config};
use mba_mapper::trajectory_file::TimedPose;
use mba_tests::blurred_sequence::BlurredSequence;
use mba_tracker::geometry::RigidTransform;

/// Once round the room: the map.
fn round() -> SynthConfig {
    let (frames, width, height) = (200, 160, 120);
    SynthConfig {
        frames,
        width,
        height,
        mean_blur_px: 3.5,
        motion: CameraMotion::Loop,
        ..SynthConfig::default()
    }
}

/// To and fro on one side of it, by another hand.
fn to_and_fro() -> SynthConfig {
    let (frames, width, height) = (40, 160, 120);
    SynthConfig { frames, width, height, mean_blur_px: 3.0, seed: 5, ..SynthConfig::default() }
}

/// A mapped run of the sequence.
fn mapped(sequence: &BlurredSequence) -> (Run, StoredMap) {
    sequence.slam("mapped", &SlamSettings { max_keyframes: 30, ..SlamSettings::default() });
    let run = Run::open(&sequence.path("mapped")).unwrap();
    let map = StoredMap::read(&StoredMap::path(&run.folder).unwrap()).unwrap();
    (run, map)
}

/// Finds `sequence` in a map and writes where it was into its folder `found`.
fn find(sequence: &BlurredSequence, run: &Run, map: &StoredMap) -> (Run, LocalisationFigures) {
    let config = tracker_config(&sequence.dataset, &TrackingOptions::default());
    let mut map = KnownMap::new(map.into(), run, &sequence.dataset, &config);
    let folder = sequence.path("found");
    let mut writer = RunWriter::create_in(&folder, sequence.describe()).unwrap();
    let go_on = || ControlFlow::Continue(());
    let figures = localise(&sequence.dataset, &config, &mut map, &mut writer, go_on).unwrap();
    writer.finish(|_| ()).unwrap();
    (Run::open(&folder).unwrap(), figures)
}

/// Where the world of the true poses is in that of a run of the sequence.
fn world_from_truth(sequence: &BlurredSequence, run: &Run) -> RigidTransform {
    let poses: Vec<TimedPose> = run.exposures.iter().map(mid_pose).collect();
    align_poses(sequence.dataset.ground_truth(), &poses, 0.01).unwrap().reference_from_estimate.inverse()
}

#[test]
fn a_recording_on_another_path_is_found_in_the_world_of_the_map_and_one_of_elsewhere_nowhere() {
    let filmed = BlurredSequence::new(round());
    let (run, map) = mapped(&filmed);
    let world_from_truth = world_from_truth(&filmed, &run);

    let second = BlurredSequence::new(to_and_fro());
    let (found, figures) = find(&second, &run, &map);
    // Both are in the room's own world, without an alignment of their own.
    let errors: Vec<f64> = found
        .exposures
        .iter()
        .zip(second.truth())
        .map(|(found, truth)| {
            (found.mid.translation - world_from_truth.compose(&truth.mid).translation).norm()
        })
        .collect();
    let rmse = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
    println!("{rmse} m, {figures:?}, {:?}", found.summary.frames);
    assert_eq!(found.summary.frames.lost, 0);
    assert!(rmse < 0.01, "{rmse} m");
    assert!(figures.frames_on_map > 30 && figures.recognised >= 1, "{figures:?}");

    let elsewhere = BlurredSequence::new(SynthConfig { scene: SceneName::Hall, ..to_and_fro() });
    let (found, figures) = find(&elsewhere, &run, &map);
    assert!(found.frames.iter().all(|frame| frame.status == FrameStatus::Lost), "{figures:?}");
}
