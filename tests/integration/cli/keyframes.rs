//! Deblurred keyframes, from the blurred sequence to the report.

use std::ffi::OsStr;
use std::fs;
use std::path::Path;

use image::ImageReader;
use mba_mapper::evaluation::psnr;
use mba_mapper::run::Run;
use tempfile::TempDir;

use super::{Outcome, mba};

/// A folder with a short blurred sequence in `data`.
fn blurred_sequence() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    // Small enough to be quick; with noise too the tracker would find too little in images of this size.
    let options =
        ["--frames", "6", "--size", "240x180", "--blur", "4", "--noise", "off", "--depth", "exact", "-q"];
    let options = options.map(OsStr::new);
    let data = folder.path().join("data");
    let arguments = ["synth", "--out"].map(OsStr::new).into_iter().chain([data.as_os_str()]).chain(options);
    assert_eq!(mba(arguments).code, Some(0));
    folder
}

fn track(folder: &Path, run: &str, options: &[&str]) -> Outcome {
    let [data, run] = ["data", run].map(|name| folder.join(name));
    let fixed = ["track".as_ref(), data.as_os_str(), "--out".as_ref(), run.as_os_str(), "--json".as_ref()];
    mba(fixed.into_iter().chain(options.iter().map(OsStr::new)))
}

fn names(folder: &Path) -> Vec<String> {
    let files = fs::read_dir(folder).unwrap().map(|file| file.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = files.collect();
    names.sort();
    names
}

fn bytes(path: &Path) -> Vec<u8> {
    ImageReader::open(path).unwrap().decode().unwrap().into_rgb8().into_raw()
}

#[test]
fn keyframes_are_deblurred_and_shown() {
    let place = blurred_sequence();
    let summary = track(place.path(), "run", &["--threads", "1"]).json();
    let run = Run::open(&place.path().join("run")).unwrap();
    let keyframes = (0..run.frames.len()).filter(|k| run.frames[*k].keyframe != 0);
    let expected: Vec<String> = keyframes.map(|k| format!("{k:06}.png")).collect();
    let images = run.folder.join("deblurred");
    assert_eq!(names(&images), expected);
    assert_eq!(summary["deblurred_keyframes"], expected.len());

    // Measured: 2.2 pixels of blur, 28.1 dB as captured, 29.4 dB deblurred.
    let image = |folder: &str| bytes(&place.path().join(folder).join("000000.png"));
    let truth = image("data/sharp");
    let [before, after] = ["data/rgb", "run/deblurred"].map(|folder| psnr(&truth, &image(folder)).unwrap());
    assert!(after > before + 0.8, "{before} dB, then {after} dB");

    assert_eq!(track(place.path(), "two", &["--threads", "2"]).code, Some(0));
    for name in &expected {
        let [one, two] =
            ["run", "two"].map(|run| fs::read(place.path().join(run).join("deblurred").join(name)));
        assert!(one.unwrap() == two.unwrap(), "{name} depends on the number of threads");
    }

    let report = || {
        let report = mba([Path::new("report"), &run.folder]);
        assert_eq!(report.code, Some(0), "{}", report.stderr);
        fs::read_to_string(run.folder.join("report.html")).unwrap()
    };
    let page = report();
    let shown = expected.len().min(6);
    assert!(page.contains("Keyframes, before and after"));
    assert_eq!((page.matches("<img").count(), page.matches(" dB, deblurred").count()), (6 * shown, shown));
    assert_eq!(page.matches("<p>deblurred, ").count(), shown, "each detail has its ratio beneath");
    fs::rename(place.path().join("data"), place.path().join("elsewhere")).unwrap();
    assert_eq!(report().matches("<img").count(), shown, "without the data set the deblurred images are left");
}

#[test]
fn without_keyframes_the_images_of_an_earlier_run_go() {
    let place = blurred_sequence();
    assert_eq!(track(place.path(), "run", &[]).code, Some(0));
    assert!(place.path().join("run/deblurred/000000.png").is_file());
    let summary = track(place.path(), "run", &["--keyframes", "off"]).json();
    assert_eq!(summary["deblurred_keyframes"], 0);
    assert!(!place.path().join("run/deblurred").exists());
}

#[test]
fn a_keyframe_that_cannot_be_read_is_left_out() {
    let place = blurred_sequence();
    // Without frame 0, frame 1 becomes the first keyframe.
    fs::write(place.path().join("data/rgb/000000.png"), "not an image").unwrap();
    let summary = track(place.path(), "run", &[]).json();
    assert_eq!(summary["frames"]["skipped"], 1);
    let first = names(&place.path().join("run/deblurred")).into_iter().next();
    assert_eq!(first.as_deref(), Some("000001.png"), "named by the frame of the data set");
}
