//! README and manual: what they tell people to type is understood and works, and what they point to is there.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use clap::Parser;
use clap::error::ErrorKind;
use mba_cli::args::Cli;

/// How the program is called in texts.
const CALLS: [&str; 2] = ["mba ", "cargo run --release -- "];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Paths from the root of the texts for people, and what they say.
fn texts() -> Vec<(PathBuf, String)> {
    let fixed = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "mapper/README.md", "tracker/README.md"];
    let manual = fs::read_dir(root().join("docs")).unwrap().map(|entry| entry.unwrap().path());
    let mut paths: Vec<PathBuf> = fixed.map(|path| root().join(path)).to_vec();
    paths.extend(manual.filter(|path| path.extension().is_some_and(|extension| extension == "md")));
    paths.sort();
    paths.into_iter().map(|path| (path.clone(), fs::read_to_string(path).unwrap())).collect()
}

/// The calls of the program in the indented and fenced blocks of a text, each as its arguments.
fn calls(text: &str) -> Vec<Vec<String>> {
    let mut is_fenced = false;
    let mut calls = Vec::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            is_fenced = !is_fenced;
        }
        let code = line.split(" #").next().unwrap_or_default();
        let call = CALLS.iter().find_map(|start| code.trim().strip_prefix(start));
        if let (Some(call), true) = (call, is_fenced || line.starts_with("    ")) {
            calls.push(call.split_whitespace().map(str::to_owned).collect());
        }
    }
    calls
}

#[test]
fn every_call_is_understood() {
    let mut count = 0;
    for (path, text) in texts() {
        for call in calls(&text) {
            let parsed = Cli::try_parse_from(std::iter::once("mba").chain(call.iter().map(String::as_str)));
            if let Err(error) = parsed {
                let is_help = matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion);
                assert!(is_help, "{}: mba {}\n{error}", path.display(), call.join(" "));
            }
            count += 1;
        }
    }
    assert!(count > 20, "only {count} calls were found");
}

#[test]
fn every_link_has_a_target() {
    for (path, text) in texts() {
        let links = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
        for link in links.filter(|link| !link.contains("://") && !link.starts_with('#')) {
            let target = path.with_file_name(link.split('#').next().unwrap_or_default());
            assert!(target.exists(), "{}: {link}", path.display());
        }
    }
}

/// From poses to views and meshes, in the order of the text, on a data set that takes no time.
#[test]
fn the_calls_on_the_own_data_set_work() {
    let folder = tempfile::tempdir().unwrap();
    let mba = |call: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mba"));
        let output = command.current_dir(folder.path()).args(call).arg("--quiet").output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "mba {}\n{errors}", call.join(" "));
    };
    // The second is filmed by another hand.
    for (data, hand) in [("data", "1"), ("second", "2")] {
        mba(&["synth", "--out", data, "--frames", "8", "--size", "96x72", "--blur", "2", "--seed", hand]);
    }
    let program = fs::read_to_string(root().join("docs/program.md")).unwrap();
    // What films another sequence, or takes as long as a whole run.
    let left_out = ["demo", "synth", "slam", "ablate"];
    let mut count = 0;
    for call in calls(&program) {
        let mut call: Vec<&str> = call.iter().map(String::as_str).collect();
        // No test opens a browser.
        call.extend((call[0] == "view").then_some("--no-open"));
        let is_own = !call.iter().any(|argument| argument.contains("freiburg"));
        if is_own && !left_out.contains(&call[0]) {
            mba(&call);
            count += 1;
        }
    }
    assert!(count >= 8, "only {count} calls were found");
}
