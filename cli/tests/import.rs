//! `mba import` as people call it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

fn recording(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../mapper/import/tests/data").join(name)
}

fn mba(arguments: &[&Path]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_mba")).args(arguments).output().unwrap()
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_bag_becomes_a_data_set_with_one_command() {
    let folder = tempfile::tempdir().unwrap();
    let (source, out) = (recording("lz4.bag"), folder.path().join("data"));
    let import = [Path::new("import"), &source, Path::new("--out"), &out, Path::new("--json")];
    let output = mba(&import);
    assert!(output.status.success(), "{}", errors(&output));
    let written: Value = serde_json::from_slice(&output.stdout).unwrap();
    for (key, expected) in [("frames", 3), ("exposures", 3), ("gyroscope_samples", 6), ("poses", 0)] {
        assert_eq!(written[key], expected, "{key}");
    }
    assert_eq!(written["kind"], "ROS 1, RealSense Viewer");
    let info = mba(&[Path::new("info"), &out, Path::new("--json")]);
    let facts: Value = serde_json::from_slice(&info.stdout).unwrap();
    assert_eq!((&facts["frames"], &facts["exposure_source"]), (&3.into(), &"per frame".into()));
    // Once more: nothing that exists is overwritten.
    let refused = mba(&import);
    assert_eq!(refused.status.code(), Some(2));
    assert!(errors(&refused).contains("recordings stay as they are"), "{}", errors(&refused));
}

#[test]
fn what_could_be_brought_in_is_told_and_what_could_not_is_one_sentence() {
    let source = recording("folders/polycam");
    let output = mba(&[Path::new("info"), &source]);
    let expected =
        format!("`mba import {} --out data` makes a data set of it (Polycam raw data)", source.display());
    assert_eq!(output.status.code(), Some(2));
    assert!(errors(&output).contains(&expected), "{}", errors(&output));

    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("data");
    let output = mba(&[Path::new("import"), folder.path(), Path::new("--out"), &out]);
    assert_eq!(output.status.code(), Some(2));
    let message = errors(&output);
    assert!(message.contains("is no recording that is known; looked for an .mcap file"), "{message}");
    assert!(message.contains("docs/import.md"), "{message}");
    let output = mba(&[Path::new("import"), &recording("folders/stray_video"), Path::new("--out"), &out]);
    assert!(errors(&output).contains("ffmpeg -i "), "{}", errors(&output));
    assert!(!out.exists());
}
