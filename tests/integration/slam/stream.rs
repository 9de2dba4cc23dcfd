//! Frames that come by the clock.

use std::time::Duration;

use mba_mapper::slam::{Arrival, SlamSettings};
use mba_mapper::synth::SynthConfig;
use mba_tests::blurred_sequence::BlurredSequence;

#[test]
fn frames_by_the_clock_are_all_in_the_run_and_late_ones_counted() {
    let config =
        SynthConfig { frames: 9, width: 160, height: 120, mean_blur_px: 3.0, ..SynthConfig::default() };
    let sequence = BlurredSequence::new(config);
    let settings = SlamSettings {
        arrival: Arrival::RealTime,
        time_budget: Some(Duration::from_millis(300)),
        ..SlamSettings::default()
    };
    let summary = sequence.slam("run", &settings);
    let slam = summary.slam.expect("figures of the loop");
    assert_eq!(summary.frames.total, 9);
    assert_eq!(summary.frames.skipped, slam.late_frames);
    // The last frame is there after 8 / 30 s.
    assert!(slam.live_frames_per_second < 9.0 / (8.0 / 30.0), "{slam:?}");
}
