//! What is read from Replica and ScanNet folders.

use std::fs;

use image::{ImageBuffer, Luma};
use mba_mapper::dataset::{ExposureSource, Response};
use nalgebra::Vector3;

use crate::folder::{Folder, HEIGHT, WIDTH, colour_image};

const CAMERA: &str = "{\n \"camera\": {\n  \"w\": 8, \"h\": 6,\n  \"fx\": 7.0, \"fy\": 7.5,\n  \
    \"cx\": 3.5, \"cy\": 2.5,\n  \"scale\": 6553.5\n }\n}\n";

/// A quarter turn about z, then a shift: camera x is world y.
const MATRIX: &str = "0 -1 0 1\n1 0 0 2\n0 0 1 3\n0 0 0 1\n";

fn replica() -> Folder {
    let folder = Folder::named("office0");
    fs::create_dir(folder.path.join("results")).unwrap();
    for k in [0, 1, 10] {
        folder.colour(&format!("results/frame{k:06}.png"));
        folder.depth(&format!("results/depth{k:06}.png"), 100 + k);
    }
    folder.write("traj.txt", &format!("{}\n", MATRIX.replace('\n', " ")).repeat(2));
    folder.write("../cam_params.json", CAMERA);
    folder
}

fn scannet() -> Folder {
    let folder = Folder::named("scene0000_00");
    for name in ["color", "pose", "intrinsic"] {
        fs::create_dir(folder.path.join(name)).unwrap();
    }
    for k in [2, 9, 10] {
        // Twice the size of the depth images.
        colour_image(2 * WIDTH, 2 * HEIGHT).save(folder.path.join(format!("color/{k}.png"))).unwrap();
        folder.depth(&format!("depth/{k}.png"), 100 * k);
        folder.write(&format!("pose/{k}.txt"), MATRIX);
    }
    let intrinsics = |f: f64, cx: f64, cy: f64| format!("{f} 0 {cx} 0\n0 {f} {cy} 0\n0 0 1 0\n0 0 0 1\n");
    folder.write("intrinsic/intrinsic_depth.txt", &intrinsics(7.0, 3.5, 2.5));
    folder.write("intrinsic/intrinsic_color.txt", &intrinsics(14.0, 7.5, 5.5));
    folder
}

#[test]
fn replica_is_read_with_camera_and_poses() {
    let folder = replica();
    let dataset = folder.open();
    assert_eq!((dataset.len(), dataset.timestamp(2)), (3, 10.0 / 30.0));
    let calibration = dataset.calibration();
    assert_eq!((calibration.camera.fy, calibration.camera.width), (7.5, 8));
    assert_eq!((calibration.depth_scale, &calibration.response), (6553.5, &Response::Srgb));
    assert_eq!(dataset.frame(2).unwrap().depth[0], 110);

    assert_eq!(dataset.ground_truth().len(), 2);
    let image = dataset.ground_truth()[1].world_from_camera.transform_point(&Vector3::x());
    assert!((image - Vector3::new(1.0, 3.0, 3.0)).norm() < 1e-12, "{image}");
    assert_eq!(folder.warnings()[0], "the time of each frame is not given, image number / 30 is assumed");
    assert_eq!(folder.warnings()[1], "1 frames have no valid recorded pose, first results/frame000010.png");
}

#[test]
fn replica_messages_name_file_line_and_value() {
    let folder = replica();
    folder.edit("traj.txt", "0 -1", "0 -1.1");
    assert_eq!(
        folder.message(),
        "traj.txt, line 1: the 3x3 block is not a rotation (R R^T differs from I by 0.2100)"
    );
    folder.edit("traj.txt", "0 -1.1", "0 1");
    assert!(folder.message().ends_with("differs from I by inf)"), "{}", folder.message());
    folder.edit("traj.txt", "0 1", "1");
    assert!(folder.message().starts_with("traj.txt, line 1: expected the 16 numbers of a 4x4"));

    let folder = replica();
    folder.write("cam_params.json", &CAMERA.replace("6553.5", "0"));
    assert_eq!(
        folder.message(),
        "cam_params.json, line 6: scale = 0, expected a positive number of raw units per metre, above 1 and at most 1000000 (millimetres are 1000)"
    );
    folder.write("cam_params.json", &CAMERA.replace("\"fx\"", "\"f\""));
    assert_eq!(folder.message(), "cam_params.json, line 7: missing field `fx`");
    fs::remove_file(folder.path.join("cam_params.json")).unwrap();
    fs::remove_file(folder.path.join("../cam_params.json")).unwrap();
    assert!(folder.message().contains("cam_params.json: "), "{}", folder.message());
}

#[test]
fn replica_takes_its_own_calibration_first() {
    let folder = replica();
    folder.write(
        "calibration.toml",
        "width = 8\nheight = 6\nfx = 9\nfy = 9\ncx = 3.5\ncy = 2.5\ndepth_scale = 1000\n\
         exposure_seconds = 0.01\nframe_rate = 20\nresponse = \"linear\"\nreadout = \"global\"\n",
    );
    let dataset = folder.open();
    assert_eq!((dataset.calibration().camera.fx, dataset.timestamp(1)), (9.0, 0.05));
    assert_eq!(dataset.calibration().exposure, ExposureSource::Constant { seconds: 0.01 });
}

#[test]
fn scannet_colour_is_brought_to_the_depth_camera() {
    let folder = scannet();
    let dataset = folder.open();
    assert_eq!((dataset.len(), dataset.timestamp(0)), (3, 2.0 / 30.0));
    assert_eq!(dataset.calibration().depth_scale, 1000.0);
    let frame = dataset.frame(1).unwrap();
    assert_eq!((frame.width, frame.height, frame.depth[0]), (8, 6, 900));
    // The centre of pixel (3, 2) is (6.5, 4.5) in the colour image.
    assert_eq!(frame.rgb[3 * (8 * 2 + 3)..][..3], [65, 90, 200]);
    assert_eq!(dataset.ground_truth().len(), 3);
    assert_eq!(dataset.ground_truth()[2].world_from_camera.translation, Vector3::new(1.0, 2.0, 3.0));
}

#[test]
fn scannet_frames_without_pose_or_partner_are_reported() {
    let folder = scannet();
    folder.write("pose/9.txt", &"-inf -inf -inf -inf\n".repeat(4));
    fs::remove_file(folder.path.join("pose/10.txt")).unwrap();
    folder.depth("depth/11.png", 1);
    let dataset = folder.open();
    assert_eq!((dataset.len(), dataset.ground_truth().len()), (3, 1));
    let warnings = folder.warnings();
    for expected in [
        "depth: 1 images have no partner of the same number and are left out, first depth/11.png",
        "2 frames have no valid recorded pose, first pose/9.txt",
    ] {
        assert!(warnings.iter().any(|warning| warning == expected), "{warnings:?}");
    }
    folder.edit("intrinsic/intrinsic_color.txt", "5.5", "nan");
    assert_eq!(folder.message(), "intrinsic/intrinsic_color.txt, line 2: nan is not a finite number");
    folder.edit("intrinsic/intrinsic_color.txt", "0 14 nan", "0 -14 5.5");
    assert!(
        folder.message().starts_with("intrinsic/intrinsic_color.txt, line 2: fy = -14, expected a focal")
    );
    folder.write("intrinsic/intrinsic_depth.txt", "1 0 0 0\n");
    assert!(folder.message().starts_with("intrinsic/intrinsic_color.txt"), "the first bad file is named");

    ImageBuffer::from_pixel(3, 3, Luma([1_u16])).save(folder.path.join("depth/10.png")).unwrap();
    folder.edit("intrinsic/intrinsic_color.txt", "-14", "14");
    assert!(
        folder.message().starts_with("intrinsic/intrinsic_depth.txt, line 1: expected four lines of four")
    );
}

#[test]
fn bonn_is_known_and_eth3d_brings_its_camera() {
    let folder = Folder::named("rgbd_bonn_crowd");
    let list = |kind: &str| format!("1548266470.88 {kind}/0.png\n1548266470.91 {kind}/1.png\n");
    folder.write("rgb.txt", &list("rgb"));
    folder.write("depth.txt", &list("depth"));
    let camera = folder.open().calibration().camera;
    assert_eq!((camera.width, camera.fx), (640, 542.822841));

    let folder = Folder::named("plant_1");
    for k in 0..2 {
        folder.colour(&format!("rgb/{k}.png"));
        folder.depth(&format!("depth/{k}.png"), 100);
    }
    folder.write("rgb.txt", &list("rgb"));
    folder.write("depth.txt", &list("depth"));
    folder.write("calibration.txt", "7.0 7.5 3.5 2.5\n");
    let dataset = folder.open();
    let calibration = dataset.calibration();
    assert_eq!((calibration.camera.width as u32, calibration.camera.fy), (WIDTH, 7.5));
    assert_eq!((calibration.depth_scale, calibration.sources.readout.name()), (5000.0, "recorded"));
    assert_eq!(dataset.frame(1).unwrap().depth[0], 100);
    // EuRoC's truth stands in for groundtruth.txt.
    fs::create_dir(folder.path.join("state_groundtruth_estimate0")).unwrap();
    folder.write("state_groundtruth_estimate0/data.csv", "1548266470880000000,1,2,3,1,0,0,0\n");
    let poses = folder.open().ground_truth().to_vec();
    assert_eq!((poses.len(), poses[0].world_from_camera.translation), (1, Vector3::new(1.0, 2.0, 3.0)));
    folder.write("calibration.txt", "7.0 -7.5 3.5 2.5\n");
    assert!(folder.message().starts_with("calibration.txt, line 1: fy = -7.5, expected a focal length"));
}
