//! `mba slam` and `mba ablate`.

use std::fs;

use mba_mapper::run::Run;

use super::{Workplace, mba};

#[test]
fn slam_writes_a_whole_run_and_prints_its_figures() {
    let place = Workplace::new();
    let arguments = ["slam".into(), place.path("data"), "--out".into(), place.path("run"), "--json".into()];
    let summary = mba(arguments).json();
    let run = Run::open(&place.path("run")).unwrap();
    assert!(
        run.summary.complete && run.exposures.len() as u64 == summary["frames"]["total"].as_u64().unwrap()
    );
    for figure in ["frames_per_second", "live_frames_per_second", "loops", "late_frames"] {
        assert!(summary["slam"][figure].is_number(), "{figure} is missing: {summary}");
    }
    for file in ["trajectory.txt", "exposures.txt", "frames.csv", "map.ply"] {
        assert!(fs::metadata(place.path("run").join(file)).is_ok_and(|file| file.len() > 0), "{file}");
    }
    for option in ["blur", "virtual_views", "reference", "depth_term", "loop"] {
        assert!(!summary["options"][option].is_null(), "{option} is missing: {summary}");
    }
}

#[test]
fn bad_input_is_told_in_one_line() {
    let place = Workplace::new();
    fs::write(place.path("file"), "x").unwrap();
    let out = place.path("file").join("run");
    let refused = mba(["slam".into(), place.path("data"), "--out".into(), out]);
    refused.assert_error(2, &["file/run"]);
    let refused = mba(["slam".into(), place.path("nowhere"), "--out".into(), place.path("run")]);
    refused.assert_error(2, &["nowhere"]);
}

#[test]
fn the_help_has_a_heading_for_what_can_be_left_out() {
    let help = mba(["slam", "--help"]).stdout;
    let (_, ablation) = help.split_once("Ablation").expect("a heading");
    for option in ["--blur", "--virtual-views", "--reference", "--depth-term", "--loop"] {
        assert!(ablation.contains(option), "{option} is not under the heading:\n{help}");
    }
}
