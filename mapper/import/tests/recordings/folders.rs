//! Folders and files of telephones and benchmarks: every image, time, camera and pose is what the script wrote.

use std::fs;
use std::path::Path;

use mba_import::{ImportError, ImportOptions, Source, import};
use mba_io::dataset::{Response, Shutter};
use mba_tracker::geometry::{Distortion, PinholeCamera, RigidTransform};
use nalgebra::Vector3;

use crate::place::{Brought, bring, colour, data, depth};

const COLOUR: (usize, usize) = (16, 12);
const DEPTH: (usize, usize) = (8, 6);
const CAMERA: PinholeCamera = PinholeCamera { width: 16, height: 12, fx: 14.5, fy: 14.25, cx: 7.5, cy: 5.5 };

fn brought(name: &str) -> Brought {
    bring(&data("folders").join(name), &ImportOptions::default()).unwrap()
}

/// Whether stored files are those of the source, byte for byte.
fn check_copies(brought: &Brought, source: &Path, pairs: &[(&str, &str)]) {
    for (stored, original) in pairs {
        let same = fs::read(brought.folder.join(stored)).unwrap() == fs::read(source.join(original)).unwrap();
        assert!(same, "{stored} {original}");
    }
}

/// Image k is at (k, 2, 3), its x axis is y of the world, and it looks along z.
fn check_poses(brought: &Brought, count: usize) {
    let poses = brought.dataset.ground_truth();
    assert_eq!(poses.len(), count);
    for (k, pose) in poses.iter().enumerate() {
        for (point, expected) in [
            (Vector3::zeros(), [k as f64, 2.0, 3.0]),
            (Vector3::x(), [k as f64, 3.0, 3.0]),
            (Vector3::z(), [k as f64, 2.0, 4.0]),
        ] {
            let seen = pose.world_from_camera.transform_point(&point);
            assert!((seen - Vector3::from(expected)).norm() < 1e-6, "{k}: {seen}");
        }
        assert_eq!(pose.timestamp, brought.dataset.timestamp(k));
    }
}

/// A telephone's camera, its depth of half the size and with a third of it unsure.
fn check_telephone(brought: &Brought) {
    let calibration = brought.dataset.calibration();
    assert_eq!(calibration.readout, Shutter::Rolling { seconds: None });
    assert_eq!((&calibration.response, calibration.depth_camera), (&Response::Srgb, None));
    let frame = brought.dataset.frame(0).unwrap();
    assert_eq!((frame.width, frame.height), COLOUR);
    // Pixel (5, 5) lies at (2.25, 2.25) of depth, next to (2, 2), of which the confidence is 4 % 3 = 1; next to (3, 3), at
    // pixel (7, 7), it is 0. Neighbours without depth forbid interpolation: the nearest counts.
    let nearest = f64::from(depth(0, DEPTH)[2 * 8 + 2]) * calibration.depth_scale / 1000.0;
    assert_eq!((f64::from(frame.depth[5 * 16 + 5]), frame.depth[7 * 16 + 7]), (nearest, 0));
}

#[test]
fn stray_scanner() {
    let (brought, source) = (brought("stray"), data("folders/stray"));
    check_copies(
        &brought,
        &source,
        &[
            ("rgb/000001.jpg", "rgb/000001.jpg"),
            ("depth/000001.png", "depth/000001.png"),
            ("confidence/000000.png", "confidence/000000.png"),
        ],
    );
    assert_eq!(
        brought.lines("rgb.txt"),
        ["25961.116333375 rgb/000000.jpg".to_owned(), "25961.131958375 rgb/000001.jpg".to_owned()]
    );
    assert_eq!(brought.depth("depth/000001.png"), depth(1, DEPTH));
    assert_eq!(brought.dataset.calibration().camera, CAMERA);
    check_poses(&brought, 2);
    check_telephone(&brought);
}

#[test]
fn a_video_gets_one_sentence_with_the_command_that_unpacks_it() {
    let error = bring(&data("folders/stray_video"), &ImportOptions::default()).err().unwrap();
    let ImportError::Unusable { path, reason, hint } = error else { panic!("{error}") };
    assert!(path.ends_with("rgb.mp4"));
    assert_eq!(reason, "colour is a video, which mba does not decode");
    assert!(
        hint.starts_with("mkdir ") && hint.contains("&& ffmpeg -i ") && hint.ends_with("/rgb/%06d.jpg"),
        "{hint}"
    );
}

#[test]
fn polycam() {
    let (brought, source) = (brought("polycam"), data("folders/polycam/keyframes"));
    check_copies(
        &brought,
        &source,
        &[
            ("rgb/000001.jpg", "images/59426145446.jpg"),
            ("confidence/000001.png", "confidence/59426145446.png"),
        ],
    );
    assert_eq!(brought.lines("depth.txt")[1], "59426.145446000 depth/000001.png");
    // Of 14.5 and 15.5 px the second is taken, and a note says so.
    assert_eq!(brought.dataset.calibration().camera.fx, 15.5);
    assert!(brought.imported.notes[0].contains("from 14.50 to 15.50 px"), "{:?}", brought.imported.notes);
    check_poses(&brought, 2);
    check_telephone(&brought);
}

#[test]
fn scanner_app() {
    let brought = brought("scanner_app");
    assert_eq!((brought.imported.colour_images, brought.imported.depth_images), (2, 2));
    assert_eq!(brought.lines("exposures.csv")[2], "172.265625000,0.008333333333333333");
    assert_eq!(brought.dataset.exposure_seconds(0), 1.0 / 120.0);
    assert_eq!(brought.dataset.calibration().camera, CAMERA);
    assert_eq!(brought.imported.notes, ["frames without a colour or a depth image are left out"]);
    check_poses(&brought, 2);
    check_telephone(&brought);
}

#[test]
fn record3d_packed_and_unpacked() {
    let packed = brought("recording.r3d");
    let folder = tempfile::tempdir().unwrap();
    let mut archive = zip::ZipArchive::new(fs::File::open(data("folders/recording.r3d")).unwrap()).unwrap();
    archive.extract(folder.path()).unwrap();
    let unpacked = bring(folder.path(), &ImportOptions::default()).unwrap();
    for brought in [packed, unpacked] {
        assert_eq!(brought.lines("rgb.txt")[1], "1045.640625000 rgb/000001.jpg");
        let mut expected: Vec<u16> = depth(1, DEPTH).iter().map(|raw| 5 * raw).collect();
        // Not a number.
        expected[0] = 0;
        assert_eq!(brought.depth("depth/000001.png"), expected);
        assert_eq!(brought.dataset.calibration().camera, CAMERA);
        check_poses(&brought, 2);
        check_telephone(&brought);
    }
}

#[test]
fn transforms_of_nerfstudio() {
    let (brought, source) = (brought("transforms"), data("folders/transforms"));
    check_copies(&brought, &source, &[("mask/000001.png", "masks/frame_00001.png")]);
    assert_eq!(brought.rgb("rgb/000001.png"), colour(1, COLOUR));
    assert_eq!(brought.depth("depth/000001.png"), depth(1, COLOUR));
    // The centre of the first pixel is (0.5, 0.5) there.
    assert_eq!(brought.dataset.calibration().camera, CAMERA);
    let lens = Distortion { k1: 0.01, p2: 0.001, ..Distortion::default() };
    assert_eq!(brought.dataset.calibration().distortion, lens);
    let frame = brought.dataset.frame(0).unwrap();
    assert_eq!((frame.depth[3 * 16 + 8], frame.depth[6 * 16 + 8] > 0), (0, true), "row 3 is masked");
    check_poses(&brought, 2);
}

#[test]
fn seven_scenes() {
    let (brought, source) = (brought("seven_scenes"), data("folders/seven_scenes"));
    check_copies(&brought, &source, &[("rgb/000001.png", "frame-000001.color.png")]);
    let calibration = brought.dataset.calibration();
    assert_eq!((calibration.camera.fx, calibration.depth_camera.unwrap().camera.fx), (525.0, 585.0));
    assert_eq!(calibration.depth_scale, 1000.0);
    // 65535 is a hole.
    let frame = brought.dataset.frame(0).unwrap();
    assert!(frame.depth.iter().all(|raw| *raw < 2000) && frame.depth.iter().any(|raw| *raw >= 1000));
    // The pose is that of the depth camera, 26 mm beside, which is along y of the world; the other is infinite.
    let poses = brought.dataset.ground_truth();
    assert_eq!(poses.len(), 1);
    let place = poses[0].world_from_camera.translation;
    assert!((place - Vector3::new(0.0, 2.026, 3.0)).norm() < 1e-3, "{place}");
}

#[test]
fn bundle_fusion_and_files_of_its_recorder() {
    for (name, is_exact) in [("bundle_fusion", false), ("scene.sens", true)] {
        let brought = brought(name);
        let calibration = brought.dataset.calibration();
        let own = calibration.depth_camera.unwrap();
        assert_eq!((calibration.camera, calibration.depth_scale), (CAMERA, 1000.0));
        let expected = PinholeCamera { width: 8, height: 6, fx: 7.125, fy: 7.25, cx: 3.5, cy: 2.5 };
        assert_eq!((own.camera, own.colour_from_depth), (expected, RigidTransform::identity()));
        let holes = if is_exact { 0 } else { 3 };
        assert_eq!(brought.depth("depth/000001.png")[holes..], depth(1, DEPTH)[holes..]);
        check_poses(&brought, 2);
        if is_exact {
            assert_eq!(brought.lines("rgb.txt")[1], "5.033456000 rgb/000001.jpg");
            assert_eq!(brought.lines("depth.txt")[1], "5.033458000 depth/000001.png");
        }
    }
}

#[test]
fn open3d() {
    let (brought, source) = (brought("open3d"), data("folders/open3d"));
    check_copies(
        &brought,
        &source,
        &[("rgb/000001.jpg", "color/000001.jpg"), ("depth/000001.png", "depth/000001.png")],
    );
    let calibration = brought.dataset.calibration();
    assert_eq!((calibration.camera, calibration.depth_camera), (CAMERA, None));
    assert_eq!(brought.dataset.frame(1).unwrap().depth, depth(1, COLOUR));
}

#[test]
fn icl_nuim() {
    let brought = brought("icl_nuim");
    assert_eq!(brought.lines("rgb.txt")[1], "0.033333333 rgb/000001.png");
    assert_eq!(brought.dataset.calibration().camera.fy, 480.0);
    assert_eq!(brought.dataset.frame(1).unwrap().depth[..8], depth(1, DEPTH)[..8]);
    // Both mirrored back.
    check_poses(&brought, 2);
}

#[test]
fn sequences_of_mba_vo() {
    let brought = brought("mba_vo");
    assert_eq!(brought.lines("rgb.txt")[1], "0.286900000 rgb/000001.png");
    let calibration = brought.dataset.calibration();
    assert_eq!((calibration.camera.fx, calibration.camera.cy), (7.0, 2.5));
    assert_eq!((brought.dataset.exposure_seconds(1), calibration.readout), (0.0156288, Shutter::Global));
    check_copies(&brought, &data("folders/mba_vo"), &[("rgb/000001.png", "rgb_blur/0008.png")]);
    // Along the axis and in fifths of a millimetre; the sky has none.
    for k in 0..2 {
        let mut expected: Vec<u16> = depth(k, DEPTH).iter().map(|millimetres| 5 * millimetres).collect();
        expected[0] = 0;
        assert_eq!(brought.depth(&format!("depth/00000{k}.png")), expected);
    }
    // Poses are those of the camera.
    check_poses(&brought, 2);
    // A JPEG of the same picture: near it, as a PNG file of its name.
    let (sharp, blurred) = (brought.rgb("sharp/000001.png"), brought.rgb("rgb/000001.png"));
    let difference: f64 = sharp.iter().zip(&blurred).map(|(a, b)| f64::from(a.abs_diff(*b))).sum();
    assert!(difference / (sharp.len() as f64) < 12.0, "{difference}");
    assert!(brought.imported.notes.is_empty(), "{:?}", brought.imported.notes);
}

#[test]
fn what_sequences_of_mba_vo_lack_is_assumed_or_named() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("source");
    for name in ["", "rgb_blur", "depth_sharp_middle"] {
        fs::create_dir(source.join(name)).unwrap();
        for file in fs::read_dir(data("folders/mba_vo").join(name)).unwrap() {
            let path = file.unwrap().path();
            if path.is_file() {
                fs::copy(&path, source.join(name).join(path.file_name().unwrap())).unwrap();
            }
        }
    }
    // Without a list of times, images come as often as the configuration says.
    fs::remove_file(source.join("im_list.txt")).unwrap();
    let brought = bring(&source, &ImportOptions::default()).unwrap();
    assert_eq!(brought.lines("rgb.txt")[0], "0.258300000 rgb/000000.png");
    assert!(
        brought.imported.notes[0].contains("one every 0.0369 s is assumed"),
        "{:?}",
        brought.imported.notes
    );
    let error = |source: &Path| bring(source, &ImportOptions::default()).err().unwrap().to_string();
    fs::write(source.join("depth_sharp_middle/0008.depth"), "1 2 3").unwrap();
    assert!(
        error(&source).ends_with("0008.depth cannot be read: it has 3 numbers, not 8 x 6"),
        "{}",
        error(&source)
    );
    fs::write(source.join("im_list.txt"), "0007 0.25 0.3\n").unwrap();
    assert!(error(&source).contains("im_list.txt, line 1"), "{}", error(&source));
}

#[test]
fn a_data_set_is_not_written_into_its_source() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("source");
    fs::create_dir(&source).unwrap();
    for file in fs::read_dir(data("folders/bundle_fusion")).unwrap() {
        let path = file.unwrap().path();
        fs::copy(&path, source.join(path.file_name().unwrap())).unwrap();
    }
    let recognised = Source::recognise(&source).unwrap();
    let into = |out: &Path| import(&recognised, out, &ImportOptions::default(), &|_, _| ()).err();
    assert!(matches!(into(&source.join("data")), Some(ImportError::Output(_))));
    // What is there already stays.
    fs::write(folder.path().join("mine.txt"), "mine").unwrap();
    assert!(matches!(into(folder.path()), Some(ImportError::Output(_))));
    assert!(into(&folder.path().join("new")).is_none());
    // One frame of another size: nothing is left.
    fs::copy(source.join("frame-000000.depth.png"), source.join("frame-000001.color.jpg")).unwrap();
    let error = into(&folder.path().join("other")).unwrap().to_string();
    assert!(
        error.contains("frame-000001.color.jpg: an image has 8 x 6 pixels, those before have 16 x 12"),
        "{error}"
    );
    assert!(!folder.path().join("other").exists());
}
