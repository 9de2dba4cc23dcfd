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
    mba_within(folder, words, MEMORY_LIMIT)
}

/// Runs the program in `folder` with so many kibibytes of address space.
pub(crate) fn mba_within(folder: &Path, words: &[&str], kibibytes: usize) -> Outcome {
    let started = Instant::now();
    let limited = format!("ulimit -v {kibibytes}; exec timeout -s KILL {TIME_LIMIT} \"$0\" \"$@\"");
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
/// checkpoint), `stopped_slam`, `estimated` (a run with what was found of the camera), `replica` and `scannet` (data sets in
/// other layouts), `job` (a split run), `recorded` (what is imported), `bench.toml`, `mesh.ply`, `poses.txt`, `images` and `others` (folders of images).
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
    let map = ["map", "data", "--trajectory", "run", "--out", "stopped"];
    stop(place.path(), "stopped", &map);
    let slam = ["slam", "data", "--out", "stopped_slam", "--max-gaussians", "60", "--self-calibrate", "off"];
    stop(place.path(), "stopped_slam", &slam);
    other_layouts(place.path());
    estimates(place.path());
    let mesh = mba(place.path(), &["mesh", "mapped", "--out", "mesh.ply", "--voxel-cm", "8"]);
    assert_eq!(mesh.code, Some(0), "{}", mesh.stderr);
    fs::create_dir(at("images")).unwrap();
    fs::copy(at("data/rgb/000000.png"), at("images/000000.png")).unwrap();
    fs::copy(at("data/depth/000001.png"), at("images/000001.png")).unwrap();
    copy(&at("images"), &at("others"));
    recordings(place.path());
    let split = mba(place.path(), &["split", "run", "--dataset", "data", "--out", "job"]);
    assert_eq!(split.code, Some(0), "{}", split.stderr);
    let poses = fs::read_to_string(at("run/trajectory.txt")).unwrap();
    fs::write(at("poses.txt"), poses.lines().take(3).map(|line| format!("{line}\n")).collect::<String>())
        .unwrap();
    place
}

/// Recordings as other programs and cameras write them, and a benchmark of the data set.
fn recordings(folder: &Path) {
    let of_import = Path::new(env!("CARGO_MANIFEST_DIR")).join("../mapper/import/tests/data");
    copy(&of_import, &folder.join("recorded"));
    let benchmark = "title = \"one sequence\"\nof = \"track\"\n[[sequence]]\nname = \"tiny\"\ndataset = \"data\"\n\
         [[published]]\nmethod = \"another\"\nsource = \"its table 1\"\nate_cm = { tiny = 1.5 }\n";
    fs::write(folder.join("bench.toml"), benchmark).unwrap();
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
    let rows = |header: &str, row: &dyn Fn(f64) -> String| -> String {
        format!("{header}\n") + &(0..60).map(|k| row(f64::from(k) / 50.0 - 0.5) + "\n").collect::<String>()
    };
    let named = "timestamp,wx_rad_s,wy_rad_s,wz_rad_s,ax_m_s2,ay_m_s2,az_m_s2";
    fs::write(data.join("imu.csv"), rows(named, &|t| format!("{t:.6},0.1,0.2,-0.1,0.1,-9.8,0.2"))).unwrap();
    fs::create_dir(data.join("imu0")).unwrap();
    let euroc = |t: f64| format!("{},0.1,0.2,-0.1,0.1,-9.8,0.2", (1e9 * t) as i64);
    fs::write(data.join("imu0/data.csv"), rows("#timestamp [ns],rates,forces", &euroc)).unwrap();
    let kinect = rows("# timestamp ax ay az", &|t| format!("{t:.6} 0.1 -9.8 0.2"));
    fs::write(data.join("accelerometer.txt"), kinect).unwrap();
    // One of the frames is a JPEG.
    let image = image::open(data.join("rgb/000002.png")).unwrap().into_rgb8();
    image.save(data.join("rgb/000002.jpg")).unwrap();
    for list in ["rgb.txt", "associations.txt"] {
        let text = fs::read_to_string(data.join(list)).unwrap();
        fs::write(data.join(list), text.replace("rgb/000002.png", "rgb/000002.jpg")).unwrap();
    }
}

/// A run in `out` that was killed after its first checkpoint.
fn stop(folder: &Path, out: &str, words: &[&str]) {
    let checkpoint: PathBuf = folder.join(out).join("checkpoint");
    let mut process = Command::new(env!("CARGO_BIN_EXE_mba-under-test"))
        .args(words)
        .args(["--checkpoint-interval", "0"])
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    while !checkpoint.is_file() {
        assert!(process.try_wait().unwrap().is_none(), "{words:?} ended before there was a checkpoint");
        sleep(Duration::from_millis(2));
    }
    process.kill().unwrap();
    process.wait().unwrap();
}

/// The same recording as Replica and ScanNet have theirs.
fn other_layouts(folder: &Path) {
    let image = |images: &str, k: usize| folder.join(format!("data/{images}/{k:06}.png"));
    let at = |name: &str| folder.join(name);
    for name in ["replica/results", "scannet/color", "scannet/depth", "scannet/pose", "scannet/intrinsic"] {
        fs::create_dir_all(at(name)).unwrap();
    }
    let row = |x: usize| format!("1 0 0 0.{x} 0 1 0 0 0 0 1 0 0 0 0 1");
    let mut trajectory = String::new();
    for k in 0..2 {
        fs::copy(image("rgb", k), at(&format!("replica/results/frame{k:06}.png"))).unwrap();
        fs::copy(image("depth", k), at(&format!("replica/results/depth{k:06}.png"))).unwrap();
        fs::copy(image("rgb", k), at(&format!("scannet/color/{k}.png"))).unwrap();
        fs::copy(image("depth", k), at(&format!("scannet/depth/{k}.png"))).unwrap();
        trajectory += &(row(k) + "\n");
        let matrix = format!("1 0 0 0.{k}\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
        fs::write(at(&format!("scannet/pose/{k}.txt")), matrix).unwrap();
    }
    fs::write(at("replica/traj.txt"), trajectory).unwrap();
    let camera =
        r#"{"camera": {"w": 64, "h": 48, "fx": 60.0, "fy": 60.0, "cx": 31.5, "cy": 23.5, "scale": 5000}}"#;
    fs::write(at("replica/cam_params.json"), camera).unwrap();
    for kind in ["color", "depth"] {
        let matrix = "60 0 31.5 0\n0 60 23.5 0\n0 0 1 0\n0 0 0 1\n";
        fs::write(at(&format!("scannet/intrinsic/intrinsic_{kind}.txt")), matrix).unwrap();
    }
}

/// The run with files of what was found of the camera.
fn estimates(folder: &Path) {
    let at = |name: &str| folder.join(name);
    copy(&at("run"), &at("estimated"));
    let calibration = fs::read_to_string(at("data/calibration.toml")).unwrap();
    let kept = calibration.lines().filter(|line| !line.starts_with("response"));
    let text: String = kept.map(|line| format!("{line}\n")).collect();
    fs::write(at("estimated/calibration_estimated.toml"), text + "estimated = [\"exposure\", \"readout\"]\n")
        .unwrap();
    fs::copy(at("data/exposures.csv"), at("estimated/exposures_estimated.csv")).unwrap();
}
