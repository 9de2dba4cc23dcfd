//! `mba bench`.

use std::fs;
use std::path::Path;

use super::{Workplace, mba};

/// A place with two sequences, and a benchmark of them and one that is not there.
fn workplace() -> Workplace {
    let place = Workplace::new();
    let call = ["synth", "--frames", "8", "--size", "96x72", "--blur", "2", "--out"];
    let room = place.path("room");
    assert_eq!(mba(call.iter().map(Path::new).chain([room.as_path()])).code, Some(0));
    let benchmark = "title = \"Two walls\"\nnotes = \"As measured by hand.\"\n\
        [[sequence]]\nname = \"wall\"\ndataset = \"data\"\n\
        [[sequence]]\nname = \"room\"\ndataset = \"room\"\n\
        [[sequence]]\nname = \"cellar\"\ndataset = \"cellar\"\n\
        [[published]]\nmethod = \"Old\"\nsource = \"Report 7\"\nate_cm = { wall = 1, room = 2, cellar = 6 }\n\
        [[published]]\nmethod = \"New\"\nsource = \"Report 8\"\nate_cm = { wall = 0.5, mean = 0.25 }\n";
    fs::write(place.path("two.toml"), benchmark).unwrap();
    place
}

fn bench(place: &Workplace, more: &[&str]) -> super::Outcome {
    let [file, out] = [place.path("two.toml"), place.path("runs")];
    let call = ["bench", file.to_str().unwrap(), "--out", out.to_str().unwrap()];
    mba(call.iter().chain(more))
}

/// The cells of the line that begins with `name`.
fn row<'a>(table: &'a str, name: &str) -> Vec<&'a str> {
    let line =
        table.lines().find(|line| line.starts_with(name)).unwrap_or_else(|| panic!("{name}:\n{table}"));
    line[name.len()..].split_whitespace().collect()
}

#[test]
fn what_is_measured_stands_beside_what_was_published() {
    let place = workplace();
    let outcome = bench(&place, &[]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("cellar is not there"), "{}", outcome.stderr);
    let table = &outcome.stdout;
    assert!(table.starts_with("Two walls\n") && table.ends_with("As measured by hand.\n"), "{table}");
    assert_eq!(row(table, "ATE, cm (RMSE)"), ["wall", "room", "cellar", "mean"]);
    assert_eq!(row(table, "Old [1]"), ["1.00", "2.00", "6.00", "3.00"]);
    assert_eq!(row(table, "New [2]"), ["0.50", "-", "-", "0.25"]);
    assert_eq!((row(table, "[1]"), row(table, "[2]")), (vec!["Report", "7"], vec!["Report", "8"]));
    assert_eq!(row(table, "tracked, %"), ["100", "100", "-"]);
    // Of the map nothing is known.
    assert!(!table.contains("PSNR"), "{table}");
    let own = row(table, "mba track ");
    for (name, truth, cell) in [("wall", "data", own[0]), ("room", "room", own[1])] {
        let [truth, estimate] =
            [place.path(truth).join("groundtruth.txt"), place.path("runs").join(name).join("trajectory.txt")];
        let call = ["eval", "trajectory", "--json", "--reference", truth.to_str().unwrap(), "--estimate"];
        let figures = mba(call.iter().chain([&estimate.to_str().unwrap()])).json();
        let rmse = 100.0 * figures["ate_m"]["rmse"].as_f64().unwrap();
        assert_eq!(cell, format!("{rmse:.2}"), "{name}");
    }
    assert_eq!(own[2..], ["-", "-"]);
}

#[test]
fn finished_runs_are_not_made_again_and_repeated_ones_have_a_spread() {
    let place = workplace();
    bench(&place, &[]);
    let first = fs::read_to_string(place.path("runs/room/frames.csv")).unwrap();
    let figures = bench(&place, &["--repeats", "2", "--json"]).json();
    assert_eq!(fs::read_to_string(place.path("runs/room/frames.csv")).unwrap(), first);
    let room = &figures["measured"][1];
    assert_eq!((&room["sequence"], &room["runs"]), (&"room".into(), &2.into()));
    let spread: Vec<f64> = (0..3).map(|k| room["ate_cm"][k].as_f64().unwrap()).collect();
    assert!(spread[1] < spread[0] && spread[0] < spread[2], "{spread:?}");
    assert_eq!(figures["benchmark"]["published"][1]["ate_cm"]["mean"], 0.25);
}

#[test]
fn a_run_of_something_else_is_not_taken_for_one_of_the_sequence() {
    let place = workplace();
    let ate = |figures: &serde_json::Value, k: usize| figures["measured"][k]["ate_cm"][0].clone();
    let before = bench(&place, &["--json"]).json();
    // The names change places, and with them what lies in their folders.
    for (old, new) in [("\"data\"", "\"x\""), ("= \"room\"\n[[", "= \"data\"\n[["), ("\"x\"", "\"room\"")] {
        place.edit("two.toml", old, new);
    }
    let after = bench(&place, &["--json"]).json();
    assert_ne!(ate(&before, 0), ate(&before, 1));
    assert_eq!([ate(&after, 0), ate(&after, 1)], [ate(&before, 1), ate(&before, 0)]);
}

#[test]
fn a_sequence_that_cannot_be_run_does_not_stop_the_others() {
    let place = workplace();
    fs::write(place.path("room/calibration.toml"), "width = 0").unwrap();
    let outcome = bench(&place, &[]);
    assert_eq!(outcome.code, Some(1), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("error: 1 sequences could not be run; room: "), "{}", outcome.stderr);
    let own = row(&outcome.stdout, "mba track ");
    assert!(own[0].parse::<f64>().is_ok() && own[1..] == ["failed", "-", "-"], "{}", outcome.stdout);
    assert!(!outcome.stdout.contains("PSNR"), "{}", outcome.stdout);
}

#[test]
fn what_cannot_be_used_is_named() {
    let place = workplace();
    place.edit("two.toml", "title", "titel");
    bench(&place, &[]).assert_error(2, &["two.toml: unknown field `titel`"]);
    place.edit("two.toml", "titel", "title");
    let nowhere = place.path("nowhere");
    bench(&place, &["--data", nowhere.to_str().unwrap()])
        .assert_error(2, &["none of the sequences is there", "nowhere/data"]);
}

#[test]
fn the_benchmarks_of_the_manual_are_read() {
    let place = tempfile::tempdir().unwrap();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/benchmarks");
    let mut count = 0;
    for file in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let call =
            ["bench", file.to_str().unwrap(), "--data", place.path().to_str().unwrap(), "--out", "runs"];
        mba(call).assert_error(2, &["none of the sequences is there"]);
        count += 1;
    }
    assert!(count >= 4, "{count}");
}
