//! Outputs never destroy what the program did not write.

use std::fs;
use std::path::{Path, PathBuf};

use mba_tests::small_dataset::FRAMES;
use mba_tests::tree::{Item, copy, differences, tree};

use super::{Outcome, Workplace, mba};

/// The small data set in `data`, tracked in `run` and mapped in `mapped`, and a folder of somebody's own in `own`.
fn workplace() -> Workplace {
    let place = Workplace::new();
    assert_eq!(place.track().code, Some(0));
    assert_eq!(mapped(&place, "mapped", &["--time-budget", "0.3"]).code, Some(0));
    fs::create_dir_all(place.path("own/depth")).unwrap();
    for (name, text) in [("thesis.tex", "\\title"), ("depth/000000.png", "mine"), ("mesh.ply", "ply\nmine\n")]
    {
        fs::write(place.path("own").join(name), text).unwrap();
    }
    place
}

fn command(place: &Workplace, words: &[&str]) -> Outcome {
    // Words with a colon in front are paths in the workplace.
    let word = |word: &&str| match word.strip_prefix(':') {
        Some(path) => place.path(path),
        None => PathBuf::from(word),
    };
    mba(words.iter().map(word))
}

fn mapped(place: &Workplace, out: &str, options: &[&str]) -> Outcome {
    let out = format!(":{out}");
    command(place, &[&["map", ":data", "--trajectory", ":run", "--out", &out][..], options].concat())
}

/// The commands that write, without the place.
fn writers() -> [(&'static str, Vec<&'static str>); 9] {
    [
        ("track", vec!["track", ":data"]),
        ("map", vec!["map", ":data", "--trajectory", ":run", "--time-budget", "0.3"]),
        ("slam", vec!["slam", ":data", "--time-budget", "0.3"]),
        ("render", vec!["render", ":mapped", "--poses", ":run/trajectory.txt", "--size", "32x24"]),
        ("mesh", vec!["mesh", ":mapped", "--voxel-cm", "4"]),
        ("export of poses", vec!["export", ":run", "--to", "tum"]),
        ("export of rows", vec!["export", ":run", "--to", "kitti"]),
        ("export", vec!["export", ":mapped", "--to", "nerfstudio"]),
        ("synth", vec!["synth", "--frames", "2", "--size", "64x48", "--blur", "1", "--scene", "wall"]),
    ]
}

#[test]
fn nothing_is_written_into_a_data_set_or_over_things_of_others() {
    let place = workplace();
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("data", place.path("link")).unwrap();
        std::os::unix::fs::symlink("nowhere", place.path("dead")).unwrap();
    }
    let before = tree(&place.path(""));
    let always = [
        "data",
        "data/new",
        "data/depth",
        "data/rgb.txt",
        "link",
        "link/new",
        "own/thesis.tex/run",
        "run/../data",
    ];
    let unless_forced = ["own", "own/thesis.tex"];
    for (name, writer) in writers() {
        for out in always.iter().chain(&unless_forced) {
            let target = format!(":{out}");
            // A mesh is a file, in a folder of others it is just one more.
            let is_folder = matches!(*out, "data" | "data/depth" | "link" | "own" | "run/../data");
            let mut words = [&writer[..], &["--out", &target]].concat();
            let refused = command(&place, &words);
            assert_eq!(refused.code, Some(2), "{name} {out}: {}", refused.stderr);
            assert_eq!(
                refused.stderr.lines().filter(|line| line.starts_with("error: ")).count(),
                1,
                "{}",
                refused.stderr
            );
            assert!(
                name == "synth" && is_folder || refused.stderr.contains("cannot write"),
                "{}",
                refused.stderr
            );
            if always.contains(out) && name != "synth" {
                words.push("--force");
                let refused = command(&place, &words);
                assert_eq!(refused.code, Some(2), "{name} {out} --force: {}", refused.stderr);
            }
        }
        let changed = differences(&before, &tree(&place.path("")));
        assert!(changed.is_empty(), "{name} changed {changed:?}");
    }
}

#[test]
fn what_the_command_reads_is_not_written() {
    let place = workplace();
    let before = tree(&place.path(""));
    mapped(&place, "run", &[]).assert_error(2, &["run", "the command reads it"]);
    let views = ["render", ":mapped", "--poses", ":run/trajectory.txt", "--force", "--out"];
    command(&place, &[&views[..], &[":mapped"]].concat()).assert_error(2, &["the command reads it"]);
    // The trajectory of another run is no mesh; its own map a mesh does not replace, whatever is allowed.
    let mesh = command(&place, &["mesh", ":mapped", "--out", ":run/trajectory.txt"]);
    mesh.assert_error(2, &["cannot write", "did not write"]);
    for force in [&[][..], &["--force"]] {
        let mesh = command(&place, &[&["mesh", ":mapped", "--out", ":mapped/map.ply"][..], force].concat());
        mesh.assert_error(2, &["cannot write", "the command reads it"]);
    }
    let stl = command(&place, &["mesh", ":mapped", "--out", ":mesh.stl"]);
    stl.assert_error(2, &["mesh.stl", ".ply, .glb or .obj"]);
    assert_eq!(differences(&before, &tree(&place.path(""))), Vec::<PathBuf>::new());
}

#[test]
fn earlier_results_are_replaced_and_notes_beside_them_stay() {
    let place = workplace();
    fs::write(place.path("mapped/notes.txt"), "mine").unwrap();
    fs::write(place.path("mapped/deblurred/notes.png"), "mine").unwrap();
    let tracked = command(&place, &["track", ":data", "--out", ":mapped", "--keyframes", "off"]);
    assert_eq!(tracked.code, Some(0), "{}", tracked.stderr);
    let left = tree(&place.path("mapped"));
    let names: Vec<_> = left.keys().map(|path| path.to_str().unwrap()).collect();
    // Map, depth maps and images of the earlier run would belong to other poses.
    let expected = [
        "covariances.txt",
        "deblurred",
        "deblurred/notes.png",
        "exposures.txt",
        "frames.csv",
        "notes.txt",
        "summary.json",
        "trajectory.txt",
    ];
    assert_eq!(names, expected);
}

#[test]
fn force_writes_beside_things_of_others_and_removes_none() {
    let place = workplace();
    fs::remove_dir_all(place.path("own/depth")).unwrap();
    let before = tree(&place.path("own"));
    let tracked = command(&place, &["track", ":data", "--out", ":own", "--force"]);
    assert_eq!(tracked.code, Some(0), "{}", tracked.stderr);
    let after = tree(&place.path("own"));
    assert!(before.iter().all(|(path, item)| after.get(path) == Some(item)));
    assert!(after.contains_key(Path::new("summary.json")));
    let mesh = ["mesh", ":mapped", "--voxel-cm", "4", "--out", ":own/mesh.ply"];
    command(&place, &mesh).assert_error(2, &["mesh.ply", "did not write"]);
    assert_eq!(command(&place, &[&mesh[..], &["--force"]].concat()).code, Some(0));
    // From then on it is the program's own.
    assert_eq!(command(&place, &mesh).code, Some(0));
}

#[test]
fn a_start_that_is_refused_or_finds_nothing_leaves_the_earlier_run() {
    let place = workplace();
    copy(&place.path("data"), &place.path("bad"));
    let calibration = fs::read_to_string(place.path("bad/calibration.toml")).unwrap();
    let before = tree(&place.path("mapped"));
    fs::write(place.path("bad/calibration.toml"), calibration.replace("fx = 130.0", "fx = 0.5")).unwrap();
    for command_name in ["track", "slam"] {
        let refused = command(&place, &[command_name, ":bad", "--out", ":mapped"]);
        assert_ne!(refused.code, Some(0), "{command_name}: {}", refused.stderr);
        assert_eq!(
            differences(&before, &tree(&place.path("mapped"))),
            Vec::<PathBuf>::new(),
            "{command_name}"
        );
    }
    fs::write(place.path("bad/calibration.toml"), calibration).unwrap();
    for frame in 0..FRAMES {
        fs::remove_file(place.path(&format!("bad/rgb/{frame:06}.png"))).unwrap();
    }
    for command_name in ["track", "slam"] {
        let refused = command(&place, &[command_name, ":bad", "--out", ":mapped"]);
        refused.assert_error(1, &["nothing could be tracked", "8 of 8 sampled frames cannot be read"]);
        assert_eq!(
            differences(&before, &tree(&place.path("mapped"))),
            Vec::<PathBuf>::new(),
            "{command_name}"
        );
    }
}

#[cfg(unix)]
#[test]
fn devices_pipes_and_the_standard_output_are_written_to() {
    use std::os::unix::fs::FileTypeExt;
    let place = workplace();
    let mesh = |out: &str| command(&place, &["mesh", ":mapped", "--voxel-cm", "4", "-q", "--out", out]);
    assert_eq!(mesh("/dev/null").code, Some(0));
    assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
    mesh("/dev/full").assert_error(1, &["/dev/full"]);
    assert_eq!(mesh(":mesh.ply").code, Some(0));
    // The output is no text: the helper for text does not do.
    let [run, pipe] = [place.path("mapped"), place.path("pipe")];
    let program = || std::process::Command::new(env!("CARGO_BIN_EXE_mba-under-test"));
    let arguments = |out: &Path| {
        [
            "mesh".into(),
            run.clone(),
            "--voxel-cm".into(),
            "4".into(),
            "-q".into(),
            "--out".into(),
            out.to_owned(),
        ]
    };
    let written = program().args(arguments(Path::new("-"))).output().unwrap();
    let expected = fs::read(place.path("mesh.ply")).unwrap();
    assert!(written.stdout == expected, "{}", String::from_utf8_lossy(&written.stderr));
    let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
    assert!(made.success());
    let mut process = program().args(arguments(&pipe)).spawn().unwrap();
    assert!(fs::read(&pipe).unwrap() == expected);
    assert!(process.wait().unwrap().success());
    assert!(fs::metadata(&pipe).unwrap().file_type().is_fifo());
    for out in ["-", "/dev/null"] {
        let refused = command(&place, &["track", ":data", "--out", out]);
        refused.assert_error(2, &["cannot write", "not a folder"]);
    }
}

#[test]
fn a_run_is_written_by_one_process_at_a_time() {
    let place = workplace();
    let claimed =
        mba_mapper::output::OutputFolder::for_run(&place.path("mapped"), &Default::default()).unwrap();
    let before = tree(&place.path("mapped"));
    for command_name in ["track", "slam"] {
        let refused = command(&place, &[command_name, ":data", "--out", ":mapped"]);
        refused.assert_error(2, &["mapped", &format!("process {}", std::process::id())]);
    }
    mapped(&place, "mapped", &[]).assert_error(2, &["another process is writing it"]);
    assert_eq!(differences(&before, &tree(&place.path("mapped"))), Vec::<PathBuf>::new());
    drop(claimed);
    assert_eq!(command(&place, &["track", ":data", "--out", ":mapped"]).code, Some(0));
}

#[test]
fn the_report_does_not_replace_pages_of_others() {
    let place = workplace();
    let report = place.path("run/report.html");
    fs::write(&report, "<!doctype html><title>my notes</title>").unwrap();
    let before = tree(&place.path("run"));
    command(&place, &["report", ":run"]).assert_error(2, &["report.html", "did not write"]);
    assert_eq!(differences(&before, &tree(&place.path("run"))), Vec::<PathBuf>::new());
    for options in [&["--force"][..], &[]] {
        assert_eq!(command(&place, &[&["report", ":run"], options].concat()).code, Some(0));
    }
}

#[test]
fn the_views_of_a_data_set_that_was_killed_are_replaced() {
    let place = Workplace::new();
    let synth =
        ["synth", "--frames", "2", "--size", "64x48", "--blur", "1", "--scene", "wall", "--out", ":new"];
    assert_eq!(command(&place, &synth).code, Some(0));
    let whole = tree(&place.path("new"));
    // What a kill leaves: some images, half of one, no calibration, and the lock of a process that is gone.
    for name in ["calibration.toml", "rgb.txt", "depth.txt", "associations.txt", "rgb/000001.png"] {
        fs::remove_file(place.path("new").join(name)).unwrap();
    }
    fs::write(place.path("new/rgb/000001.png.partial"), "half").unwrap();
    fs::write(place.path("new/.mba-lock"), "mba is writing this folder, process 1\n").unwrap();
    assert_eq!(command(&place, &synth).code, Some(0));
    assert_eq!(differences(&whole, &tree(&place.path("new"))), Vec::<PathBuf>::new());
    assert!(matches!(whole.get(Path::new("rgb")), Some(Item::Folder)));
    command(&place, &synth).assert_error(2, &["new is not empty"]);
}
