//! `mba slam` and `mba ablate`.

use std::fs;

use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use mba_mapper::run::Run;
use mba_tests::blurred_sequence::{assert_same_map, names};
use mba_tests::small_dataset::{FRAMES, HEIGHT, WIDTH};

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

/// The small data set to and fro, with some frames in which nothing is seen.
fn interrupted_view() -> Workplace {
    let place = Workplace::new();
    let data = place.path("data");
    image::RgbImage::new(WIDTH, HEIGHT).save(data.join("rgb/black.png")).unwrap();
    image::ImageBuffer::from_pixel(WIDTH, HEIGHT, image::Luma([0_u16]))
        .save(data.join("depth/black.png"))
        .unwrap();
    let to_and_fro = (0..FRAMES).chain((1..FRAMES - 1).rev()).cycle().take(3 * FRAMES);
    for images in ["rgb", "depth"] {
        let mut list = String::new();
        for (k, frame) in to_and_fro.clone().enumerate() {
            let name = if (10..14).contains(&k) { "black".to_owned() } else { format!("{frame:06}") };
            list += &format!("{:.6} {images}/{name}.png\n", 1.0 + k as f64 / 30.0);
        }
        fs::write(data.join(images).with_extension("txt"), list).unwrap();
    }
    place
}

fn arguments(folder: &Path, out: &str, options: &[&str]) -> Vec<std::ffi::OsString> {
    let fixed = ["slam".into(), folder.join("data").into(), "--out".into(), folder.join(out).into()];
    fixed.into_iter().chain(options.iter().map(|option| option.into())).collect()
}

/// Kills a run again and again, each time after a little longer, until it comes to its end; returns how often.
fn kill_until_done(folder: &Path, out: &str, field: &[&str], first_pause: Duration) -> usize {
    const OFTEN: [&str; 3] = ["--resume", "--checkpoint-interval", "0"];
    let mut pause = first_pause;
    for kills in 0..60 {
        let mut program = Command::new(env!("CARGO_BIN_EXE_mba-under-test"));
        let program = program.args(arguments(folder, out, &[field, &OFTEN].concat()));
        let mut process = program.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let started = Instant::now();
        while started.elapsed() < pause {
            if process.try_wait().unwrap().is_some() {
                let output = process.wait_with_output().unwrap();
                assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
                return kills;
            }
            sleep(Duration::from_millis(5));
        }
        process.kill().unwrap();
        process.wait().unwrap();
        pause = pause.mul_f64(1.15);
    }
    panic!("it makes no progress")
}

#[test]
fn a_killed_run_ends_like_one_that_was_not() {
    let place = interrupted_view();
    let folder = place.path("");
    for field in [&[][..], &["--field", "triplane"]] {
        let _ = [fs::remove_dir_all(place.path("whole")), fs::remove_dir_all(place.path("parts"))];
        let started = Instant::now();
        let _ = mba(arguments(&folder, "whole", &[field, &["--json"]].concat())).json();
        let seconds = started.elapsed();
        let kills = kill_until_done(&folder, "parts", field, seconds.mul_f64(0.1));
        assert!(kills > 2, "killed {kills} times only");
        assert_same_map(&place.path("whole"), &place.path("parts"));
        assert_eq!(names(&place.path("whole")), names(&place.path("parts")), "no checkpoint is left");
        let [one, two] = ["whole", "parts"].map(|run| Run::open(&place.path(run)).unwrap());
        let statuses =
            |run: &Run| run.frames.iter().map(|frame| (frame.status, frame.keyframe)).collect::<Vec<_>>();
        assert_eq!(statuses(&one), statuses(&two));
        assert_eq!(one.summary.warnings, two.summary.warnings);
        let counts = |run: &Run| {
            run.summary.slam.map(|slam| (slam.loops, slam.relocalisations, slam.retired_keyframes))
        };
        assert_eq!(counts(&one), counts(&two));
    }
}

#[test]
fn a_checkpoint_of_another_run_is_refused() {
    let place = Workplace::new();
    let folder = place.path("");
    let checkpoint = place.path("run/checkpoint");
    let mut program = Command::new(env!("CARGO_BIN_EXE_mba-under-test"));
    let program = program.args(arguments(&folder, "run", &["--checkpoint-interval", "0"]));
    let mut process = program.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    while !checkpoint.is_file() {
        assert!(process.try_wait().unwrap().is_none(), "it ended before there was a checkpoint");
        sleep(Duration::from_millis(2));
    }
    process.kill().unwrap();
    process.wait().unwrap();
    mba(arguments(&folder, "run", &["--resume", "--seed", "2"])).assert_error(2, &["checkpoint", "settings"]);
    assert_eq!(mba(arguments(&folder, "run", &["--resume", "--realtime"])).code, Some(2));
    let map = ["map".into(), place.path("data"), "--trajectory".into(), place.path("run"), "--out".into()];
    let map = mba(map.into_iter().chain([place.path("mapped")]));
    assert_eq!(map.code, Some(2), "a run of a few frames is none of the data set: {}", map.stderr);
    assert_eq!(mba(arguments(&folder, "run", &["--resume"])).code, Some(0));
}
