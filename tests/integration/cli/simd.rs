//! `--simd`: every command computes with the level that it is told, and all levels find the same.

use std::path::Path;
use std::time::Duration;

use mba_mapper::synth::SynthConfig;
use mba_tests::blurred_sequence::{BlurredSequence, assert_same_map, assert_same_track, bytes};
use mba_tracker::SimdLevel;
use mba_tracker::simd::{level_name, levels_up_to};

use super::map::{arguments, kill};
use super::mba;

/// Names of the weakest and of the best level of this machine; none, and a note, where there is only one.
fn weakest_and_best() -> Option<[&'static str; 2]> {
    let levels = levels_up_to(SimdLevel::new());
    let (weakest, best) = (level_name(*levels.first()?), level_name(*levels.last()?));
    if weakest == best {
        eprintln!("skipped: this machine has {best} only");
        return None;
    }
    Some([weakest, best])
}

/// Runs a command of words, of which those that begin with `:` are paths in `folder`; returns its figures.
fn figures(folder: &Path, words: &str, how: &[&str]) -> serde_json::Value {
    let word = |word: &str| match word.strip_prefix(':') {
        Some(path) => folder.join(path).into_os_string(),
        None => word.into(),
    };
    mba(words.split(' ').chain(how.iter().copied()).chain(["--json"]).map(word)).json()
}

fn number(figures: &serde_json::Value, pointer: &str) -> f64 {
    figures
        .pointer(pointer)
        .and_then(serde_json::Value::as_f64)
        .unwrap_or_else(|| panic!("{pointer}: {figures}"))
}

/// Runs everything in turn into folders whose names end in `-name`; returns the figures of tracker, map, SLAM and mesh.
fn run_everything(folder: &Path, name: &str, how: &[&str]) -> [serde_json::Value; 4] {
    let run = |words: &str| figures(folder, &words.replace('@', name), how);
    let [track, map, slam] = [
        "track :data --out :track-@",
        "map :data --trajectory :track-@ --out :map-@ --max-keyframes 3",
        "slam :data --out :slam-@ --max-keyframes 3",
    ]
    .map(run);
    let mesh = run("mesh :map-@ --out :@.ply --voxel-cm 4");
    let _ = run("render :map-@ --poses :map-@/trajectory.txt --out :views-@");
    [track, map, slam, mesh]
}

#[test]
fn a_weaker_level_finds_the_same_with_any_number_of_threads() {
    let Some([weakest, best]) = weakest_and_best() else { return };
    let (frames, width, height) = (8, 128, 96);
    let sequence = BlurredSequence::new(SynthConfig {
        frames,
        width,
        height,
        mean_blur_px: 3.0,
        ..SynthConfig::default()
    });
    let folder = sequence.path("");
    let strong = run_everything(&folder, "best", &["--simd", best]);
    let weak = run_everything(&folder, "weak", &["--simd", weakest, "--threads", "1"]);
    let _ = run_everything(&folder, "again", &["--simd", weakest, "--threads", "2"]);
    let _ = run_everything(&folder, "default", &[]);

    // Sums are rounded at other places, and the estimates are the same far below what they are worth: the tracker is right to
    // about a millimetre, and two seeds of a map differ by some tenths of a dB.
    let differ =
        |which: usize, pointer: &str| (number(&strong[which], pointer) - number(&weak[which], pointer)).abs();
    for run in [0, 1, 2] {
        assert!(number(&strong[run], "/trajectory/ate_m/rmse") < 2e-3, "{}", strong[run]);
        assert!(differ(run, "/trajectory/ate_m/rmse") < 2e-5, "{} {}", strong[run], weak[run]);
    }
    for run in [1, 2] {
        assert!(number(&strong[run], "/map/heldout_psnr") > 25.0, "{}", strong[run]);
        assert!(differ(run, "/map/heldout_psnr") < 0.15, "{} {}", strong[run], weak[run]);
        assert!(differ(run, "/map/keyframe_psnr") < 0.15, "{} {}", strong[run], weak[run]);
    }
    assert!(differ(3, "/area_m2") < 0.02 * number(&strong[3], "/area_m2"), "{} {}", strong[3], weak[3]);

    // The level went all the way: nothing that is written with all digits is the same.
    for file in ["track-@/exposures.txt", "map-@/map.ply", "slam-@/exposures.txt", "slam-@/map.ply", "@.ply"]
    {
        let of = |name: &str| bytes(&sequence.path(&file.replace('@', name)));
        assert!(of("weak") != of("best"), "{file} does not depend on the level");
        assert!(of("weak") == of("again"), "{file} depends on the number of threads");
        assert!(of("best") == of("default"), "the best level is not the default of {file}");
    }
    assert_same_track(&sequence.path("track-weak"), &sequence.path("track-again"));
    for run in ["map", "slam"] {
        let [one, two] = ["weak", "again"].map(|name| sequence.path(&format!("{run}-{name}")));
        assert_same_map(&one, &two);
    }
}

#[test]
fn a_level_that_the_machine_has_not_is_refused_with_those_that_it_has() {
    let refused = mba(["info", "nowhere", "--simd", "mmx"]);
    let levels = levels_up_to(SimdLevel::new());
    let mut parts = vec!["--simd mmx", "this machine has"];
    parts.extend(levels.iter().map(|level| level_name(*level)));
    refused.assert_error(2, &parts);
}

#[test]
fn a_checkpoint_belongs_to_a_level() {
    let Some([weakest, best]) = weakest_and_best() else { return };
    let sequence = BlurredSequence::tiny();
    let _ = sequence.run_of("run", sequence.truth());
    let folder = sequence.path("");
    kill(&folder, "parts", &["--checkpoint-interval", "0"], Duration::ZERO);
    let other = mba(arguments(&folder, "parts", &["--resume", "--simd", weakest]));
    other.assert_error(2, &["parts/checkpoint", "another SIMD level", "--simd"]);
    // The default is the best level, also where it is named.
    let _ = mba(arguments(&folder, "parts", &["--resume", "--simd", best])).json();
    let _ = mba(arguments(&folder, "whole", &[])).json();
    assert_same_map(&sequence.path("whole"), &sequence.path("parts"));
}
