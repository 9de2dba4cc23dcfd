//! Each case of bad input: one clear message, the right exit code, nothing finished lost.

use std::fs;
use std::path::Path;

use mba_mapper::run::Run;
use mba_tests::small_dataset::{FRAMES, calibration};

use super::{Outcome, Workplace, mba};

fn info(place: &Workplace) -> Outcome {
    mba([Path::new("info"), &place.path("data")])
}

/// Evaluates the data set's own ground truth, in which frame 2 has been replaced by `line`.
fn evaluate_with_line(line: &str) -> Outcome {
    let place = Workplace::new();
    let file = place.path("data/groundtruth.txt");
    let text = fs::read_to_string(&file).unwrap();
    let lines: Vec<&str> = text.lines().enumerate().map(|(k, old)| if k == 2 { line } else { old }).collect();
    fs::write(&file, lines.join("\n")).unwrap();
    mba([
        "eval".as_ref(),
        "trajectory".as_ref(),
        "--reference".as_ref(),
        file.as_os_str(),
        "--estimate".as_ref(),
        file.as_os_str(),
    ])
}

/// Tracks after frame 3's colour image was spoilt; the run goes on and tells.
fn assert_frame_3_is_skipped(place: &Workplace, reason: &str) {
    let outcome = place.track();
    let summary = outcome.json();
    assert_eq!(summary["frames"]["total"], FRAMES);
    assert_eq!(
        (&summary["frames"]["skipped"], &summary["frames"]["lost"]),
        (&1.into(), &1.into()),
        "{summary}"
    );
    let warning =
        outcome.stderr.lines().find(|line| line.contains("1 frames were skipped")).unwrap_or_default();
    assert!(warning.contains("000003.png") && warning.contains(reason), "{}", outcome.stderr);
    let trajectory = fs::read_to_string(place.path("run/trajectory.txt")).unwrap();
    assert_eq!(trajectory.lines().filter(|line| !line.starts_with('#')).count(), FRAMES, "every frame once");
}

#[test]
fn a_missing_image_is_skipped() {
    let place = Workplace::new();
    fs::remove_file(place.path("data/rgb/000003.png")).unwrap();
    assert_frame_3_is_skipped(&place, "No such file");
}

#[test]
fn a_truncated_image_is_skipped() {
    let place = Workplace::new();
    let path = place.path("data/rgb/000003.png");
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    assert_frame_3_is_skipped(&place, "damaged or cut off");
}

#[test]
fn depth_that_is_all_zero_is_told_and_survived() {
    let place = Workplace::new();
    let zero = image::ImageBuffer::from_pixel(160, 120, image::Luma([0u16]));
    for frame in 0..FRAMES {
        zero.save(place.path(&format!("data/depth/{frame:06}.png"))).unwrap();
    }
    let told = info(&place);
    assert_eq!(told.code, Some(1), "{}", told.stderr);
    assert!(told.stdout.contains("8 of 8 sampled depth images hold no depth at all"), "{}", told.stdout);
    let outcome = place.track();
    outcome
        .assert_error(1, &["nothing could be tracked", "8 of 8 sampled depth images hold no depth at all"]);
    // What was tried is there to be looked at.
    let run = Run::open(&place.path("run")).unwrap();
    assert_eq!((run.summary.complete, run.frames.len()), (true, FRAMES));
}

#[test]
fn depth_with_exchanged_bytes_is_named() {
    let place = Workplace::new();
    for frame in 0..FRAMES {
        // A wall that is not quite parallel to the image: what is flat has no steps to judge by.
        let wall = |u: u32, v: u32| image::Luma([(2000 + 2 * u + v) as u16]);
        let swapped = |u, v| image::Luma(wall(u, v).0.map(u16::swap_bytes));
        let path = place.path(&format!("data/depth/{frame:06}.png"));
        image::ImageBuffer::from_fn(160, 120, swapped).save(path).unwrap();
    }
    let told = info(&place);
    assert_eq!(told.code, Some(1), "{}", told.stderr);
    assert!(told.stdout.contains("8 of 8 sampled depth images look byte-swapped"), "{}", told.stdout);
}

#[test]
fn a_size_that_differs_from_the_calibration_is_refused() {
    let place = Workplace::new();
    fs::write(place.path("data/calibration.toml"), calibration(320, 130.0)).unwrap();
    info(&place).assert_error(2, &["000000.png", "160 x 120", "320 x 120"]);
}

#[test]
fn absurd_intrinsics_are_refused() {
    let place = Workplace::new();
    fs::write(place.path("data/calibration.toml"), calibration(160, -5.0)).unwrap();
    info(&place).assert_error(2, &["calibration.toml, line 3", "fx = -5"]);
}

#[test]
fn a_missing_calibration_is_refused() {
    let place = Workplace::new();
    fs::remove_file(place.path("data/calibration.toml")).unwrap();
    info(&place).assert_error(2, &["no calibration.toml"]);
}

#[test]
fn bad_poses_are_refused() {
    evaluate_with_line("1.07 nan 0 0 0 0 0 1").assert_error(2, &["groundtruth.txt, line 3", "nan"]);
    evaluate_with_line("1.07 0 0 0 0 0 0 2").assert_error(2, &["groundtruth.txt, line 3", "length 2"]);
    evaluate_with_line("1.07 0 0 0 0 0 one 1").assert_error(2, &["groundtruth.txt, line 3", "one"]);
}

#[test]
fn times_out_of_order_or_doubled_are_refused() {
    evaluate_with_line("0.5 0 0 0 0 0 0 1").assert_error(2, &["groundtruth.txt, line 3", "0.5 comes after"]);
    evaluate_with_line("1.033333 0 0 0 0 0 0 1")
        .assert_error(2, &["groundtruth.txt, line 3", "occurs twice"]);
    let place = Workplace::new();
    place.edit("data/rgb.txt", "1.066667", "1.033333");
    info(&place).assert_error(2, &["rgb.txt, line 3", "1.033333 occurs twice"]);
}

#[test]
fn lists_of_different_clocks_are_refused() {
    let place = Workplace::new();
    let depth = fs::read_to_string(place.path("data/depth.txt")).unwrap();
    fs::write(place.path("data/depth.txt"), depth.replace("1.", "9.")).unwrap();
    info(&place).assert_error(2, &["rgb.txt", "depth.txt", "8 images"]);
    let [one, other] = [place.path("data/groundtruth.txt"), place.path("late.txt")];
    let late = fs::read_to_string(&one).unwrap().replace("\n1.", "\n5.");
    fs::write(&other, late.lines().skip(1).collect::<Vec<_>>().join("\n")).unwrap();
    let arguments = ["eval", "trajectory", "--reference"].map(AsRef::as_ref);
    mba(arguments.into_iter().chain([one.as_os_str(), "--estimate".as_ref(), other.as_os_str()]))
        .assert_error(2, &["only 0 of 7 estimated poses"]);
}

#[test]
fn folders_that_are_not_what_they_should_be_are_refused() {
    let place = Workplace::new();
    mba([Path::new("info"), &place.path("nowhere")]).assert_error(2, &["nowhere", "No such file"]);
    mba([Path::new("info"), place.folder.path()]).assert_error(2, &["holds no known data set"]);
    mba([Path::new("report"), &place.path("data")])
        .assert_error(2, &["data is not a run folder", "summary.json"]);
}

#[test]
fn an_output_that_cannot_be_created_is_refused_before_the_work() {
    let place = Workplace::new();
    fs::write(place.path("run"), "a file").unwrap();
    place.track().assert_error(2, &["cannot write", "run"]);
    let below_a_file = place.path("run/data");
    let options = ["synth", "--size", "64x48", "--blur", "1", "--out"].map(Path::new);
    mba(options.into_iter().chain([below_a_file.as_path()])).assert_error(2, &["cannot write", "run/data"]);
}

#[test]
fn settings_out_of_range_are_refused() {
    let place = Workplace::new();
    let synth = |option: &str, value: &str| {
        let out = place.path("out");
        mba(["synth".as_ref(), "--out".as_ref(), out.as_os_str(), option.as_ref(), value.as_ref()])
    };
    synth("--exposure", "2").assert_error(2, &["exposure 2", "frame interval"]);
    synth("--frames", "0").assert_error(2, &["frames 0"]);
    synth("--readout", "-0.05").assert_error(2, &["readout -0.05", "the frame interval"]);
    synth("--vignetting", "-1.5,0.4").assert_error(2, &["least light of the fall-off -0.1"]);
    synth("--black", "10-90").assert_error(2, &["black frame 90", "frames of the sequence"]);
    synth("--response", "none.csv").assert_error(2, &["cannot read none.csv"]);
    for (option, value) in [
        ("--size", "640"),
        ("--blur", "-1"),
        ("--scene", "moon"),
        ("--response", "cubic"),
        ("--vignetting", "-0.3"),
        ("--saturated", "5-3"),
        ("--jump", "-1"),
    ] {
        let outcome = synth(option, value);
        assert_eq!(outcome.code, Some(2));
        assert!(outcome.stderr.contains(value), "{}", outcome.stderr);
    }
    assert!(!place.path("out").exists(), "nothing is written before the settings are known to be good");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_fails_and_keeps_the_finished_run() {
    let place = Workplace::new();
    assert_eq!(place.track().code, Some(0));
    let before = fs::read(place.path("run/trajectory.txt")).unwrap();
    // Everything written to /dev/full fails for lack of space.
    std::os::unix::fs::symlink("/dev/full", place.path("run/summary.json.partial")).unwrap();
    place.track().assert_error(1, &["cannot write", "summary.json", "the disk is full"]);
    assert!(fs::read(place.path("run/trajectory.txt")).unwrap() == before, "the finished run was touched");
}
