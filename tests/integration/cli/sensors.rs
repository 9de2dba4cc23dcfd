//! What gravity tells of the world, and recordings that contradict what is on record about their sensors.

use std::ffi::OsStr;
use std::fs;

use mba_mapper::evaluation::{Match, associate};
use mba_mapper::trajectory_file::{TimedPose, read_trajectory};
use nalgebra::Vector3;
use serde_json::Value;

use super::{Workplace, mba};

/// Renders a shaken recording with an IMU into `shaken`.
fn shaken(place: &Workplace) {
    let out = place.path("shaken");
    let size = ["--frames", "40", "--size", "160x120", "--blur", "4", "--imu", "-q"];
    let fixed = ["synth", "--out"].map(OsStr::new).into_iter().chain([out.as_os_str()]);
    let outcome = mba(fixed.chain(size.iter().map(OsStr::new)));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
}

fn run(place: &Workplace, command: &str, name: &str, options: &[&str]) -> Value {
    let (data, out) = (place.path("shaken"), place.path(name));
    let fixed = [OsStr::new(command), data.as_os_str(), OsStr::new("--out"), out.as_os_str()];
    mba(fixed.into_iter().chain(options.iter().map(OsStr::new)).chain([OsStr::new("--json")])).json()
}

fn warnings(summary: &Value) -> Vec<&str> {
    summary["warnings"].as_array().unwrap().iter().filter_map(Value::as_str).collect()
}

/// Largest angle in degrees between up as a run and as the truth has it, in the axes of the camera.
fn tilt(place: &Workplace, name: &str) -> f64 {
    let poses = |path: &str| read_trajectory(&place.path(path)).unwrap();
    let (estimate, truth) = (poses(&format!("{name}/trajectory.txt")), poses("shaken/groundtruth.txt"));
    let times = |poses: &[TimedPose]| poses.iter().map(|pose| pose.timestamp).collect::<Vec<_>>();
    let angle = |pair: Match| {
        let up = estimate[pair.reference].world_from_camera.rotation.inverse() * Vector3::z();
        // Up is y in the world of the generator.
        up.angle(&(truth[pair.estimate].world_from_camera.rotation.inverse() * Vector3::y())).to_degrees()
    };
    let pairs = associate(&times(&estimate), &times(&truth), 0.001);
    assert_eq!(pairs.len(), 40);
    pairs.into_iter().map(angle).fold(0.0, f64::max)
}

#[test]
fn the_world_stands_upright_where_gravity_or_somebody_says_where_up_is() {
    let place = Workplace::new();
    shaken(&place);
    let tracked = run(&place, "track", "run", &[]);
    assert_eq!(tracked["upright"]["source"], "accelerometer");
    assert!(tracked["upright"]["sigma_degrees"].as_f64().unwrap() < 2.0, "{}", tracked["upright"]);
    let tilted = tilt(&place, "run");
    assert!(tilted < 2.0, "{tilted} degrees");
    let first = read_trajectory(&place.path("run/trajectory.txt")).unwrap()[0].world_from_camera;
    assert!(first.translation.norm() < 1e-9, "the first camera is the origin");
    let ahead = first.rotation * Vector3::z();
    assert!(ahead.y.abs() < 1e-6 && ahead.x > 0.0, "x is ahead: {ahead}");

    let slam = run(&place, "slam", "slam", &["--time-budget", "1"]);
    assert_eq!(slam["upright"]["source"], "accelerometer");
    let tilted = tilt(&place, "slam");
    assert!(tilted < 2.5, "{tilted} degrees");

    let given = run(&place, "track", "given", &["--up", "-y"]);
    assert_eq!(given["upright"], serde_json::json!({"source": "given", "sigma_degrees": null}));
    let first = read_trajectory(&place.path("given/trajectory.txt")).unwrap()[0].world_from_camera;
    assert!((first.rotation * -Vector3::y() - Vector3::z()).norm() < 1e-6, "exactly as given");

    fs::remove_file(place.path("shaken/imu.csv")).unwrap();
    let silent = run(&place, "track", "silent", &[]);
    assert_eq!(silent["upright"], Value::Null);
    let outcome = mba(["track", "data", "--out", "run", "--up", "w"]);
    assert_eq!(outcome.code, Some(2));
    assert!(outcome.stderr.contains("one of x, -x, y, -y, z, -z is needed"), "{}", outcome.stderr);
}

#[test]
fn exposure_times_that_the_motion_contradicts_are_named() {
    let place = Workplace::new();
    shaken(&place);
    fs::remove_file(place.path("shaken/imu.csv")).unwrap();
    let right = run(&place, "track", "right", &[]);
    assert_eq!(warnings(&right), [""; 0]);
    // A map that takes every frame for sharp says nothing about exposures.
    let tracked = place.path("right").display().to_string();
    let options = ["--trajectory", &tracked, "--blur", "off", "--time-budget", "1"];
    assert_eq!(warnings(&run(&place, "map", "sharp", &options)), [""; 0]);
    place.edit("shaken/calibration.toml", "exposure_seconds = 0.016", "exposure_seconds = 0.008");
    let wrong = run(&place, "track", "wrong", &[]);
    let [said] = warnings(&wrong)[..] else { panic!("{:?}", warnings(&wrong)) };
    assert!(said.starts_with("the motion within exposures is that of 1"), "{said}");
    assert!(said.contains(" where 8.0 ms are on record"), "{said}");
    let info = mba([OsStr::new("info"), place.path("shaken").as_os_str(), OsStr::new("--json")]).json();
    assert!(warnings(&info).iter().any(|said| said.contains("where 8.0 ms are on record")), "{info}");
}

#[test]
fn a_gyroscope_with_other_axes_is_named_and_left_out() {
    let place = Workplace::new();
    shaken(&place);
    let info = || mba([OsStr::new("info"), place.path("shaken").as_os_str(), OsStr::new("--json")]).json();
    assert_eq!(warnings(&info()), [""; 0]);
    // A quarter turn about the line of sight, as of a telephone that was held upright.
    let calibration = place.path("shaken/calibration.toml");
    let text = fs::read_to_string(&calibration).unwrap();
    let key = "imu_from_camera = [0, 1, 0, -1, 0, 0, 0, 0, 1]\n";
    let keys: String =
        text.lines().filter(|line| !line.starts_with("imu_from_camera")).map(|l| format!("{l}\n")).collect();
    fs::write(&calibration, [key, &keys].concat()).unwrap();
    let said = "the gyroscope does not turn as the camera does; it would with axes 90 degrees from those that \
                imu_from_camera says";
    assert!(warnings(&info()).contains(&said), "{:?}", warnings(&info()));
    let tracked = run(&place, "track", "run", &[]);
    assert_eq!(warnings(&tracked), [format!("{said}; the IMU is left out")]);
    assert_eq!(tracked["frames"]["ok"], 40);
    assert_eq!(tracked["upright"], Value::Null, "its accelerometer has the same axes");
}

#[test]
fn a_measured_length_tells_the_depth_scale() {
    let place = Workplace::new();
    shaken(&place);
    fs::remove_file(place.path("shaken/imu.csv")).unwrap();
    let truth = read_trajectory(&place.path("shaken/groundtruth.txt")).unwrap();
    let place_of = |k: usize| truth[k].world_from_camera.translation;
    let farthest = (1..truth.len())
        .max_by(|a, b| (place_of(*a) - place_of(0)).norm().total_cmp(&(place_of(*b) - place_of(0)).norm()));
    let (to, metres) = (farthest.unwrap(), (place_of(farthest.unwrap()) - place_of(0)).norm());
    place.edit("shaken/calibration.toml", "depth_scale = 5000.0", "depth_scale = 5400.0");
    let data = place.path("shaken");
    let calibrate = |distance: String| {
        let arguments = ["calibrate", "--json", "--distance", &distance].map(OsStr::new);
        mba(arguments.into_iter().chain([data.as_os_str()]))
    };
    let found = calibrate(format!("0:{to}={metres}")).json();
    let finding = found["findings"].as_array().unwrap().iter().find(|found| found["fact"] == "depth_scale");
    let (value, sigma) =
        (finding.unwrap()["value"].as_f64().unwrap(), finding.unwrap()["sigma"].as_f64().unwrap());
    assert!((value - 5000.0).abs() < 3.0 * sigma && sigma < 150.0, "{value} +- {sigma}");
    calibrate("0:99=1".to_owned()).assert_error(2, &["--distance names frame 99, but there are 40"]);
    calibrate("3:3=1".to_owned()).assert_error(2, &["frames 3 and 3 were tracked 0.000 m apart"]);
}
