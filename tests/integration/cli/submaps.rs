//! A run that is split, mapped by several processes in any order, some of them killed, and merged.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use mba_mapper::run::Run;
use mba_tests::tree::{Item, tree};
use tempfile::TempDir;

use super::kill_campaign::kills;
use super::{Outcome, mba};

/// Groups of the job.
const GROUPS: usize = 3;

/// Frames of the data set, all of them keyframes.
const FRAMES: usize = 12;

/// How it is split.
const SPLIT: [&str; 8] = ["split", "run", "--out", "job", "--group-keyframes", "5", "--keyframe-motion", "0"];

/// A data set that was tracked and split, and the merged run of its groups, which were mapped one after the other.
struct Split {
    folder: TempDir,
}

impl Split {
    fn new() -> Self {
        let split = Self { folder: tempfile::tempdir().unwrap() };
        split.done(&["synth", "--frames", "12", "--size", "96x72", "--blur", "2", "--out", "data"]);
        split.done(&["track", "data", "--out", "run"]);
        split.done(&SPLIT);
        split
    }

    /// With its groups mapped and merged.
    fn merged() -> Self {
        let split = Self::new();
        split.done(&["map", "job", "--jobs", "2"]);
        split.done(&["merge", "job", "--out", "merged"]);
        split
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mba-under-test"));
        command.args(words).current_dir(self.folder.path());
        command
    }

    fn call(&self, words: &[&str]) -> Outcome {
        let output = self.command(words).output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        Outcome { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
    }

    fn done(&self, words: &[&str]) -> Outcome {
        let outcome = self.call(words);
        assert_eq!(outcome.code, Some(0), "{words:?}: {}", outcome.stderr);
        outcome
    }

    fn start(&self, words: &[&str]) -> Child {
        self.command(words).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// Another job with the same plan and no maps.
    fn fresh(&self, name: &str) {
        fs::create_dir(self.path(name)).unwrap();
        fs::copy(self.path("job/submaps.json"), self.path(name).join("submaps.json")).unwrap();
    }
}

/// The files of a run or a job that tell no times.
fn lasting(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let file = |(path, item): (PathBuf, Item)| match item {
        Item::File(content) if !path.ends_with("summary.json") => Some((path, content)),
        _ => None,
    };
    tree(folder).into_iter().filter_map(file).collect()
}

fn assert_same(one: &Path, two: &Path) {
    let [a, b] = [lasting(one), lasting(two)];
    let names = |files: &[(PathBuf, Vec<u8>)]| files.iter().map(|(path, _)| path.clone()).collect::<Vec<_>>();
    assert_eq!(names(&a), names(&b), "{} and {}", one.display(), two.display());
    for ((path, a), (_, b)) in a.iter().zip(&b) {
        assert!(a == b, "{} differs in {} and {}", path.display(), one.display(), two.display());
    }
}

#[test]
fn any_number_of_processes_in_any_order_gives_the_same_bytes() {
    let split = Split::merged();
    let run = Run::open(&split.path("merged")).unwrap();
    let tracked = Run::open(&split.path("run")).unwrap();
    assert!(run.summary.complete && run.exposures.len() == FRAMES);
    let map = run.summary.map.unwrap();
    assert_eq!(
        (map.keyframes, run.summary.frames.keyframes, run.summary.deblurred_keyframes),
        (FRAMES, FRAMES, FRAMES)
    );
    // Poses of a map are better than tracked ones, if at all different.
    let ate = |run: &Run| run.summary.trajectory.as_ref().unwrap().ate_m.rmse;
    assert!(ate(&run) < 1.1 * ate(&tracked), "{} after {}", ate(&run), ate(&tracked));
    assert!(map.heldout_psnr_mapped.unwrap() > 20.0, "{map:?}");
    split.fresh("seven");
    split.done(&["map", "seven", "--jobs", "7"]);
    assert_same(&split.path("job"), &split.path("seven"));
    split.fresh("backwards");
    for k in (0..GROUPS).rev() {
        split.done(&["map", "backwards", "--submap", &k.to_string(), "--threads", "1"]);
    }
    assert_same(&split.path("job"), &split.path("backwards"));
    split.done(&["merge", "backwards", "--out", "merged-backwards", "--threads", "1"]);
    assert_same(&split.path("merged"), &split.path("merged-backwards"));
    // An ordinary run: other commands read it.
    split.done(&["render", "merged", "--poses", "merged/trajectory.txt", "--out", "views"]);
    split.done(&["mesh", "merged", "--voxel-cm", "4", "--out", "mesh.ply"]);
    split.done(&["report", "merged"]);
}

#[test]
fn a_killed_process_costs_its_own_group_only() {
    let split = Split::new();
    split.fresh("killed");
    for k in 0..GROUPS {
        let group = k.to_string();
        let begun = Instant::now();
        split.done(&["map", "job", "--submap", &group]);
        let seconds = begun.elapsed();
        let words = ["map", "killed", "--submap", &group, "--checkpoint-interval", "0"];
        for part in 1..=kills(3) {
            let mut process = split.start(&words);
            sleep(seconds.mul_f64(0.35 * f64::from(part % 3)));
            process.kill().unwrap();
            process.wait().unwrap();
        }
        split.done(&words);
    }
    assert_same(&split.path("job"), &split.path("killed"));
    let group = |status: &serde_json::Value, k: usize| status["groups"][k]["state"].clone();
    let status = split.done(&["status", "killed", "--json"]).json();
    assert_eq!((status["done"].as_u64(), group(&status, 1)), (Some(GROUPS as u64), "done".into()));
}

#[test]
fn a_signal_ends_a_group_with_the_code_that_means_try_again() {
    let split = Split::new();
    let mut process = split.start(&["map", "job", "--submap", "1"]);
    let checkpoint = split.path("job/001/checkpoint");
    let begun = Instant::now();
    while !checkpoint.is_file() {
        assert!(begun.elapsed() < Duration::from_secs(60) && process.try_wait().unwrap().is_none());
        sleep(Duration::from_millis(2));
    }
    let sent = Command::new("kill").args(["-TERM", &process.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let output = process.wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(75), "{said}");
    assert!(said.lines().last().unwrap().starts_with("hint: `mba map job --submap 1` goes on"), "{said}");
    let status = split.done(&["status", "job", "--json"]).json();
    let states: Vec<_> = (0..GROUPS).map(|k| status["groups"][k]["state"].as_str().unwrap()).collect();
    assert_eq!(states, ["waiting", "begun", "waiting"]);
}

#[test]
fn missing_stale_and_foreign_groups_are_refused_by_name() {
    let split = Split::merged();
    let at = |name: &str| split.path("job").join(name);
    let merge = || split.call(&["merge", "job", "--out", "refused"]);
    // A map that was changed afterwards.
    let map = fs::read(at("001/map.ply")).unwrap();
    let mut changed = map.clone();
    *changed.last_mut().unwrap() ^= 1;
    fs::write(at("001/map.ply"), &changed).unwrap();
    merge().assert_error(2, &["job/001/map.ply has changed since the group was mapped"]);
    fs::write(at("001/map.ply"), &map).unwrap();
    // The map of another group.
    let own = fs::read(at("002/submap.json")).unwrap();
    fs::copy(at("001/submap.json"), at("002/submap.json")).unwrap();
    merge().assert_error(2, &["job/002/submap.json: it is the map of group 1, not 2"]);
    // None at all: around it only when asked for.
    fs::remove_file(at("002/submap.json")).unwrap();
    merge().assert_error(2, &["job/002 is not mapped"]);
    let partly = split.done(&["merge", "job", "--out", "partly", "--without-missing"]);
    assert!(partly.stderr.contains("warning: group 2 is not mapped"), "{}", partly.stderr);
    let [partly, tracked] = ["partly", "run"].map(|name| Run::open(&split.path(name)).unwrap());
    // The text of a pose rounds the ninth digit.
    let apart = partly.exposures[FRAMES - 1].mid.tangent_to(&tracked.exposures[FRAMES - 1].mid).norm();
    assert!(partly.exposures.len() == FRAMES && apart < 1e-7, "{apart}");
    fs::write(at("002/submap.json"), own).unwrap();
    split.done(&["merge", "job", "--out", "again"]);
    assert_same(&split.path("merged"), &split.path("again"));
    // Another plan in the same place.
    split.done(&[
        "split",
        "run",
        "--out",
        "job",
        "--group-keyframes",
        "8",
        "--keyframe-motion",
        "0",
        "--seed",
        "2",
    ]);
    merge().assert_error(2, &["job/000/submap.json: it was mapped for another plan"]);
    assert!(!split.path("refused").exists());
    // Another run in the place of the one that was split.
    split.done(&["track", "data", "--out", "run", "--blur", "off"]);
    split
        .call(&["map", "job", "--submap", "0"])
        .assert_error(2, &["job/submaps.json: the run is not the one"]);
    let none = mba(["merge".as_ref(), split.path("run").as_os_str(), "--out".as_ref(), "x".as_ref()]);
    none.assert_error(2, &["run is not a job: it has no submaps.json"]);
    split
        .call(&["map", "job", "--submap", "9"])
        .assert_error(2, &["job has no group 9: there are 2, from 0"]);
}
