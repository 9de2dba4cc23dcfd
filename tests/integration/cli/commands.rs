//! What works.

use std::ffi::OsStr;
use std::fs;
use std::path::Path;

use mba_tests::small_dataset::{FRAMES, HEIGHT, WIDTH};

use super::{Workplace, mba};

#[test]
fn every_command_has_help_with_an_example() {
    let help = mba(["--help"]);
    let commands: Vec<&str> = help
        .stdout
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| !line.is_empty())
        .filter_map(|line| line.strip_prefix("  ").filter(|line| !line.starts_with(' '))?.split(' ').next())
        .filter(|name| !["help", "eval"].contains(name))
        .collect();
    assert!(commands.len() >= 3, "{}", help.stdout);
    for command in commands {
        assert_has_example(&mba([command, "--help"]).stdout, &format!("  mba {command}"));
    }
    assert_has_example(&mba(["eval", "trajectory", "--help"]).stdout, "  mba eval trajectory");
    assert_has_example(&mba(["eval", "images", "--help"]).stdout, "  mba eval images");
}

fn assert_has_example(help: &str, call: &str) {
    let example = help.split_once("Example").map_or("", |(_, examples)| examples);
    assert!(example.contains(call), "no example in:\n{help}");
    assert!(help.contains("--json") && help.contains("--threads"), "{help}");
}

#[test]
fn wrong_use_has_code_2_and_version_has_0() {
    assert_eq!(mba(["dance"]).code, Some(2));
    assert_eq!(mba(["track", "somewhere"]).code, Some(2));
    assert_eq!(mba(["info", "x", "--threads", "0"]).code, Some(2));
    assert_eq!(mba(["info", "x", "-q", "-v"]).code, Some(2));
    assert_eq!(mba(["track", "x", "--out", "y", "--virtual-views", "0"]).code, Some(2));
    let version = mba(["--version"]);
    assert_eq!((version.code, version.stdout.starts_with("mba ")), (Some(0), true));
}

#[test]
fn info_counts_what_is_there() {
    let place = Workplace::new();
    let info = mba([Path::new("info"), &place.path("data"), Path::new("--json")]).json();
    assert_eq!(info["frames"], FRAMES);
    assert_eq!((&info["width"], &info["height"]), (&160.into(), &120.into()));
    assert_eq!(info["missing_depth_share"], 0.0);
    assert_eq!(info["median_depth_m"], 2.0);
    assert_eq!(info["exposure_source"], "calibration");
    assert_eq!(info["ground_truth_share_of_frames"], 1.0);
    assert!((info["measured_rate_hz"].as_f64().unwrap() - 30.0).abs() < 1e-3);
    assert_eq!(info["warnings"].as_array().map(Vec::len), Some(0), "{info}");
}

#[test]
fn a_tracked_run_can_be_evaluated_and_reported() {
    let place = Workplace::new();
    let summary = place.track().json();
    assert_eq!(summary["frames"]["total"], FRAMES);
    assert_eq!(summary["frames"]["lost"], 0, "{summary}");
    assert_eq!(summary["complete"], true);

    let run = place.path("run");
    let [truth, estimate] = [place.path("data/groundtruth.txt"), run.join("trajectory.txt")];
    let figures = mba([
        "eval".as_ref(),
        "trajectory".as_ref(),
        "--json".as_ref(),
        "--reference".as_ref(),
        truth.as_os_str(),
        "--estimate".as_ref(),
        estimate.as_os_str(),
    ])
    .json();
    assert_eq!(figures["matches"], FRAMES);
    let rmse = figures["ate_m"]["rmse"].as_f64().unwrap();
    // The file has nine decimals.
    assert!((rmse - summary["trajectory"]["ate_m"]["rmse"].as_f64().unwrap()).abs() < 1e-8, "{figures}");
    // A fiftieth of a pixel on the wall; the camera moves by 84 mm.
    assert!(rmse < 0.0003, "{figures}");

    let report = mba([Path::new("report"), &run]);
    assert_eq!(report.code, Some(0), "{}", report.stderr);
    let page = fs::read_to_string(run.join("report.html")).unwrap();
    assert_eq!(page.matches("<svg").count(), 5);
    for outside in ["<script src", "<link", "url(", "@import"] {
        assert!(!page.contains(outside), "the report asks for another file: {outside}");
    }
    let inside = page.matches("<img src=\"data:image/jpeg;base64,").count();
    assert_eq!(page.matches("<img").count(), inside, "the report asks for another picture");
    assert!(run.join("plots/trajectory_top.svg").is_file());
    let picture = image::open(run.join("pictures/keyframe_1.png")).unwrap();
    // Captured and deblurred; a recording has no truth.
    assert_eq!((picture.width(), picture.height()), (2 * WIDTH + 6, HEIGHT));
    assert!(run.join("pictures/detail_1.png").is_file() && !run.join("pictures/map.png").exists());
    fs::write(run.join("pictures/keyframe_1.png"), "a letter").unwrap();
    mba([Path::new("report"), &run]).assert_error(2, &["keyframe_1.png"]);
    assert_eq!(fs::read(run.join("pictures/keyframe_1.png")).unwrap(), b"a letter");
}

#[test]
fn synth_writes_a_data_set_that_info_understands() {
    let place = Workplace::new();
    let synth = |name: &str, threads: &str| {
        let out = place.path(name);
        let options = [
            "--frames",
            "2",
            "--size",
            "64x48",
            "--blur",
            "1",
            "--scene",
            "wall",
            "--json",
            "--threads",
            threads,
        ];
        let fixed = ["synth", "--out"].map(OsStr::new).into_iter().chain([out.as_os_str()]);
        mba(fixed.chain(options.map(OsStr::new)))
    };
    let written = synth("one", "1").json();
    assert_eq!(written["frames"], 2);
    let info = mba([Path::new("info"), &place.path("one"), Path::new("--json")]).json();
    assert_eq!((&info["frames"], &info["width"], &info["response"]), (&2.into(), &64.into(), &"srgb".into()));
    assert_eq!(info["ground_truth_exposures"], 2);
    assert_eq!(synth("two", "2").code, Some(0));
    for file in ["rgb/000001.png", "depth/000001.png", "groundtruth_exposure.txt"] {
        let [one, two] = ["one", "two"].map(|folder| fs::read(place.path(folder).join(file)).unwrap());
        assert!(one == two, "{file} depends on the number of threads");
    }
    synth("one", "1").assert_error(2, &["one is not empty"]);
}

#[test]
fn one_thread_and_two_give_the_same_poses() {
    let place = Workplace::new();
    for (threads, run) in [("1", "one"), ("2", "two")] {
        let outcome = mba([
            "track".as_ref(),
            place.path("data").as_os_str(),
            "--out".as_ref(),
            place.path(run).as_os_str(),
            "--threads".as_ref(),
            threads.as_ref(),
            "-q".as_ref(),
        ]);
        assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), ""));
    }
    for file in ["trajectory.txt", "exposures.txt"] {
        let [one, two] = ["one", "two"].map(|run| fs::read(place.path(run).join(file)).unwrap());
        assert!(one == two, "{file} differs");
    }
}

#[test]
fn known_trajectories_have_known_errors() {
    // A unit square whose corners are alternately 3 cm too high and too low, in another world frame, late by 4 ms.
    let place = Workplace::new();
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let mut files = ["# reference\n".to_owned(), "# estimate\n".to_owned()];
    for (k, [x, y]) in corners.into_iter().enumerate() {
        let h = if k % 2 == 0 { 0.03 } else { -0.03 };
        files[0] += &format!("{k} {x} {y} 0 0 0 0 1\n");
        // Turned by 90 degrees about z and moved by (5, 6, 7).
        let s = 0.5f64.sqrt();
        files[1] += &format!("{} {} {} {} 0 0 {s} {s}\n", k as f64 + 0.004, 5.0 - y, 6.0 + x, 7.0 + h);
    }
    let paths = [place.path("reference.txt"), place.path("estimate.txt")];
    fs::write(&paths[0], &files[0]).unwrap();
    fs::write(&paths[1], &files[1]).unwrap();
    let evaluate = |align: &str| {
        let fixed = ["eval", "trajectory", "--json", "--align", align, "--reference"].map(AsRef::as_ref);
        mba(fixed.into_iter().chain([paths[0].as_os_str(), "--estimate".as_ref(), paths[1].as_os_str()]))
            .json()
    };
    let aligned = evaluate("se3");
    assert!((aligned["ate_m"]["rmse"].as_f64().unwrap() - 0.03).abs() < 1e-6, "{aligned}");
    assert!((aligned["rpe_translation_m"]["median"].as_f64().unwrap() - 0.06).abs() < 1e-6, "{aligned}");
    assert!(aligned["rpe_rotation_deg"]["max"].as_f64().unwrap() < 1e-5, "{aligned}");
    assert_eq!(aligned["share_within_2cm"], 0.0);
    assert_eq!(aligned["matches"], 4);
    // As they are, the second corners differ by (4, 7, 6.97) and the last ones by (4, 5, 6.97).
    let raw = evaluate("none");
    let [nearest, farthest] =
        [(25.0 + 16.0 + 6.97f64.powi(2)).sqrt(), (49.0 + 16.0 + 6.97f64.powi(2)).sqrt()];
    assert!((raw["ate_m"]["min"].as_f64().unwrap() - nearest).abs() < 1e-9, "{raw}");
    assert!((raw["ate_m"]["max"].as_f64().unwrap() - farthest).abs() < 1e-9, "{raw}");
}
