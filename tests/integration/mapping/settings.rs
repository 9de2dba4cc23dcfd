//! What can be chosen about a map.

use std::time::Duration;

use mba_mapper::mapping::MapSettings;
use mba_mapper::run::Run;
use mba_mapper::synth::SynthConfig;
use mba_tests::blurred_sequence::{BlurredSequence, names};

/// A small sequence with a mean blur of that many pixels in that many seconds.
fn sequence(mean_blur_px: f64, exposure_seconds: f64) -> BlurredSequence {
    let defaults = SynthConfig::default();
    let config = SynthConfig { frames: 6, width: 96, height: 72, mean_blur_px, exposure_seconds, ..defaults };
    BlurredSequence::new(config)
}

#[test]
fn sharp_frames_need_no_model_of_blur() {
    // Seven pixels from frame to frame, hardly any while the shutter is open.
    let sequence = sequence(0.1, 0.0005);
    let run = sequence.run_of("run", sequence.truth());
    let settings = MapSettings { blur: false, ..MapSettings::default() };
    let figures = sequence.map(&run, "mapped", &settings).map.unwrap();
    println!("{figures:?}");
    // Measured: 28.0 dB in new views, 29.4 dB in keyframes.
    assert!(figures.heldout_psnr.unwrap() > 26.5 && figures.keyframe_psnr.unwrap() > 28.0, "{figures:?}");
    let exposures = Run::open(&sequence.path("mapped")).unwrap().exposures;
    for (k, exposure) in exposures.iter().enumerate() {
        let motion = exposure.start.inverse().compose(&exposure.end);
        assert!(motion.translation.norm() < 1e-8 && motion.rotation.angle() < 1e-8, "frame {k} moves");
    }
}

#[test]
fn the_map_is_done_when_the_time_is_up() {
    let sequence = sequence(3.0, 0.016);
    let run = sequence.run_of("run", sequence.truth());
    let budget = Duration::from_secs(2);
    let settings = MapSettings { time_budget: Some(budget), ..MapSettings::default() };
    let summary = sequence.map(&run, "mapped", &settings);
    let figures = summary.map.unwrap();
    println!("{figures:?}");
    assert!(summary.complete && names(&sequence.path("mapped")).contains(&"map.ply".to_owned()));
    // Nothing is left to do for the last tenth but to write files; a busy machine may take longer.
    assert!((1.5..4.0).contains(&figures.seconds), "{} s of 2 s", figures.seconds);
}

#[test]
fn bounds_of_keyframes_and_gaussians_hold() {
    let sequence = sequence(3.0, 0.016);
    let run = sequence.run_of("run", sequence.truth());
    let settings = MapSettings {
        max_gaussians: Some(700),
        max_keyframes: 1,
        time_budget: Some(Duration::from_secs(1)),
        ..MapSettings::default()
    };
    let summary = sequence.map(&run, "mapped", &settings);
    let figures = summary.map.unwrap();
    assert!((1..=700).contains(&figures.gaussians), "{} Gaussians", figures.gaussians);
    assert_eq!((figures.keyframes, names(&sequence.path("mapped/deblurred")).len()), (1, 1));
    assert_eq!(Run::open(&sequence.path("mapped")).unwrap().exposures.len(), 6);
}

#[test]
fn frames_that_the_map_was_not_made_of_are_predicted_with_their_blur() {
    let sequence = sequence(4.0, 0.016);
    let run = sequence.run_of("run", sequence.truth());
    let predicted = |blur: bool| {
        let settings = MapSettings { blur, max_keyframes: 3, ..MapSettings::default() };
        let figures = sequence.map(&run, &format!("mapped_{blur}"), &settings).map.unwrap();
        println!("{figures:?}");
        assert_eq!((figures.keyframes, figures.predicted_frames), (3, 3));
        figures.predicted_psnr.unwrap()
    };
    let [with, without] = [true, false].map(predicted);
    // Measured: 30.3 and 26.0 dB.
    assert!(with > 29.3 && with > without + 3.0, "{with} dB, without a model of blur {without} dB");
}
