//! A run that is stopped goes on to the same files, also when the tracker had been told where it is.

use std::ops::ControlFlow;
use std::path::Path;

use mba_mapper::dataset::Dataset;
use mba_mapper::output::OutputFolder;
use mba_mapper::run::{Run, RunSettings, Summary};
use mba_mapper::slam::{SlamError, SlamProgress, SlamSettings, run_slam};
use mba_mapper::synth::{CameraMotion, DepthSensor, SynthConfig};
use mba_tests::blurred_sequence::{BlurredSequence, assert_same_map};

use super::loops::kidnapped;

/// Once round the room; nothing but its size makes it quick.
fn round() -> SynthConfig {
    SynthConfig {
        frames: 200,
        width: 160,
        height: 120,
        mean_blur_px: 3.0,
        motion: CameraMotion::Loop,
        noise: None,
        depth: DepthSensor::Exact,
        ..SynthConfig::default()
    }
}

/// Where a part of the run ends.
#[derive(Clone, Copy)]
enum Stop {
    Frame(usize),
    Refinement(f64),
    Never,
}

/// A part of a run, which goes on from the part before.
fn part(dataset: &Dataset, out: &Path, stop: Stop) -> Result<Summary, SlamError> {
    let folder = OutputFolder::for_run(out, &Default::default()).unwrap();
    let describe = RunSettings::new("test", dataset);
    let observe = |at: SlamProgress| {
        let stops = match (at, stop) {
            (SlamProgress::Frames { frames, .. }, Stop::Frame(last)) => frames >= last,
            (SlamProgress::Refinement { position, .. }, Stop::Refinement(last)) => position >= last,
            _ => false,
        };
        if stops { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    run_slam(dataset, &SlamSettings::default(), folder, true, describe, observe)
}

#[test]
fn a_run_that_is_stopped_anywhere_ends_like_one_that_was_not() {
    let sequence = BlurredSequence::new(round());
    let dataset = kidnapped(&sequence);
    let [whole, parts] = ["whole", "parts"].map(|name| sequence.path(name));
    let expected = part(&dataset, &whole, Stop::Never).unwrap();
    let counts = |summary: &Summary| {
        summary.slam.map(|slam| (slam.loops, slam.relocalisations, slam.retired_keyframes))
    };
    println!("loops, relocalisations, retired keyframes: {:?}", counts(&expected));
    assert!(counts(&expected).unwrap().1 >= 1, "the tracker was never told where it is");
    let stops = [1, 2, 3, 40, 71, 73, 76, dataset.len()].map(Stop::Frame);
    let stops = stops.into_iter().chain([0.0, 0.3, 0.31, 0.9].map(Stop::Refinement));
    for stop in stops {
        let stopped = part(&dataset, &parts, stop).unwrap_err();
        assert!(matches!(stopped, SlamError::Stopped), "{stopped}");
        assert!(!Run::open(&parts).unwrap().summary.complete);
    }
    let found = part(&dataset, &parts, Stop::Never).unwrap();
    assert_same_map(&whole, &parts);
    assert_eq!(counts(&found), counts(&expected));
    assert_eq!((found.trajectory, found.frames), (expected.trajectory, expected.frames));
    assert_eq!(found.warnings, expected.warnings);
}
