//! `synth` with a camera as people have it, and what `info` says about it.

use std::ffi::OsStr;
use std::fs;
use std::path::Path;

use serde_json::Value;

use super::{Workplace, mba};

/// Renders a small sequence into the folder `name` of the work place.
fn synth(place: &Workplace, name: &str, options: &[&str]) {
    let out = place.path(name);
    let size = ["--frames", "8", "--size", "64x48", "--blur", "1", "-q"];
    let fixed = ["synth", "--out"].map(OsStr::new).into_iter().chain([out.as_os_str()]);
    let outcome = mba(fixed.chain(size.iter().chain(options).map(OsStr::new)));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
}

fn info(place: &Workplace, name: &str) -> Value {
    mba([Path::new("info"), &place.path(name), Path::new("--json")]).json()
}

fn warnings(info: &Value) -> Vec<&str> {
    info["warnings"].as_array().unwrap().iter().filter_map(Value::as_str).collect()
}

const TELEPHONE: [&str; 10] = [
    "--readout",
    "-0.02",
    "--depth-delay",
    "0.011",
    "--auto-exposure",
    "--vignetting",
    "-0.35,0.05",
    "--imu",
    "--response",
    "linear",
];

#[test]
fn info_tells_what_is_on_record() {
    let place = Workplace::new();
    synth(&place, "known", &TELEPHONE);
    let info = info(&place, "known");
    assert_eq!((&info["readout"], &info["readout_s"]), (&"rolling".into(), &(-0.02).into()));
    assert_eq!(info["response"], "linear");
    assert_eq!(info["vignetting"], serde_json::json!([-0.35, 0.05]));
    assert_eq!(info["exposure_source"], "per frame");
    assert_eq!(info["longest_exposure_s"], 0.018);
    assert!(info["shortest_exposure_s"].as_f64().unwrap() >= 0.007);
    assert!((info["depth_delay_s"].as_f64().unwrap() - 0.011).abs() < 1e-6);
    for sensor in ["gyroscope_hz", "accelerometer_hz"] {
        assert!((info[sensor].as_f64().unwrap() - 200.0).abs() < 0.1, "{info}");
    }
    assert_eq!(info["imu_share_of_frames"], 1.0);
    for fact in ["exposure", "readout", "response", "vignetting", "camera"] {
        assert_eq!(info["sources"][fact], "recorded", "{fact}");
    }
    assert_eq!(info["sources"]["depth_delay"], "assumed", "only the timestamps tell");
    assert_eq!(warnings(&info), [""; 0]);

    let table = mba([Path::new("info"), &place.path("known")]).stdout;
    for expected in [
        "linear (recorded)",
        "1 + -0.35 r^2 + 0.05 r^4, 70 % of the light in the corner (recorded)",
        "rolling, -20.00 ms (recorded)",
        "18.00 ms (per frame)",
        "11.00 ms",
        "gyroscope 200 Hz, accelerometer 200 Hz, covers 100.0 % of the frames",
    ] {
        assert!(table.contains(expected), "no {expected} in\n{table}");
    }
}

#[test]
fn info_tells_what_is_not_on_record() {
    let place = Workplace::new();
    synth(&place, "silent", &[&TELEPHONE[..], &["--nothing-on-record"]].concat());
    let info = info(&place, "silent");
    assert_eq!((&info["readout"], &info["readout_s"]), (&"rolling".into(), &Value::Null));
    for fact in ["exposure", "response", "vignetting"] {
        assert_eq!(info["sources"][fact], "assumed", "{fact}");
    }
    assert_eq!(
        warnings(&info),
        [
            "response is not given, \"srgb\" is assumed",
            "exposure_seconds is not given, 0.0167 s (0.5 of the frame interval) is assumed",
            "rows are exposed one after the other, but readout_seconds does not say in which time",
        ]
    );
    let truth = fs::read_to_string(place.path("silent/truth/calibration.toml")).unwrap();
    assert!(truth.contains("readout_seconds = -0.02\nvignetting = [-0.35, 0.05]\n"), "{truth}");
}

#[test]
fn contradictions_are_named() {
    let place = Workplace::new();
    synth(&place, "odd", &[]);
    let calibration = place.path("odd/calibration.toml");
    let text = fs::read_to_string(&calibration).unwrap();
    let text = text
        .replace("exposure_seconds = 0.016", "exposure_seconds = 0.04")
        .replace("readout = \"global\"", "readout_seconds = 0.05\ndepth_delay_seconds = -0.02");
    fs::write(&calibration, text).unwrap();
    // Degrees per second and units of gravity, until 0.21 s. Rows are exposed from 45 ms before a timestamp until 45 ms
    // after it, and frames are at 0.1, 0.133, 0.167 s and so on: two of eight are covered.
    let row = |k: i32| format!("{},40,0,0,0,-1,0\n", f64::from(k) / 200.0);
    let header = "timestamp,wx_rad_s,wy_rad_s,wz_rad_s,ax_m_s2,ay_m_s2,az_m_s2\n";
    fs::write(place.path("odd/imu.csv"), [header, &(0..43).map(row).collect::<String>()].concat()).unwrap();
    assert_eq!(
        warnings(&info(&place, "odd")),
        [
            "exposure of 0.04 s is longer than the 0.033333 s between frames",
            "readout_seconds of 0.05 s is longer than the 0.033333 s between frames",
            "depth is -0.020000 s from colour, more than half of the 0.033333 s between frames: another depth image is \
             nearer",
            "the gyroscope turns with up to 40.0 rad/s; is it in degrees per second?",
            "the accelerometer feels 1.00 m/s^2 in the median, where gravity alone is 9.81; is it in units of gravity, \
             or without it?",
            "the IMU covers the exposure of only 25.0 % of the frames, or has gaps there",
        ]
    );

    synth(&place, "milliseconds", &[]);
    let list = place.path("milliseconds/associations.txt");
    let line = |k: i32| format!("{0} rgb/{k:06}.png {0} depth/{k:06}.png\n", 32 * k);
    fs::write(&list, (0..8).map(line).collect::<String>()).unwrap();
    let said = "frames are 32.000 s apart, which 30 frames per second are not; timestamps are in seconds, these look like";
    let data = place.path("milliseconds");
    let refused = || mba([OsStr::new("info"), data.as_os_str()]);
    refused().assert_error(2, &["milliseconds: ", said, "like milliseconds"]);
    assert!(
        refused().stderr.contains("hint: divide all times of the data set by 1000, or give the frame_rate")
    );
    // Without a frame rate as well, and in other units.
    place.edit("milliseconds/calibration.toml", "frame_rate = 30.0\n", "");
    refused().assert_error(2, &["milliseconds: ", said, "like milliseconds"]);
    for (unit, factor) in [("microseconds", 1_000), ("nanoseconds", 1_000_000)] {
        let line = |k: i64| format!("{0} rgb/{k:06}.png {0} depth/{k:06}.png\n", 32 * k * factor);
        fs::write(&list, (0..8).map(line).collect::<String>()).unwrap();
        refused().assert_error(2, &["timestamps are in seconds, these look like", unit]);
    }
    // Every hundredth frame of a video is no other unit, nor is what the calibration says.
    let every = |seconds: f64| {
        let line = |k: i32| format!("{0} rgb/{k:06}.png {0} depth/{k:06}.png\n", seconds * f64::from(k));
        fs::write(&list, (0..8).map(line).collect::<String>()).unwrap();
    };
    every(3.3);
    assert_eq!(refused().code, Some(0));
    every(32.0);
    place.edit("milliseconds/calibration.toml", "width", "frame_rate = 0.03\nwidth");
    assert_eq!(refused().code, Some(0));
}

#[test]
fn mishaps_happen_to_the_frames_that_are_named() {
    let place = Workplace::new();
    let mishaps =
        ["--black", "1-2,4", "--saturated", "5", "--jump", "6", "--noise", "off", "--depth", "exact"];
    synth(&place, "mishaps", &mishaps);
    let dataset = mba_mapper::dataset::open(&place.path("mishaps")).unwrap();
    let frames: Vec<_> = (0..8).map(|k| dataset.frame(k).unwrap()).collect();
    let is_filled = |k: usize, value: u8| frames[k].rgb.iter().all(|byte| *byte == value);
    let black: Vec<usize> = (0..8).filter(|k| is_filled(*k, 0)).collect();
    let white: Vec<usize> = (0..8).filter(|k| is_filled(*k, 255)).collect();
    let without_depth: Vec<usize> = (0..8).filter(|k| frames[*k].depth_is_empty()).collect();
    assert_eq!((black, white, without_depth), (vec![1, 2, 4], vec![5], vec![1, 2, 4, 5]));
    // What is seen again is the same up to the rounding of times to microseconds.
    let differing = frames[6].rgb.iter().zip(&frames[0].rgb).filter(|(a, b)| a.abs_diff(**b) > 1).count();
    assert!(differing < frames[0].rgb.len() / 100, "{differing} values differ");
    let truth = dataset.ground_truth();
    let apart = truth[6].world_from_camera.tangent_to(&truth[0].world_from_camera).norm();
    assert!(apart < 1e-5, "{apart}");
}

#[test]
fn info_fails_for_images_that_hold_nothing() {
    let place = Workplace::new();
    synth(&place, "dark", &["--black", "0-7"]);
    synth(&place, "covered", &["--black", "1-2"]);
    let info = |name: &str| mba([Path::new("info"), &place.path(name), Path::new("--json")]);
    let dark = info("dark");
    let reason = "error: nothing here can be tracked: 8 of 8 sampled colour images are black\n";
    assert!(dark.code == Some(1) && dark.stderr.contains(reason), "{:?} {}", dark.code, dark.stderr);
    // What was found out is printed all the same.
    assert_eq!(serde_json::from_str::<serde_json::Value>(&dark.stdout).unwrap()["frames"], 8);
    assert_eq!(info("covered").code, Some(0));
}

#[test]
fn a_response_comes_from_a_file() {
    let place = Workplace::new();
    let file = place.path("curve.csv");
    let curve = place.path("curve.csv").display().to_string();
    // What is stored is the third root of light.
    let rows: String =
        (0..=100).map(|k| format!("{},{}\n", f64::from(k).powi(3) / 1e6, f64::from(k) / 1e2)).collect();
    fs::write(&file, format!("light,value\n{rows}")).unwrap();
    synth(&place, "measured", &["--response", &curve]);
    assert_eq!(info(&place, "measured")["response"], "table");
    let dataset = mba_mapper::dataset::open(&place.path("measured")).unwrap();
    let inverse = dataset.calibration().response.inverse();
    let expected = (128.0_f64 / 255.0).powi(3);
    assert!((f64::from(inverse.linear_light(128)) - expected).abs() < 1e-4);

    fs::write(&file, "light,value\n0,0\n0.5,2\n").unwrap();
    let out = place.path("other");
    let arguments = ["synth", "--response", &curve, "--out"].map(OsStr::new);
    let refused = mba(arguments.into_iter().chain([out.as_os_str()]));
    refused.assert_error(2, &["curve.csv, line 3", "rows light,value"]);
    assert!(!out.exists());
}

#[test]
fn depth_that_is_one_frame_late_is_noticed() {
    let place = Workplace::new();
    let shaken = ["--frames", "24", "--size", "320x240", "--blur", "4", "--seed", "3"];
    let out = place.path("late");
    let arguments = ["synth"].into_iter().chain(shaken).chain(["--out"]).map(OsStr::new);
    assert_eq!(mba(arguments.chain([out.as_os_str()])).code, Some(0));
    let about_depth = |info: &serde_json::Value| -> Vec<String> {
        warnings(info)
            .iter()
            .filter(|warning| warning.starts_with("depth"))
            .map(ToString::to_string)
            .collect()
    };
    assert_eq!(about_depth(&info(&place, "late")), [""; 0]);
    for k in (1..24).rev() {
        let depth = |k: u32| out.join(format!("depth/{k:06}.png"));
        fs::copy(depth(k - 1), depth(k)).unwrap();
    }
    let said = about_depth(&info(&place, "late"));
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(said[0].starts_with("depth comes one frame late: in 16 of 16 sampled frames"), "{said:?}");
    assert!(said[0].ends_with("depth_delay_seconds = -0.0333 into the calibration"), "{said:?}");
    let track = |run: &str| {
        let [data, run] = [place.path("late"), place.path(run)];
        let tracked = mba([
            OsStr::new("track"),
            data.as_os_str(),
            "--out".as_ref(),
            run.as_os_str(),
            "--json".as_ref(),
        ]);
        let ate = tracked.json()["trajectory"]["ate_m"]["rmse"].as_f64().unwrap();
        (tracked.stderr, ate)
    };
    let (warned, wrong) = track("wrong");
    assert!(warned.contains("warning: depth comes one frame late"), "{warned}");
    // What maps at the same time says so, too, at its end.
    let slam = |run: &str, said: &str, is_said: bool| {
        let [data, run] = [place.path("late"), place.path(run)];
        let words = ["slam", "--max-gaussians", "1000", "--json", "--out"].map(OsStr::new);
        let done = mba(words.into_iter().chain([run.as_os_str(), data.as_os_str()]));
        assert_eq!(done.stderr.contains(said), is_said, "{}", done.stderr);
        let warnings = done.json()["warnings"].to_string();
        assert_eq!(warnings.contains(said), is_said, "{warnings}");
    };
    slam("wrong-map", "depth comes one frame late", true);
    place.edit("late/calibration.toml", "width", "depth_delay_seconds = -0.0333\nwidth");
    let (silent, right) = track("right");
    assert!(
        !silent.contains("depth comes") && right < 0.4 * wrong,
        "{silent}: {right} m with, {wrong} m without"
    );
    slam("right-map", "depth comes", false);
}

#[test]
fn small_images_with_holes_in_their_depth_are_tracked_from_the_first_frame() {
    let place = Workplace::new();
    for (scene, seed) in [("room", "1"), ("hall", "5"), ("hall", "8")] {
        let [data, run] = ["data", "run"].map(|name| place.path(&format!("{name}-{scene}-{seed}")));
        let fixed = [
            "synth", "--size", "160x120", "--blur", "2", "--frames", "12", "--scene", scene, "--seed", seed,
            "--out",
        ];
        assert_eq!(mba(fixed.map(OsStr::new).into_iter().chain([data.as_os_str()])).code, Some(0));
        let words = ["track", "--keyframes", "off", "--json", "--out"].map(OsStr::new);
        let tracked = mba(words.into_iter().chain([run.as_os_str(), data.as_os_str()])).json();
        assert_eq!(tracked["frames"]["ok"], 12, "{scene} {seed}: {tracked}");
    }
}
