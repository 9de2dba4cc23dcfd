//! Processes that are killed, and disks that are full: no file is ever cut, and the same command again does its work.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Instant;

use mba_tests::tree::{Item, tree};

use super::kill_campaign::kills;
use super::{Workplace, mba};

/// Kills per command, spread over the time that it takes, unless the environment asks for more.
const KILLS: u32 = 12;

/// A command that writes `out`.
struct Writer {
    words: Vec<&'static str>,
    /// Files that tell times and so differ from run to run.
    timed: &'static [&'static str],
}

fn writers() -> [Writer; 4] {
    const SYNTH: [&str; 8] = ["synth", "--frames", "6", "--size", "160x120", "--blur", "2", "--out"];
    [
        Writer { words: SYNTH.to_vec(), timed: &[] },
        Writer { words: vec!["track", "data", "--out"], timed: &["frames.csv", "summary.json"] },
        Writer { words: vec!["render", "mapped", "--poses", "run/trajectory.txt", "--out"], timed: &[] },
        Writer { words: vec!["mesh", "mapped", "--voxel-cm", "1", "--out"], timed: &[] },
    ]
}

fn program(folder: &Path, words: &[&str], out: &str) -> Command {
    let mut program = Command::new(env!("CARGO_BIN_EXE_mba-under-test"));
    program.args(words).arg(out).current_dir(folder).stdout(Stdio::null()).stderr(Stdio::piped());
    program
}

/// The data set, a run, and a map.
fn workplace() -> Workplace {
    let place = Workplace::new();
    assert_eq!(place.track().code, Some(0));
    let [data, run, mapped] = ["data", "run", "mapped"].map(|name| place.path(name));
    let words = ["map".into(), data, "--trajectory".into(), run, "--out".into(), mapped];
    let map = mba(words.into_iter().chain(["--time-budget".into(), PathBuf::from("0.5")]));
    assert_eq!(map.code, Some(0), "{}", map.stderr);
    place
}

/// The whole files at `out`, which is a folder or a file; what was being written is left out.
fn files(out: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    if out.is_file() {
        return vec![(PathBuf::new(), fs::read(out).unwrap())];
    }
    let items = if out.is_dir() { tree(out) } else { Default::default() };
    let is_whole = |path: &Path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        !name.ends_with(".partial") && !name.starts_with(".mba-")
    };
    let file = |(path, item): (PathBuf, Item)| match item {
        Item::File(content) if is_whole(&path) => Some((path, content)),
        _ => None,
    };
    items.into_iter().filter_map(file).collect()
}

#[test]
fn what_a_kill_leaves_is_whole_and_the_next_start_does_the_work() {
    let place = workplace();
    let folder = place.path("");
    for Writer { words, timed } in writers() {
        let [whole, out] = ["whole.ply", "out.ply"].map(|name| folder.join(name));
        let started = Instant::now();
        let made = program(&folder, &words, "whole.ply").output().unwrap();
        assert!(made.status.success(), "{words:?}: {}", String::from_utf8_lossy(&made.stderr));
        let seconds = started.elapsed();
        let expected = files(&whole);
        let is_timed = |path: &Path| timed.iter().any(|name| path == Path::new(name));
        let kills = kills(KILLS);
        for k in 0..kills {
            let mut process = program(&folder, &words, "out.ply").spawn().unwrap();
            sleep(seconds.mul_f64(f64::from(k) / f64::from(kills)));
            process.kill().unwrap();
            process.wait().unwrap();
            // A data set is complete, and not written again, as soon as it has its calibration.
            if words[0] == "synth" && out.join("calibration.toml").is_file() {
                fs::remove_dir_all(&out).unwrap();
            }
            for (path, content) in files(&out) {
                let known = expected.iter().find(|(known, _)| *known == path);
                let known = known.unwrap_or_else(|| panic!("{words:?}: {} is new", path.display()));
                // The texts of a run grow with it; images and meshes are there or not.
                let grows = words[0] == "track" && !path.starts_with("deblurred");
                assert!(grows || known.1 == content, "{words:?}: {} is cut", path.display());
            }
        }
        let again = program(&folder, &words, "out.ply").output().unwrap();
        assert!(again.status.success(), "{words:?}: {}", String::from_utf8_lossy(&again.stderr));
        let found = files(&out);
        let names =
            |files: &[(PathBuf, Vec<u8>)]| files.iter().map(|(path, _)| path.clone()).collect::<Vec<_>>();
        assert_eq!(names(&found), names(&expected), "{words:?}");
        for ((path, one), (_, two)) in expected.iter().zip(&found) {
            assert!(is_timed(path) || one == two, "{words:?}: {} differs", path.display());
        }
        for path in [whole, out] {
            if path.is_dir() { fs::remove_dir_all(path).unwrap() } else { fs::remove_file(path).unwrap() }
        }
    }
}

#[test]
fn what_does_not_fit_leaves_no_file_behind() {
    let place = workplace();
    let folder = place.path("");
    for Writer { words, .. } in writers() {
        // Files of more than 4 KiB fail to be written, as on a full disk; the signal for that would end the process.
        let limited = "trap '' XFSZ; ulimit -f 4; exec \"$0\" \"$@\"";
        let outcome = Command::new("sh")
            .args(["-c", limited, env!("CARGO_BIN_EXE_mba-under-test")])
            .args(&words)
            .arg("out.ply")
            .current_dir(&folder)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&outcome.stderr);
        assert!(matches!(outcome.status.code(), Some(1 | 2)), "{words:?}: {said}");
        assert!(said.contains("cannot write") && said.contains("out.ply"), "{words:?}: {said}");
        let left = files(&folder.join("out.ply"));
        let is_small = left.iter().all(|(_, content)| content.len() <= 4096);
        assert!(is_small, "{words:?} left a cut file");
        if words[0] == "synth" || words[0] == "mesh" {
            assert!(!folder.join("out.ply").exists(), "{words:?} left {left:?}");
        }
        let _ = fs::remove_dir_all(folder.join("out.ply"));
    }
    let partial = tree(&folder).into_keys().find(|path| path.to_string_lossy().ends_with(".partial"));
    assert_eq!(partial, None);
}
