//! Cameras that expose rows one after the other, with depth of another time and a lens that darkens the corners.

use std::ops::ControlFlow;

use mba_mapper::dataset::{Calibration, Shutter, Vignetting};
use mba_mapper::map::MapKind;
use mba_mapper::mapping::{MapSettings, map_dataset};
use mba_mapper::run::{Run, Summary};
use mba_mapper::synth::{SensorModel, SynthConfig};
use mba_tests::blurred_sequence::BlurredSequence;

fn sequence(sensor: SensorModel) -> BlurredSequence {
    let defaults = SynthConfig::default();
    BlurredSequence::new(SynthConfig {
        frames: 8,
        width: 128,
        height: 96,
        mean_blur_px: 2.0,
        sensor,
        ..defaults
    })
}

/// A map from the true exposures of a camera of which that is known.
fn mapped(sequence: &BlurredSequence, known: Calibration, kind: MapKind) -> Summary {
    let dataset = sequence.dataset.clone().with_calibration(known).expect("a valid calibration");
    let run: Run = sequence.run_of("run", sequence.truth());
    let settings = MapSettings { kind, ..MapSettings::default() };
    let out = sequence.output("mapped");
    let go_on = |_| ControlFlow::Continue(());
    map_dataset(&dataset, &run, &settings, out, false, sequence.describe(), go_on).expect("a map")
}

fn rolling_sequence() -> BlurredSequence {
    sequence(SensorModel { readout_seconds: 0.02, depth_delay_seconds: 0.011, ..SensorModel::IDEAL })
}

/// PSNR of deblurred keyframes with and without the times of rows and depth.
fn with_and_without_times(kind: MapKind) -> [f64; 2] {
    let sequence = rolling_sequence();
    let known = sequence.dataset.calibration().clone();
    assert_eq!(known.readout.readout_seconds(), Some(0.02));
    let at_once = Calibration { readout: Shutter::Global, depth_delay_seconds: Some(0.0), ..known.clone() };
    [known, at_once].map(|known| mapped(&sequence, known, kind).map.unwrap().keyframe_psnr.unwrap())
}

#[test]
fn keyframes_are_global_shutter_pictures_if_the_readout_is_known() {
    let [with, without] = with_and_without_times(MapKind::Gaussians);
    println!("{with} dB with the times of rows and depth, {without} dB without");
    // Measured: 31.3 and 26.4 dB.
    assert!(with > without + 3.0, "{with} dB, {without} dB");
}

#[test]
fn a_field_has_rows_too() {
    let [with, without] = with_and_without_times(MapKind::Field);
    println!("{with} dB with the times of rows and depth, {without} dB without");
    // Measured: 31.4 and 26.2 dB.
    assert!(with > without + 3.0, "{with} dB, {without} dB");
}

#[test]
fn keyframes_have_the_fall_off_of_the_lens() {
    let vignetting = Vignetting { a2: -0.5, a4: 0.1 };
    let sequence = sequence(SensorModel { vignetting, ..SensorModel::IDEAL });
    let known = sequence.dataset.calibration().clone();
    assert_eq!(known.vignetting, vignetting);
    let [with, without] = [vignetting, Vignetting::NONE].map(|vignetting| {
        let known = Calibration { vignetting, ..known.clone() };
        mapped(&sequence, known, MapKind::Gaussians).map.unwrap().loss
    });
    println!("loss {with} with the fall-off, {without} without");
    // Measured: 0.0154 and 0.0171. Frames that look nearly the same way hide much of the fall-off in the colours of the map.
    // Deblurred keyframes hardly differ: what the map does not explain comes back from the captured picture.
    assert!(with < 0.95 * without, "{with}, {without}");
}

#[test]
fn the_gains_of_frames_follow_their_exposure_times() {
    let sequence = sequence(SensorModel { auto_exposure: true, ..SensorModel::IDEAL });
    let settings = MapSettings { max_keyframes: 5, ..MapSettings::default() };
    let run = sequence.run_of("run", sequence.truth());
    let figures = sequence.map(&run, "mapped", &settings).map.unwrap();
    let frames = Run::open(&sequence.path("mapped")).unwrap().frames;
    let gains: Vec<f64> = frames.iter().map(|frame| frame.gain).collect();
    let seconds: Vec<f64> = (0..gains.len()).map(|k| sequence.dataset.exposure_seconds(k)).collect();
    println!("gains {gains:?}, exposures {seconds:?}, {figures:?}");
    let (least, most) =
        seconds.iter().fold((f64::INFINITY, 0.0_f64), |(least, most), s| (least.min(*s), most.max(*s)));
    assert!(most > 1.2 * least, "exposures from {least} to {most} s test nothing");
    // The same sensor gain for all: light goes with the exposure time.
    for k in 1..gains.len() {
        let (ratio, expected) = (gains[k] / gains[0], seconds[k] / seconds[0]);
        // Measured: 0.5 % and 8 %. Frames between keyframes are fitted at half the resolution, where the map is brighter.
        let tolerance = if frames[k].keyframe != 0 { 0.015 } else { 0.1 };
        assert!((ratio / expected - 1.0).abs() < tolerance, "frame {k}: {ratio} instead of {expected}");
    }
}
