//! What is known of a frame from the frames on both sides of it.

use std::ops::ControlFlow;

use mba_mapper::hindsight::look_back;
use mba_mapper::run::RunWriter;
use mba_mapper::synth::{DepthSensor, NoiseModel, SceneName, SensorModel, SynthConfig};
use mba_mapper::tracking::TrackingOptions;
use mba_tests::blurred_sequence::BlurredSequence;
use mba_tests::handheld::{RenderedFrame, Shake, camera_of_width, tracker_config, workspace};
use mba_tracker::{ExpectedPath, Frame, FrameStatus, SimdLevel, Tracker};
use nalgebra::{Vector3, Vector6};

use crate::scenes::ROOM;

const EXPOSURE: f64 = 0.02;
const SHAKE: Shake = Shake { metres: 0.05, radians: 0.16, hertz: 1.2 };

/// When the first frame is taken, seconds: the camera is on its way.
const START: f64 = 0.2;

/// How the camera truly moves around the first frame.
fn true_path() -> ExpectedPath {
    let truth = SHAKE.exposure(START, EXPOSURE);
    let motion = truth.motion() / EXPOSURE;
    let translation = truth.mid().rotation.inverse() * Vector3::from(motion.fixed_rows::<3>(0));
    let mut velocity = motion;
    velocity.fixed_rows_mut::<3>(0).copy_from(&translation);
    ExpectedPath {
        velocity,
        acceleration: Vector6::zeros(),
        jerk: Vector6::zeros(),
        velocity_sigma: [0.01, 0.01],
        acceleration_sigma: [1.0, 1.0],
    }
}

#[test]
fn a_first_frame_moves_as_it_is_known_to() {
    let camera = camera_of_width(160);
    let render = |t: f64| RenderedFrame::new(&ROOM, &camera, t, EXPOSURE, SHAKE.exposure(t, EXPOSURE));
    let frames = [render(START), render(START + 1.0 / 30.0)];
    let config = tracker_config(camera);
    let mut memory = workspace(&config);
    let mut tracker = Tracker::new(&config, SimdLevel::new(), &mut memory).unwrap();
    let expected_path = Some(true_path());
    let first = tracker.track(&Frame { expected_path, ..frames[0].view() }).unwrap();
    // The world is the first frame's camera at mid exposure.
    let true_motion = true_path().velocity * EXPOSURE;
    let error = (first.world_from_camera.motion() - true_motion).norm();
    assert!(error < 1e-9 && first.blur > 1.0, "{error} of {}, {} px", true_motion.norm(), first.blur);
    // Nothing is left to be learnt from the next frame.
    let second = tracker.track(&frames[1].view()).unwrap();
    assert_eq!((second.status, second.revision), (FrameStatus::Ok, None));
}

/// A shaken recording.
fn recording(seed: u64, mean_blur_px: f64, sensor: SensorModel) -> BlurredSequence {
    BlurredSequence::new(SynthConfig {
        frames: 24,
        width: 320,
        height: 240,
        seed,
        mean_blur_px,
        sensor,
        ..SynthConfig::default()
    })
}

#[test]
fn both_ways_together_are_better_than_one() {
    let rolling = SensorModel { readout_seconds: 0.02, depth_delay_seconds: 0.011, ..SensorModel::IDEAL };
    for (name, sensor) in [("global", SensorModel::IDEAL), ("rolling", rolling)] {
        let errors = [1, 2, 3].map(|seed| recording(seed, 8.0, sensor).track_both_ways(name));
        let mean = |k: usize| errors.iter().map(|found| found[k].ate_m).sum::<f64>() / 3.0;
        let (before, after) = (mean(0), mean(1));
        println!("{name}: {errors:?}");
        assert!(after < 0.9 * before, "{name}: {errors:?}");
    }
}

#[test]
#[should_panic(expected = "what was measured belongs to another data set")]
fn measurements_of_another_recording_are_refused() {
    let filmed = recording(1, 0.3, SensorModel::IDEAL);
    let mut run = RunWriter::create(filmed.output("run"), filmed.describe()).unwrap();
    let go_on = || ControlFlow::Continue(());
    let _ = look_back(&filmed.dataset, &TrackingOptions::default(), run.record_mut(), &[], go_on);
}

#[test]
fn a_sharp_recording_stays_as_it_was_tracked() {
    let [before, after] = recording(1, 0.3, SensorModel::IDEAL).track_both_ways("sharp");
    assert_eq!(before, after);
}

/// Small images of a hall that is half out of the sensor's reach, and rows at times of their own: frames are lost.
fn hall(seed: u64) -> BlurredSequence {
    BlurredSequence::new(SynthConfig {
        frames: 24,
        width: 160,
        height: 120,
        scene: SceneName::Hall,
        seed,
        mean_blur_px: 5.0,
        noise: Some(NoiseModel::default()),
        depth: DepthSensor::StructuredLight,
        sensor: SensorModel { readout_seconds: 0.02, ..SensorModel::IDEAL },
        ..SynthConfig::default()
    })
}

#[test]
fn frames_that_are_lost_on_the_way_forwards_are_found_on_the_way_back() {
    for seed in [2, 5, 8] {
        let [before, after] = hall(seed).track_both_ways("run");
        println!("seed {seed}: {before:?} -> {after:?}");
        assert!(before.lost >= 5 && after.lost <= 1, "seed {seed}: {before:?} -> {after:?}");
        assert!(after.ate_m < 0.5 * before.ate_m, "seed {seed}: {before:?} -> {after:?}");
    }
}

#[test]
fn a_lost_frame_does_not_say_how_certain_it_is() {
    let frames = hall(5).track("run").frames;
    let lost = frames.iter().filter(|frame| frame.status == FrameStatus::Lost).count();
    assert!(lost >= 5, "{lost}");
    for (index, frame) in frames.iter().enumerate() {
        let is_lost = frame.status == FrameStatus::Lost;
        assert_eq!(frame.sigma_m.is_none(), is_lost, "frame {index}: {frame:?}");
    }
}
