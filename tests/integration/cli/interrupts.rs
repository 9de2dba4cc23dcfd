//! Ctrl-C and requests to end: what is there is saved, and the command that goes on is told.

use std::ffi::{OsStr, OsString};
use std::fmt::Write as _;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use mba_mapper::run::Run;
use mba_tests::blurred_sequence::{BlurredSequence, assert_same_map, assert_same_track};
use mba_tests::small_dataset::FRAMES;

use super::{Workplace, mba};

/// Times that the small data set is seen in the long one.
const ROUNDS: usize = 300;

fn start(arguments: &[OsString]) -> Child {
    let mut program = Command::new(env!("CARGO_BIN_EXE_mba-under-test"));
    program.args(arguments).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

fn signal(process: &Child, name: &str) {
    let sent = Command::new("kill").args([name, &process.id().to_string()]).status().unwrap();
    assert!(sent.success());
}

/// Waits until `is_ready`, which has to happen before the process ends.
fn wait_until(process: &mut Child, is_ready: impl Fn() -> bool) {
    let started = Instant::now();
    while !is_ready() {
        assert!(started.elapsed() < Duration::from_secs(60), "it never comes so far");
        assert!(process.try_wait().unwrap().is_none(), "it ended before it could be interrupted");
        sleep(Duration::from_millis(2));
    }
}

/// Exit code and what was said.
fn end(process: Child) -> (Option<i32>, String) {
    let output = process.wait_with_output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn a_map_that_was_interrupted_goes_on_elsewhere_and_ends_the_same() {
    let sequence = BlurredSequence::tiny();
    let _ = sequence.run_of("run", sequence.truth());
    let path = |name: &str| sequence.path(name).into_os_string();
    let arguments = |data: &str, out: &str, options: &[&str]| -> Vec<OsString> {
        let fixed = ["map".into(), path(data), "--trajectory".into(), path("run"), "--out".into(), path(out)];
        fixed.into_iter().chain(options.iter().map(OsString::from)).collect()
    };
    let whole = mba(arguments("data", "whole", &[]));
    assert_eq!(whole.code, Some(0), "{}", whole.stderr);
    let checkpoint = sequence.path("parts/checkpoint");
    for (name, code, options) in [("-INT", 130, &[][..]), ("-TERM", 143, &["--resume"])] {
        let mut process = start(&arguments("data", "parts", options));
        // With the default interval of 20 s: the first checkpoint does not wait for it.
        wait_until(&mut process, || checkpoint.is_file() && sequence.path("parts/.mba-lock").exists());
        signal(&process, name);
        let (ended, said) = end(process);
        assert_eq!(ended, Some(code), "{said}");
        let hint = said.lines().last().unwrap_or_default();
        let expected = format!("hint: `mba map {} --trajectory", sequence.path("data").display());
        assert!(hint.starts_with(&expected) && hint.ends_with(" --resume` goes on"), "{said}");
        assert_eq!(said.matches("--resume").count(), 1, "{said}");
        assert!(checkpoint.is_file() && !Run::open(&sequence.path("parts")).unwrap().summary.complete);
    }
    fs::rename(sequence.path("data"), sequence.path("moved")).unwrap();
    let resumed = mba(arguments("moved", "parts", &["--resume"]));
    assert_eq!(resumed.code, Some(0), "{}", resumed.stderr);
    assert_same_map(&sequence.path("whole"), &sequence.path("parts"));
}

/// The small data set, seen to and fro many times.
fn long_data_set() -> Workplace {
    let place = Workplace::new();
    for images in ["rgb", "depth"] {
        let mut list = String::new();
        let to_and_fro = (0..FRAMES).chain((1..FRAMES - 1).rev());
        for (k, frame) in to_and_fro.cycle().take(ROUNDS * FRAMES).enumerate() {
            writeln!(list, "{:.6} {images}/{frame:06}.png", 1.0 + k as f64 / 30.0).unwrap();
        }
        fs::write(place.path("data").join(images).with_extension("txt"), list).unwrap();
    }
    place
}

#[test]
fn track_and_slam_keep_the_frames_so_far() {
    for (command, name, code) in [("track", "-INT", 130), ("slam", "-TERM", 143)] {
        let place = long_data_set();
        let [data, run] = [place.path("data"), place.path("run")];
        let fixed = [command.into(), data.into_os_string(), "--out".into(), run.clone().into_os_string()];
        let mut process = start(&fixed);
        let frames = || fs::read_to_string(run.join("frames.csv")).map_or(0, |text| text.lines().count());
        wait_until(&mut process, || frames() > 40);
        signal(&process, name);
        let (ended, said) = end(process);
        assert_eq!(ended, Some(code), "{command}: {said}");
        assert!(said.contains("marked as incomplete") && said.contains(" --resume` goes on"), "{said}");
        let stopped = Run::open(&run).unwrap();
        assert!(!stopped.summary.complete && stopped.exposures.len() >= 40);
        assert!(stopped.exposures.len() < ROUNDS * FRAMES, "{command} had ended");
        assert_eq!(stopped.exposures.len(), stopped.frames.len());
        assert!(!run.join(".mba-lock").exists());
    }
}

#[test]
fn a_track_that_was_interrupted_goes_on_and_ends_the_same() {
    let place = long_data_set();
    let [data, whole, parts] = ["data", "whole", "parts"].map(|name| place.path(name));
    let arguments = |out: &Path| -> Vec<OsString> {
        vec!["track".into(), data.clone().into(), "--resume".into(), "--out".into(), out.into()]
    };
    let ended = mba(arguments(&whole));
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let frames = || fs::read_to_string(parts.join("frames.csv")).map_or(0, |text| text.lines().count());
    let mut before = 0;
    for name in ["-TERM", "-INT"] {
        let mut process = start(&arguments(&parts));
        wait_until(&mut process, || frames() > before + 100);
        signal(&process, name);
        let (_, said) = end(process);
        assert!(said.contains(" --resume --out ") && said.contains("` goes on"), "{said}");
        assert!(frames() > before, "it began anew after {before} frames");
        before = frames();
        assert!(before < ROUNDS * FRAMES, "it had ended");
    }
    let ended = mba(arguments(&parts));
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert_same_track(&whole, &parts);
    assert!(!parts.join("checkpoint").exists());
}

#[test]
fn folders_whose_names_are_in_another_encoding_are_found_again() {
    let place = long_data_set();
    let [data, run] = [b"fr\xfch", b"run\xe9"].map(|name| place.path("").join(OsStr::from_bytes(name)));
    fs::rename(place.path("data"), &data).unwrap();
    let fixed = ["track".into(), data.into_os_string(), "--out".into(), run.clone().into_os_string()];
    let mut process = start(&fixed);
    wait_until(&mut process, || run.join("checkpoint").is_file());
    signal(&process, "-INT");
    let (_, said) = end(process);
    // As a shell reads it back.
    let command = said.split('`').nth(1).unwrap().strip_prefix("mba ").unwrap();
    assert!(command.contains("fr\\xfch' --out $'") && command.ends_with(" --resume"), "{said}");
    let ended = mba(fixed.iter().cloned().chain(["--resume".into()]));
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let report = mba([OsStr::new("report"), run.as_os_str()]);
    assert!(report.code == Some(0) && !report.stderr.contains("warning"), "{}", report.stderr);
}

#[test]
fn a_checkpoint_of_other_options_is_refused_and_stays() {
    let place = long_data_set();
    let [data, run] = [place.path("data"), place.path("run")].map(PathBuf::into_os_string);
    let fixed = ["track".into(), data, "--out".into(), run];
    let mut process = start(&fixed);
    let checkpoint = place.path("run/checkpoint");
    wait_until(&mut process, || checkpoint.is_file());
    signal(&process, "-INT");
    assert_eq!(end(process).0, Some(130));
    let other = mba(fixed.iter().cloned().chain(["--resume", "--blur", "off"].map(OsString::from)));
    other.assert_error(2, &["checkpoint", "of a run with other settings"]);
    fs::write(&checkpoint, "cut").unwrap();
    mba(fixed.iter().cloned().chain(["--resume".into()])).assert_error(2, &["is not a checkpoint"]);
    assert_eq!(fs::read(&checkpoint).unwrap(), b"cut");
}

#[test]
fn the_search_for_the_camera_ends_at_once_and_leaves_nothing() {
    let place = long_data_set();
    place.edit("data/calibration.toml", "exposure_seconds = 0.001\n", "");
    for (command, name, code) in [("track", "-INT", 130), ("slam", "-TERM", 143)] {
        let [data, run] = [place.path("data"), place.path("run")].map(PathBuf::into_os_string);
        let mut process = start(&[command.into(), data, "--out".into(), run.clone()]);
        let mut said = BufReader::new(process.stderr.take().unwrap());
        let mut line = String::new();
        while !line.contains("looking for what is not on record") {
            line.clear();
            assert_ne!(said.read_line(&mut line).unwrap(), 0, "{command} never looks for anything");
        }
        signal(&process, name);
        let mut rest = String::new();
        said.read_to_string(&mut rest).unwrap();
        assert_eq!(process.wait().unwrap().code(), Some(code), "{rest}");
        let expected =
            format!("error: stopped before there was anything to go on from\nhint: `mba {command} ");
        assert!(rest.starts_with(&expected) && rest.ends_with("` starts again\n"), "{rest}");
        assert!(!Path::new(&run).exists());
    }
}

#[test]
fn a_second_signal_stops_at_once() {
    let place = long_data_set();
    let [data, run] = [place.path("data"), place.path("run")];
    let fixed = ["track".into(), data.into_os_string(), "--out".into(), run.clone().into_os_string()];
    let mut process = start(&fixed);
    wait_until(&mut process, || run.join("summary.json").is_file());
    signal(&process, "-INT");
    signal(&process, "-TERM");
    let (ended, said) = end(process);
    assert!(matches!(ended, Some(130 | 143)), "{ended:?}: {said}");
    // Whatever the moment, the folder can be read and written again.
    assert!(Run::open(&run).is_ok());
    let again = mba([Path::new("track"), &place.path("data"), Path::new("--out"), &run, Path::new("-q")]);
    assert_eq!(again.code, Some(0), "{}", again.stderr);
}
