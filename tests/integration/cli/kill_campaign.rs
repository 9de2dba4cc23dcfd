//! Tracks, maps and SLAM runs that are killed again and again, and go on each time: nothing that was read changes, what is left
//! is marked as incomplete, and the result is that of a run that nobody disturbed.
//!
//! `MBA_KILLS=N cargo test --release -p mba-tests --test cli kill` kills every command at least `N` times.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use mba_mapper::run::Run;
use mba_tests::blurred_sequence::{assert_same_map, assert_same_track};
use mba_tests::tree::{Item, tree};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::mba;

/// Kills of each command unless the environment asks for more.
const KILLS: u32 = 5;

/// Of the time that a whole run takes, a part lasts at most this share.
const LONGEST_PART: f64 = 0.4;

/// How often every command is killed: `usual`, or what the environment says.
pub(super) fn kills(usual: u32) -> u32 {
    std::env::var("MBA_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

/// A data set, a run of it, and one undisturbed result.
struct Campaign<'a> {
    folder: &'a Path,
    words: &'a [&'a str],
    inputs: BTreeMap<PathBuf, Item>,
    /// Asserts that two results are the same.
    same: fn(&Path, &Path),
    seconds: f64,
}

impl Campaign<'_> {
    fn command(&self, out: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mba-under-test"));
        // A checkpoint as often as can be: as many different states as can be are gone on from.
        command.args(self.words).args(["--checkpoint-interval", "0", "--resume", "--out", out]);
        let said = File::create(self.folder.join("said")).unwrap();
        command.current_dir(self.folder).stdout(Stdio::null()).stderr(said);
        command
    }

    /// Starts, kills after `seconds`, and says whether it had ended before.
    fn part(&self, seconds: f64) -> bool {
        let mut process = self.command("out").spawn().unwrap();
        let started = Instant::now();
        while started.elapsed().as_secs_f64() < seconds {
            if let Some(status) = process.try_wait().unwrap() {
                let said = std::fs::read_to_string(self.folder.join("said")).unwrap();
                assert!(status.success(), "{:?}: {status}\n{said}", self.words);
                return true;
            }
            sleep(Duration::from_millis(2));
        }
        process.kill().unwrap();
        process.wait().unwrap().success()
    }

    /// What holds after every kill; says whether the run is complete.
    fn check(&self) -> bool {
        assert!(inputs(self.folder) == self.inputs, "{:?} changed what it reads", self.words);
        let out = self.folder.join("out");
        if !out.join("summary.json").is_file() {
            return false;
        }
        let run = Run::open(&out).unwrap_or_else(|error| panic!("{:?} left a cut run: {error}", self.words));
        if run.summary.complete {
            (self.same)(&self.folder.join("whole"), &out);
        }
        run.summary.complete
    }
}

fn inputs(folder: &Path) -> BTreeMap<PathBuf, Item> {
    let mut items = tree(folder);
    items.retain(|path, _| path.starts_with("data") || path.starts_with("run"));
    items
}

/// Kills a command until there were enough kills and it has ended; returns how often it was killed and ended.
fn campaign(folder: &Path, words: &[&str], same: fn(&Path, &Path), kills: u32, seed: u64) -> [u32; 2] {
    let mut campaign = Campaign { folder, words, inputs: inputs(folder), same, seconds: 0.0 };
    let started = Instant::now();
    assert!(campaign.command("whole").status().unwrap().success(), "{words:?}");
    campaign.seconds = started.elapsed().as_secs_f64();
    let mut random = Pcg32::seed_from_u64(seed);
    let (mut killed, mut ended) = (0, 0);
    // The last part is not disturbed, so that what was killed last ends too.
    while killed < kills || folder.join("out").exists() {
        let share = if killed < kills { f64::from(random.next_u32()) / f64::from(u32::MAX) } else { 1e3 };
        let has_ended = campaign.part(share * LONGEST_PART * campaign.seconds);
        killed += u32::from(!has_ended);
        let complete = campaign.check();
        assert!(complete || !has_ended, "{words:?} ended and is not complete");
        if has_ended {
            ended += 1;
            std::fs::remove_dir_all(folder.join("out")).unwrap();
        }
    }
    std::fs::remove_dir_all(folder.join("whole")).unwrap();
    println!("{}: killed {killed} times, ended {ended} times, {:.1} s", words[0], campaign.seconds);
    [killed, ended]
}

#[test]
fn killed_maps_and_slam_runs_end_like_those_that_were_not() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let at = |name: &str| folder.join(name).into_os_string();
    let synth = ["synth", "--frames", "12", "--size", "160x120", "--blur", "2", "--out"];
    assert_eq!(mba(synth.map(Into::into).into_iter().chain([at("data")])).code, Some(0));
    assert_eq!(mba(["track".into(), at("data"), "--out".into(), at("run")]).code, Some(0));
    let few = ["--max-gaussians", "1500", "--max-keyframes", "4"];
    let map = [&["map", "data", "--trajectory", "run"][..], &few].concat();
    let slam = [&["slam", "data"][..], &few].concat();
    for (words, seed) in [(map, 1), (slam, 2)] {
        let [killed, ended] = campaign(folder, &words, assert_same_map, kills(KILLS), seed);
        assert!(killed >= kills(KILLS) && ended > 0);
    }
}

#[test]
fn killed_tracks_end_like_those_that_were_not() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let synth = ["synth", "--frames", "40", "--size", "320x240", "--blur", "4", "--readout", "0.02", "--out"];
    let data = folder.join("data").into_os_string();
    assert_eq!(mba(synth.map(Into::into).into_iter().chain([data])).code, Some(0));
    let [killed, ended] = campaign(folder, &["track", "data"], assert_same_track, kills(2 * KILLS), 3);
    assert!(killed >= kills(2 * KILLS) && ended > 0);
}
