//! Every kind of file with every kind of damage: a command ends with an exit code, one sentence that names what is wrong,
//! within time and memory, and nothing that it was not asked to write has changed.
//!
//! `MBA_DAMAGE=N cargo test --test damage` tries `N` random mutations of every file in place of the usual few.

#![cfg(target_os = "linux")]

mod mutation;
mod place;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use mba_tests::tree::{copy, differences, tree};
use mutation::{Mutation, of_any_file, of_png, of_text};
use place::{Outcome, mba, mba_within, pristine};

/// Random mutations of every file unless the environment asks for more.
const FLIPS: u32 = 6;

/// Seconds that no command takes.
const LONGEST: f64 = 60.0;

/// A file, what kind of damage fits it, and the command that reads it.
struct Subject {
    file: &'static str,
    kind: Kind,
    command: &'static [&'static str],
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Text,
    Binary,
    Png,
    /// A binary file with a checksum, which random damage can have made right again.
    Checkpoint,
}

const INFO: &[&str] = &["info", "data"];
const INFO_OF_LISTS: &[&str] = &["info", "listed"];
const RENDER: &[&str] = &["render", "mapped", "--poses", "poses.txt", "--out", "out", "--size", "16x12"];
const RENDER_FIELD: &[&str] = &["render", "field", "--poses", "poses.txt", "--out", "out", "--size", "16x12"];
const EVAL_MESH: &[&str] = &[
    "eval",
    "mesh",
    "--reference",
    "data/surface_points.ply",
    "--estimate",
    "mesh.ply",
    "--samples",
    "1000",
];
const EVAL_EXPOSURES: &[&str] = &[
    "eval",
    "trajectory",
    "--reference",
    "data/groundtruth_exposure.txt",
    "--estimate",
    "run/exposures.txt",
];
const EVAL_TRAJECTORY: &[&str] =
    &["eval", "trajectory", "--reference", "data/groundtruth.txt", "--estimate", "run/trajectory.txt"];
const EVAL_IMAGES: &[&str] = &["eval", "images", "--reference", "images", "--estimate", "others"];
const RESUME: &[&str] = &["map", "data", "--trajectory", "run", "--out", "stopped", "--resume"];
const RESUME_SLAM: &[&str] = &[
    "slam",
    "data",
    "--out",
    "stopped_slam",
    "--resume",
    "--max-gaussians",
    "60",
    "--time-budget",
    "0.05",
    "--self-calibrate",
    "off",
];
const MAP_OF_ESTIMATES: &[&str] =
    &["map", "data", "--trajectory", "estimated", "--out", "out", "--time-budget", "0.05"];
const INFO_OF_REPLICA: &[&str] = &["info", "replica"];
const INFO_OF_SCANNET: &[&str] = &["info", "scannet"];
const MESH: &[&str] = &["mesh", "mapped", "--out", "out.ply", "--voxel-cm", "20"];
const EXPORT: &[&str] = &["export", "mapped", "--to", "nerfstudio", "--out", "out"];
const EXPORT_POSES: &[&str] = &["export", "run", "--to", "kitti", "--out", "out"];
const MAP: &[&str] = &["map", "data", "--trajectory", "run", "--out", "out", "--time-budget", "0.05"];
const TRACK: &[&str] = &["track", "data", "--out", "out"];
const REPORT: &[&str] = &["report", "run", "--dataset", "data"];

const LOCALISE: &[&str] = &["localise", "mapped", "data", "--out", "out", "--self-calibrate", "off"];
const STATUS: &[&str] = &["status", "job"];
const MERGE: &[&str] = &["merge", "job", "--without-missing", "--out", "out"];
const BENCH: &[&str] = &["bench", "bench.toml", "--out", "out"];

/// The import of a recording that has its folder or file in `recorded`.
macro_rules! import {
    ($recording:literal) => {
        &["import", concat!("recorded/", $recording), "--out", "out"]
    };
}

const fn text(file: &'static str, command: &'static [&'static str]) -> Subject {
    Subject { file, kind: Kind::Text, command }
}

const fn binary(file: &'static str, command: &'static [&'static str]) -> Subject {
    Subject { file, kind: Kind::Binary, command }
}

const fn png(file: &'static str, command: &'static [&'static str]) -> Subject {
    Subject { file, kind: Kind::Png, command }
}

const fn checkpoint(file: &'static str, command: &'static [&'static str]) -> Subject {
    Subject { file, kind: Kind::Checkpoint, command }
}

const SUBJECTS: &[Subject] = &[
    text("data/associations.txt", INFO),
    text("listed/rgb.txt", INFO_OF_LISTS),
    text("listed/depth.txt", INFO_OF_LISTS),
    text("data/calibration.toml", INFO),
    text("data/calibration.toml", TRACK),
    text("data/groundtruth.txt", INFO),
    text("data/groundtruth_exposure.txt", INFO),
    text("data/exposures.csv", INFO),
    text("data/response.txt", INFO),
    text("data/gyro.csv", INFO),
    text("data/imu.csv", INFO),
    text("data/imu0/data.csv", INFO),
    text("data/accelerometer.txt", INFO),
    text("replica/traj.txt", INFO_OF_REPLICA),
    text("replica/cam_params.json", INFO_OF_REPLICA),
    text("scannet/intrinsic/intrinsic_color.txt", INFO_OF_SCANNET),
    text("scannet/pose/1.txt", INFO_OF_SCANNET),
    png("data/rgb/000000.png", INFO),
    binary("data/rgb/000002.jpg", INFO),
    png("data/depth/000003.png", INFO),
    png("data/depth/000000.png", MAP),
    text("run/trajectory.txt", EVAL_TRAJECTORY),
    text("data/groundtruth.txt", EVAL_TRAJECTORY),
    text("run/exposures.txt", EVAL_EXPOSURES),
    text("run/exposures.txt", MAP),
    text("run/frames.csv", MAP),
    text("estimated/calibration_estimated.toml", MAP_OF_ESTIMATES),
    text("estimated/exposures_estimated.csv", MAP_OF_ESTIMATES),
    text("run/summary.json", REPORT),
    text("mapped/summary.json", RENDER),
    text("mapped/exposures.txt", RENDER),
    text("mapped/frames.csv", RENDER),
    text("poses.txt", RENDER),
    binary("mapped/map.ply", RENDER),
    binary("field/map.mbaf", RENDER_FIELD),
    binary("mesh.ply", EVAL_MESH),
    binary("data/surface_points.ply", EVAL_MESH),
    png("images/000000.png", EVAL_IMAGES),
    png("others/000001.png", EVAL_IMAGES),
    binary("mapped/map.ply", MESH),
    text("run/exposures.txt", EXPORT_POSES),
    text("run/frames.csv", EXPORT_POSES),
    text("mapped/summary.json", EXPORT),
    binary("mapped/map.ply", EXPORT),
    png("mapped/deblurred/000000.png", EXPORT),
    png("mapped/depth/000000.png", EXPORT),
    checkpoint("stopped/checkpoint", RESUME),
    checkpoint("stopped_slam/checkpoint", RESUME_SLAM),
    text("mapped/exposures.txt", LOCALISE),
    binary("mapped/map.ply", LOCALISE),
    text("job/submaps.json", STATUS),
    text("job/submaps.json", MERGE),
    text("bench.toml", BENCH),
    binary("recorded/none.bag", import!("none.bag")),
    binary("recorded/bz2.bag", import!("bz2.bag")),
    binary("recorded/lz4.bag", import!("lz4.bag")),
    binary("recorded/plain.mcap", import!("plain.mcap")),
    binary("recorded/lz4.mcap", import!("lz4.mcap")),
    binary("recorded/zstd.mcap", import!("zstd.mcap")),
    binary("recorded/folders/scene.sens", import!("folders/scene.sens")),
    binary("recorded/folders/recording.r3d", import!("folders/recording.r3d")),
    text("recorded/folders/stray/odometry.csv", import!("folders/stray")),
    text("recorded/folders/stray/camera_matrix.csv", import!("folders/stray")),
    text("recorded/folders/polycam/keyframes/cameras/59426112113.json", import!("folders/polycam")),
    text("recorded/folders/scanner_app/frame_00000.json", import!("folders/scanner_app")),
    text("recorded/folders/transforms/transforms.json", import!("folders/transforms")),
    text("recorded/folders/open3d/camera_intrinsic.json", import!("folders/open3d")),
    text("recorded/folders/mba_vo/unreal.json", import!("folders/mba_vo")),
    text("recorded/folders/mba_vo/im_list.txt", import!("folders/mba_vo")),
    text("recorded/folders/mba_vo/groundtruth.txt", import!("folders/mba_vo")),
    binary("recorded/folders/mba_vo/depth_sharp_middle/0007.depth", import!("folders/mba_vo")),
    text("recorded/folders/bundle_fusion/info.txt", import!("folders/bundle_fusion")),
    text("recorded/folders/seven_scenes/frame-000000.pose.txt", import!("folders/seven_scenes")),
    text("recorded/folders/icl_nuim/livingRoom0.gt.freiburg", import!("folders/icl_nuim")),
    png("recorded/folders/icl_nuim/depth/0.png", import!("folders/icl_nuim")),
    binary("recorded/folders/stray/rgb/000000.jpg", import!("folders/stray")),
];

impl Subject {
    fn mutations(&self, flips: u32) -> Vec<Mutation> {
        let mut mutations = of_any_file(flips);
        match self.kind {
            Kind::Text => mutations.extend(of_text()),
            Kind::Png => mutations.extend(of_png()),
            Kind::Checkpoint => mutations.extend((0..4 * flips).map(Mutation::Forged)),
            Kind::Binary => {}
        }
        mutations
    }

    /// What the command may write: its output, or its own files in the run.
    fn may_change(&self, path: &Path) -> bool {
        let own: &[&str] = match self.command[0] {
            "report" => &["run/plots", "run/pictures", "run/report.html"],
            "map" if self.command.contains(&"stopped") => &["stopped"],
            "slam" => &["stopped_slam"],
            "mesh" => &["out.ply"],
            _ => &["out"],
        };
        own.iter().any(|own| path.starts_with(own))
    }
}

/// Damages the file in `folder`, runs the command, and puts everything back; returns what was wrong.
fn attempt(folder: &Path, good: &Path, subject: &Subject, mutation: Mutation) -> Result<Outcome, String> {
    let path = folder.join(subject.file);
    let content = fs::read(&path).unwrap();
    mutation.apply(&path, &content).unwrap();
    // Pipes and endless files cannot be read: the comparison is of all else.
    let without = |root: &Path| {
        let hidden = root.with_file_name("hidden");
        let _ = fs::rename(root.join(subject.file), &hidden);
        let items = tree(root);
        let _ = fs::rename(&hidden, root.join(subject.file));
        items
    };
    let before = without(folder);
    let outcome = mba(folder, subject.command);
    let mut changed = differences(&before, &without(folder));
    changed.retain(|path| !subject.may_change(path));
    let verdict = judge(&outcome, subject, &changed);
    // A map that was resumed in spite of the damage has replaced the file itself.
    for name in ["out", "out.ply", "stopped", "stopped_slam", "run", "data"] {
        remove(&folder.join(name));
        if good.join(name).exists() {
            copy(&good.join(name), &folder.join(name));
        }
    }
    remove(&path);
    fs::write(&path, content).unwrap();
    verdict.map(|()| outcome)
}

fn remove(path: &Path) {
    if fs::remove_file(path).is_err() {
        let _ = fs::remove_dir_all(path);
    }
}

fn judge(outcome: &Outcome, subject: &Subject, changed: &[PathBuf]) -> Result<(), String> {
    let Outcome { code, stderr, seconds } = outcome;
    let complain = |what: &str| Err(format!("{what}, exit code {code:?}, {seconds:.1} s:\n{stderr}"));
    if !changed.is_empty() {
        return complain(&format!("{changed:?} changed"));
    }
    if stderr.contains("panicked") || *seconds > LONGEST {
        return complain("panic or too slow");
    }
    let errors: Vec<&str> = stderr.lines().filter(|line| line.starts_with("error: ")).collect();
    match code {
        Some(0) if errors.is_empty() => Ok(()),
        Some(1 | 2) if errors.len() == 1 => {
            // The damage can show in another file, whose name is told then: an image that does not fit its calibration.
            let folder = subject.file.split(['/', '.']).next().unwrap_or_default();
            let stem = Path::new(subject.file).file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
            let names_it = [folder, stem, "the run ", "frame "].iter().any(|name| errors[0].contains(name));
            if !names_it {
                return complain("the sentence names no file");
            }
            if *code == Some(2) && !stderr.contains("hint: ") { complain("no advice") } else { Ok(()) }
        }
        _ => complain("neither success nor one sentence"),
    }
}

#[test]
fn every_file_survives_every_damage() {
    let flips = std::env::var("MBA_DAMAGE").ok().and_then(|text| text.parse().ok()).unwrap_or(FLIPS);
    let good = pristine();
    let mut cases: Vec<(usize, Mutation)> = Vec::new();
    for (index, subject) in SUBJECTS.iter().enumerate() {
        cases.extend(subject.mutations(flips).into_iter().map(|mutation| (index, mutation)));
    }
    let (next, failures) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let codes = Mutex::new([0_usize; 3]);
    let work = || {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("work");
        copy(good.path(), &folder);
        while let Some((subject, mutation)) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
            let subject = &SUBJECTS[*subject];
            match attempt(&folder, good.path(), subject, *mutation) {
                Ok(outcome) => codes.lock().unwrap()[outcome.code.unwrap_or(0) as usize] += 1,
                Err(why) => {
                    let words = subject.command.join(" ");
                    failures
                        .lock()
                        .unwrap()
                        .push(format!("{} {mutation:?}, mba {words}: {why}", subject.file));
                }
            }
        }
    };
    thread::scope(|scope| {
        let workers = thread::available_parallelism().map_or(1, usize::from);
        (0..workers).for_each(|_| drop(scope.spawn(work)));
    });
    let (failures, codes) = (failures.into_inner().unwrap(), codes.into_inner().unwrap());
    println!("{} inputs: exit codes 0, 1, 2: {codes:?}", cases.len());
    assert!(failures.is_empty(), "{} of {}:\n{}", failures.len(), cases.len(), failures.join("\n"));
    let kinds: BTreeSet<&str> = SUBJECTS.iter().map(|subject| subject.file).collect();
    assert!(kinds.len() >= 25 && codes[2] > codes[0] / 4, "the damage does not reach the readers: {codes:?}");
}

/// A calibration can claim any size; without images of that size there is nothing to make room for.
#[test]
fn a_size_that_no_image_has_takes_no_memory() {
    let place = tempfile::tempdir().unwrap();
    let data = place.path().join("data");
    fs::create_dir(&data).unwrap();
    let calibration = "width = 8000\nheight = 8000\nfx = 5000\nfy = 5000\ncx = 4000\ncy = 4000\n\
         distortion = [0.01, 0, 0, 0, 0]\nvignetting = [-0.1, 0]\ndepth_scale = 1000\n";
    fs::write(data.join("calibration.toml"), calibration).unwrap();
    for images in ["rgb", "depth"] {
        let list = format!("1 {images}/1.png\n2 {images}/2.png\n");
        fs::write(data.join(images).with_extension("txt"), list).unwrap();
    }
    for words in [&["info", "data"][..], TRACK, &["slam", "data", "--out", "out"]] {
        let Outcome { code, stderr, .. } = mba_within(place.path(), words, 300 << 10);
        assert!(matches!(code, Some(1 | 2)) && !stderr.contains("panicked"), "{words:?}: {code:?}\n{stderr}");
        assert!(stderr.contains("rgb/1.png"), "{words:?}: {stderr}");
    }
}
