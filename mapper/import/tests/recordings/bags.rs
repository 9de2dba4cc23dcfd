//! Bags of ROS 1 and MCAP files: every image, time, camera and sample is what the script wrote.

use std::fs;

use mba_import::{ImportError, ImportOptions, Source};
use mba_io::dataset::Shutter;
use mba_tracker::geometry::{Distortion, PinholeCamera};
use nalgebra::Vector3;

use crate::place::{Brought, bring, colour, data, depth};

const COLOUR: (usize, usize) = (16, 12);
const DEPTH: (usize, usize) = (8, 6);

fn brought(name: &str) -> Brought {
    bring(&data(name), &ImportOptions::default()).unwrap()
}

/// What `recording` of the script holds besides the pixels of colour.
fn check_recording(brought: &Brought, ending: &str) {
    let images = |kind: &str, nanoseconds: usize, ending: &str| -> Vec<String> {
        let line = |k: usize| {
            let time = 123_456_789 + 33_333_333 * k + nanoseconds;
            format!("1700000000.{time:09} {kind}/{k:06}.{ending}")
        };
        (0..3).map(line).collect()
    };
    assert_eq!(brought.lines("rgb.txt"), images("rgb", 0, ending));
    assert_eq!(brought.lines("depth.txt"), images("depth", 11, "png"));
    for k in 0..3 {
        assert_eq!(brought.depth(&format!("depth/{k:06}.png")), depth(k, DEPTH));
    }
    let calibration = brought.dataset.calibration();
    let expected = PinholeCamera { width: 16, height: 12, fx: 14.5, fy: 14.25, cx: 7.5, cy: 5.5 };
    assert_eq!(calibration.camera, expected);
    let lens = Distortion { k1: 0.1, k2: -0.05, p1: 0.001, p2: -0.002, k3: 0.01 };
    assert_eq!((calibration.distortion, calibration.depth_scale), (lens, 1000.0));
    assert_eq!(calibration.readout, Shutter::Global);
    let own = calibration.depth_camera.unwrap();
    let expected = PinholeCamera { width: 8, height: 6, fx: 7.125, fy: 7.25, cx: 3.5, cy: 2.5 };
    assert_eq!((own.camera, own.distortion), (expected, Distortion::default()));
    // The depth camera is at -0.035 m of the link, that of colour at 0.015.
    assert!((own.colour_from_depth.translation - Vector3::new(-0.05, 0.0, 0.0)).norm() < 1e-15);
    // The IMU is turned by a quarter about z: x of the camera is -y of the IMU.
    let turned = calibration.imu_from_camera.unwrap() * Vector3::x();
    assert!((turned + Vector3::y()).norm() < 1e-15, "{turned}");

    assert_eq!(brought.imported.inertial_samples, [12, 12]);
    let samples = brought.lines("imu.csv");
    assert_eq!(samples[0], "timestamp,wx_rad_s,wy_rad_s,wz_rad_s,ax_m_s2,ay_m_s2,az_m_s2");
    // The third sample of the second image, 10 ms after it.
    assert_eq!(samples[7], "1700000000.166790122,0.2,1,-0.25,0.5,-9.75,2");
    assert_eq!(brought.dataset.len(), 3);
}

#[test]
fn raw_images_of_both_versions_of_ros_come_out_to_the_bit() {
    for name in ["zstd.mcap", "none.bag"] {
        let brought = brought(name);
        check_recording(&brought, "png");
        for k in 0..3 {
            assert_eq!(brought.rgb(&format!("rgb/{k:06}.png")), colour(k, COLOUR), "{name}");
        }
        let note = "colour is from /camera/color/image_raw, depth from /camera/depth/image_rect_raw";
        assert_eq!(brought.imported.notes, [note]);
    }
}

#[test]
fn compressed_images_are_the_files_that_messages_hold() {
    for name in ["lz4.mcap", "bz2.bag"] {
        let brought = brought(name);
        check_recording(&brought, "jpg");
        for k in 0..3 {
            let (found, written) = (brought.rgb(&format!("rgb/{k:06}.jpg")), colour(k, COLOUR));
            let error: usize = found.iter().zip(&written).map(|(a, b)| usize::from(a.abs_diff(*b))).sum();
            assert!(error < 6 * written.len(), "{name}: mean error {error} of {}", written.len());
        }
    }
}

#[test]
fn a_bag_of_realsense_viewer_has_exposures_units_and_places() {
    let brought = brought("lz4.bag");
    for k in 0..3 {
        assert_eq!(brought.rgb(&format!("rgb/{k:06}.png")), colour(k, COLOUR));
        assert_eq!(brought.depth(&format!("depth/{k:06}.png")), depth(k, DEPTH));
    }
    assert_eq!(
        brought.lines("exposures.csv")[1..],
        ["1700000000.123456789,0.008333", "1700000000.156790122,0.008334", "1700000000.190123455,0.008335"]
    );
    assert_eq!(brought.dataset.exposure_seconds(1), 0.008334);
    let calibration = brought.dataset.calibration();
    assert_eq!(calibration.depth_scale, 10_000.0);
    let own = calibration.depth_camera.unwrap();
    assert!((own.colour_from_depth.translation - Vector3::new(0.015, 0.001, 0.0)).norm() < 1e-15);
    assert_eq!(own.distortion, Distortion::default());
    // The inverse model with k1 = -0.055 is about the other one with 0.055.
    assert!((calibration.distortion.k1 - 0.055).abs() < 0.01, "{:?}", calibration.distortion);
    // A quarter turn about y takes x of the camera to -z of the IMU.
    let turned = calibration.imu_from_camera.unwrap() * Vector3::x();
    assert!((turned + Vector3::z()).norm() < 1e-6, "{turned}");
    // Each sensor at its own times: the second of the first image.
    assert_eq!(brought.lines("gyro.csv")[2], "1700000000.125956789,0.5,0,1");
    assert_eq!(brought.lines("imu.csv")[2], "1700000000.125956796,0.25,-9.5,0");
}

#[test]
fn every_form_of_image_is_read() {
    let options = |colour: &str, depth: &str| ImportOptions {
        colour_topic: Some(colour.to_owned()),
        depth_topic: Some(depth.to_owned()),
    };
    let brought = |colour: &str, depth: &str| bring(&data("plain.mcap"), &options(colour, depth)).unwrap();
    let metres = brought("/rgb/image_raw", "/metres/depth/image");
    assert_eq!(metres.dataset.calibration().depth_scale, 5000.0);
    // 0.2 mm each; what is no number, zero or 20 m away is missing.
    let expected: Vec<u16> = depth(1, DEPTH).iter().map(|raw| 5 * raw).collect();
    assert_eq!(metres.depth("depth/000001.png")[3..], expected[3..]);
    assert_eq!(metres.depth("depth/000001.png")[..3], [0; 3]);
    let note = "3 pixels of depth are farther than 16 bits reach, and are holes";
    assert_eq!(metres.imported.notes.last().map(String::as_str), Some(note));
    // Grey is red, green and blue.
    assert_eq!(metres.rgb("rgb/000002.png")[3..6], [12, 12, 12]);

    let swapped = brought("/rgb/image_png/compressed", "/swapped/depth/image");
    assert_eq!(swapped.depth("depth/000002.png"), depth(2, DEPTH));
    let expected: Vec<u8> = (0..6).flat_map(|row| colour(0, COLOUR)[48 * row..][..24].to_vec()).collect();
    assert_eq!(swapped.rgb("rgb/000000.png"), expected);

    let inverse = brought("/rgb/image_raw", "/inverse/depth/compressedDepth");
    let found = inverse.depth("depth/000000.png");
    assert_eq!(found[0], 0, "code 0 is missing");
    // Codes near 60000 are 1/60000 of their depth apart.
    for (found, raw) in found.iter().zip(depth(0, DEPTH)).skip(3) {
        assert!(found.abs_diff(5 * raw) <= 1, "{found} {raw}");
    }
}

#[test]
fn what_is_missing_or_unknown_is_named() {
    let options = ImportOptions { colour_topic: Some("/none".to_owned()), depth_topic: None };
    let error = bring(&data("none.bag"), &options).err().unwrap();
    assert!(
        error.to_string().ends_with(
            "none.bag: it has no images on the topic /none; its images are /camera/color/image_raw, \
             /camera/depth/image_rect_raw"
        ),
        "{error}"
    );
    let error = Source::recognise(&data("make_bags.py")).unwrap_err();
    assert!(matches!(error, ImportError::Unknown { .. }));
    let message = error.to_string();
    for looked_for in ["rgb.txt and depth.txt", "an .mcap file (ROS 2 and others)", "a .bag file"] {
        assert!(message.contains(looked_for), "{message}");
    }
}

#[test]
fn a_folder_of_ros_2_has_one_file_of_messages() {
    let folder = tempfile::tempdir().unwrap();
    let recognise = || Source::recognise(folder.path());
    fs::write(folder.path().join("metadata.yaml"), "rosbag2_bagfile_information:\n").unwrap();
    fs::write(folder.path().join("walk_0.db3"), "").unwrap();
    let message = recognise().unwrap_err().to_string();
    assert!(message.ends_with("it is a recording in the form sqlite3, which is not read"), "{message}");
    fs::copy(data("zstd.mcap"), folder.path().join("walk_0.mcap")).unwrap();
    assert_eq!(recognise().unwrap().kind(), "ROS 2 and others");
    fs::copy(data("zstd.mcap"), folder.path().join("walk_1.mcap")).unwrap();
    let message = recognise().unwrap_err().to_string();
    assert!(message.ends_with("it is a recording of 2 files"), "{message}");
}
