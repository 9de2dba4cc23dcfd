//! A workplace with every kind of file, and one damaged file at a time.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use mba_tests::blurred_sequence::BlurredSequence;
use mba_tests::tree::copy;
use tempfile::TempDir;

/// What a process left behind.
#[derive(Debug)]
pub(crate) struct Outcome {
    pub(crate) code: Option<i32>,
    pub(crate) stderr: String,
    pub(crate) seconds: f64,
}

/// Kibibytes of address space that a command may ask for: whoever believes a wrong size dies.
const MEMORY_LIMIT: usize = 3 << 20;

/// Seconds after which a command is killed.
const TIME_LIMIT: usize = 60;

/// Runs the program in `folder`.
pub(crate) fn mba(folder: &Path, words: &[&str]) -> Outcome {
    let started = Instant::now();
    let limited = format!("ulimit -v {MEMORY_LIMIT}; exec timeout -s KILL {TIME_LIMIT} \"$0\" \"$@\"");
    let program = env!("CARGO_BIN_EXE_mba-under-test");
    let output = Command::new("sh")
        .args(["-c", &limited, program])
        .args(words)
        .args(["--threads", "1"])
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    Outcome {
        code: output.status.code(),
        stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        seconds: started.elapsed().as_secs_f64(),
    }
}

/// Makes a folder with everything that a command can read:
///
/// `data` and `listed` (data sets with and without associations), `run`, `mapped` (Gaussians), `field`, `stopped` (a
/// checkpoint), `mesh.ply`, `poses.txt`, `images` and `others` (folders of images).
pub(crate) fn pristine() -> TempDir {
    let sequence = BlurredSequence::tiny();
    let _ = sequence.run_of("run", sequence.truth());
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    copy(&sequence.path("data"), &at("data"));
    copy(&sequence.path("run"), &at("run"));
    complete_data_set(&at("data"));
    copy(&at("data"), &at("listed"));
    fs::remove_file(at("listed/associations.txt")).unwrap();
    let map = ["map", "data", "--trajectory", "run", "--out"];
    for (out, field) in [("mapped", "gaussians"), ("field", "triplane")] {
        let made = mba(place.path(), &[&map[..], &[out, "--time-budget", "0.5", "--field", field]].concat());
        assert_eq!(made.code, Some(0), "{}", made.stderr);
    }
    stop_a_map(place.path());
    let mesh = mba(place.path(), &["mesh", "mapped", "--out", "mesh.ply", "--voxel-cm", "8"]);
    assert_eq!(mesh.code, Some(0), "{}", mesh.stderr);
    fs::create_dir(at("images")).unwrap();
    fs::copy(at("data/rgb/000000.png"), at("images/000000.png")).unwrap();
    fs::copy(at("data/depth/000001.png"), at("images/000001.png")).unwrap();
    copy(&at("images"), &at("others"));
    let poses = fs::read_to_string(at("run/trajectory.txt")).unwrap();
    fs::write(at("poses.txt"), poses.lines().take(3).map(|line| format!("{line}\n")).collect::<String>())
        .unwrap();
    place
}

/// Adds what a data set may have and a synthetic one has not.
fn complete_data_set(data: &Path) {
    let list = fs::read_to_string(data.join("rgb.txt")).unwrap();
    let times = list.lines().filter(|line| !line.starts_with('#')).filter_map(|line| line.split(' ').next());
    let rows: String = times.map(|time| format!("{time},0.01\n")).collect();
    fs::write(data.join("exposures.csv"), format!("timestamp,exposure_s\n{rows}")).unwrap();
    let table: String = (0..256)
        .map(|code| format!("{}\n", f64::from(code * code) / 65_025.0 + f64::from(code) * 1e-6))
        .collect();
    fs::write(data.join("response.txt"), table).unwrap();
    let calibration = fs::read_to_string(data.join("calibration.toml")).unwrap();
    let response = calibration.lines().find(|line| line.starts_with("response")).unwrap().to_owned();
    fs::write(data.join("calibration.toml"), calibration.replace(&response, "response = \"response.txt\""))
        .unwrap();
    let rates: String = (0..300)
        .map(|k| format!("{:.6},0.1,{:.3},-0.2\n", f64::from(k) / 200.0 - 0.5, 1e-3 * f64::from(k)))
        .collect();
    fs::write(data.join("gyro.csv"), format!("timestamp,wx_rad_s,wy_rad_s,wz_rad_s\n{rates}")).unwrap();
    // One of the frames is a JPEG.
    let image = image::open(data.join("rgb/000002.png")).unwrap().into_rgb8();
    image.save(data.join("rgb/000002.jpg")).unwrap();
    for list in ["rgb.txt", "associations.txt"] {
        let text = fs::read_to_string(data.join(list)).unwrap();
        fs::write(data.join(list), text.replace("rgb/000002.png", "rgb/000002.jpg")).unwrap();
    }
}

/// A run in `stopped` that was killed after its first checkpoint.
fn stop_a_map(folder: &Path) {
    let checkpoint: PathBuf = folder.join("stopped/checkpoint");
    let words = ["map", "data", "--trajectory", "run", "--out", "stopped", "--checkpoint-interval", "0"];
    let mut process = Command::new(env!("CARGO_BIN_EXE_mba-under-test"))
        .args(words)
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    while !checkpoint.is_file() {
        assert!(process.try_wait().unwrap().is_none(), "it ended before there was a checkpoint");
        sleep(Duration::from_millis(2));
    }
    process.kill().unwrap();
    process.wait().unwrap();
}
