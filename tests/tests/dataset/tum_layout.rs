//! What is read from the TUM layout.

use std::fs;

use image::{DynamicImage, ImageBuffer, ImageFormat, Luma, Rgb};
use mba_mapper::dataset::{self, ExposureSource, OpenOptions, Response, Shutter, TimedPose};

use crate::folder::{Folder, HEIGHT, WIDTH, colour_image};

#[test]
fn frames_come_as_stored_when_there_is_no_distortion() {
    let folder = Folder::complete();
    let dataset = folder.open();
    assert_eq!((dataset.name(), dataset.len(), dataset.folder()), ("sequence", 3, folder.path.as_path()));
    assert!(dataset.warnings().is_empty(), "{:?}", dataset.warnings());
    let calibration = dataset.calibration();
    assert_eq!(calibration.camera.fy, 7.5);
    assert_eq!(calibration.depth_scale, 5000.0);
    assert_eq!(calibration.exposure, ExposureSource::Constant { seconds: 0.016 });
    assert_eq!((&calibration.response, calibration.readout), (&Response::Linear, Shutter::Global));

    let frame = dataset.frame(1).unwrap();
    assert_eq!((frame.index, frame.width, frame.height), (1, 8, 6));
    assert_eq!((frame.timestamp, frame.exposure_seconds), (0.033333, 0.016));
    assert_eq!(frame.rgb[3 * (8 * 4 + 5)..][..3], [50, 80, 200]);
    assert_eq!(frame.depth, (200..248).collect::<Vec<u16>>());
    assert!(!frame.depth_is_empty());
    assert!(dataset.ground_truth().is_empty());
    let region = dataset.region_with_source();
    assert_eq!((region.left, region.top, region.right, region.bottom), (0, 0, 8, 6));
}

#[test]
fn lists_are_associated_one_to_one_and_leftovers_are_reported() {
    let folder = Folder::complete();
    fs::remove_file(folder.path.join("associations.txt")).unwrap();
    // The second colour image is closest to the depth image that the first one could also take.
    folder.write("rgb.txt", "# c\n# timestamp filename\n1.000 rgb/0.png\n1.033 rgb/1.png\n1.090 rgb/2.png\n");
    folder.write("depth.txt", "0.985 depth/0.png\n1.018 depth/1.png\n1.900 depth/2.png\n");
    let dataset = folder.open();
    let firsts: Vec<u16> = (0..2).map(|k| dataset.frame(k).unwrap().depth[0]).collect();
    assert_eq!((dataset.len(), firsts), (2, vec![100, 200]));
    assert_eq!((dataset.timestamp(0), dataset.timestamp(1)), (1.0, 1.033));
    assert_eq!(
        folder.warnings(),
        [
            "rgb.txt: 1 images have no partner within 0.02 s and are left out, first at 1.09",
            "depth.txt: 1 images have no partner within 0.02 s and are left out, first at 1.9",
        ]
    );
    let strict = OpenOptions { association_tolerance: 0.001, ..OpenOptions::default() };
    let error = dataset::open_with(&folder.path, &strict).unwrap_err();
    assert_eq!(
        folder.shortened(&error),
        "no image of rgb.txt (3 images) is within 0.001 s of one of depth.txt (3 images); the closest are \
         0.015000 s apart, do both use the same clock?"
    );
}

#[test]
fn associations_may_list_depth_first_and_odd_pairs_are_reported() {
    let folder = Folder::complete();
    folder.write(
        "associations.txt",
        "0 depth/0.png 0 rgb/0.png\n0.2 depth/0.png 0.03 rgb/1.png\n0.2 depth/2.png 0.06 rgb/2.png\n",
    );
    let dataset = folder.open();
    assert_eq!((dataset.timestamp(1), dataset.frame(1).unwrap().depth[0]), (0.03, 100));
    assert_eq!(
        folder.warnings(),
        [
            "associations.txt: 2 pairs are more than 0.02 s apart, up to 0.170000 s",
            "associations.txt: 1 depth images are used more than once, first at 0.2",
        ]
    );
}

#[test]
fn jpeg_colour_is_read_and_a_cut_off_jpeg_is_not() {
    let folder = Folder::complete();
    let grey = DynamicImage::ImageRgb8(ImageBuffer::from_pixel(WIDTH, HEIGHT, Rgb([90, 120, 60])));
    grey.save_with_format(folder.path.join("rgb/0.jpg"), ImageFormat::Jpeg).unwrap();
    folder.edit("associations.txt", "rgb/0.png", "rgb/0.jpg");
    let frame = folder.open().frame(0).unwrap();
    for (value, expected) in frame.rgb.iter().zip([90_u8, 120, 60].iter().cycle()) {
        assert!(value.abs_diff(*expected) <= 3, "{value} for {expected}");
    }

    let length = fs::metadata(folder.path.join("rgb/0.jpg")).unwrap().len() as usize;
    folder.truncate("rgb/0.jpg", length - 3);
    let error = folder.open().frame(0).unwrap_err();
    assert_eq!(
        folder.shortened(&error),
        "rgb/0.jpg is damaged or cut off: the end marker of the JPEG stream is missing"
    );
}

#[test]
fn a_frame_without_any_depth_is_flagged() {
    let folder = Folder::complete();
    ImageBuffer::from_pixel(WIDTH, HEIGHT, Luma([0_u16])).save(folder.path.join("depth/2.png")).unwrap();
    assert!(folder.open().frame(2).unwrap().depth_is_empty());
}

#[test]
fn distorted_images_are_undistorted() {
    let folder = Folder::complete();
    folder.edit("calibration.toml", "depth_scale", "distortion = [-0.2, 0.0, 0.0, 0.0, 0.0]\ndepth_scale");
    let frame = folder.open().frame(0).unwrap();
    // Ideal pixel (0, 1): x = -0.5, y = -0.2, radial 1 - 0.2 * 0.29 = 0.942, source (0.203, 1.087).
    assert_eq!(frame.rgb[3 * 8..][..3], [2, 22, 200]);
    assert_eq!(frame.depth[8], 108);
    // Stretching instead of shrinking leaves the corners without source.
    folder.edit("calibration.toml", "-0.2", "0.2");
    let dataset = folder.open();
    let frame = dataset.frame(0).unwrap();
    assert_eq!((&frame.rgb[..3], frame.depth[0]), (&[0, 0, 0][..], 0));
    let region = dataset.region_with_source();
    assert_eq!((region.left, region.top, region.right, region.bottom), (1, 1, 7, 5));
}

#[test]
fn freiburg_sequences_need_no_calibration() {
    for (name, fx, k1) in [
        ("rgbd_dataset_freiburg1_rpy", 517.306408, 0.262383),
        ("rgbd_dataset_freiburg2_desk", 520.908620, 0.231222),
        ("tum-fr3-office", 535.433105, 0.0),
    ] {
        let folder = Folder::named(name);
        colour_image(640, 480).save(folder.path.join("rgb/0.png")).unwrap();
        ImageBuffer::from_pixel(640, 480, Luma([5000_u16])).save(folder.path.join("depth/0.png")).unwrap();
        folder.write("associations.txt", "1305031102.0 rgb/0.png 1305031102.0 depth/0.png\n");
        let dataset = folder.open();
        let calibration = dataset.calibration();
        assert_eq!((calibration.camera.fx, calibration.distortion.k1), (fx, k1));
        assert_eq!((calibration.depth_scale, calibration.frame_rate), (5000.0, 30.0));
        assert_eq!(calibration.readout, Shutter::Rolling { seconds: None });
        assert!((dataset.exposure_seconds(0) - 0.5 / 30.0).abs() < 1e-12);
        assert_eq!(folder.warnings().len(), 2);
        assert!(folder.warnings()[0].starts_with("no calibration.toml, using the published"));
        assert_eq!(dataset.frame(0).unwrap().depth[640 * 240 + 320], 5000);
        // Folders of others may have such a name; those frames are not of 2011.
        folder.write("associations.txt", "1625000000.0 rgb/0.png 1625000000.0 depth/0.png\n");
        assert!(
            folder.message().starts_with("FOLDER has no calibration.toml and is no recording of a known")
        );
    }
    let folder = Folder::complete();
    fs::remove_file(folder.path.join("calibration.toml")).unwrap();
    assert_eq!(
        folder.message(),
        "FOLDER has no calibration.toml and is no recording of a known camera (freiburg1, freiburg2, freiburg3, \
         recorded in 2011 and 2012); add that file with the camera's width, height, fx, fy, cx, cy and depth_scale"
    );
}

#[test]
fn each_frame_may_have_its_own_exposure() {
    let folder = Folder::complete();
    folder.write("exposures.csv", "gain, exposure_s ,timestamp\n1,0.004,0.0\n2,0.032,0.0666\n");
    let dataset = folder.open();
    let exposures: Vec<f64> = (0..3).map(|k| dataset.exposure_seconds(k)).collect();
    assert_eq!(exposures, [0.004, 0.016, 0.032]);
    assert_eq!(dataset.frame(2).unwrap().exposure_seconds, 0.032);
    assert_eq!(dataset.calibration().exposure, ExposureSource::PerFrame);
    assert_eq!(
        folder.warnings(),
        ["exposures.csv has no exposure time for 1 frames, first at 0.033333; 0.0160 s is used"]
    );
    folder.write("exposures.csv", "timestamp,exposure_s\n0.0,0.004\n0.0333,-0.01\n");
    assert_eq!(
        folder.message(),
        "exposures.csv, line 3: expected a row with a timestamp and a positive exposure_s in seconds, \
         found \"0.0333,-0.01\""
    );
    folder.write("exposures.csv", "time,exposure_s\n");
    assert_eq!(
        folder.message(),
        "exposures.csv, line 1: expected a header line with the columns timestamp and exposure_s, \
         found \"time,exposure_s\""
    );
}

#[test]
fn a_user_response_table_is_scaled_to_one() {
    let folder = Folder::complete();
    let table: Vec<String> = (0..256).map(|code| format!("{}", 2 * code)).collect();
    folder.write("table.csv", &table.join(",\n"));
    folder.edit("calibration.toml", "\"linear\"", "\"table.csv\"");
    let dataset = folder.open();
    let inverse = dataset.calibration().response.inverse();
    assert_eq!([0, 51, 255].map(|code| inverse.linear_light(code)), [0.0, 0.2, 1.0]);

    folder.write("table.csv", &table[..255].join("\n"));
    assert!(
        folder.message().starts_with("table.csv, line 255: expected 256 increasing"),
        "{}",
        folder.message()
    );
    folder.write("table.csv", &table.join("\n").replace("\n100\n", "\n98\n"));
    assert!(folder.message().ends_with("found \"98\""), "{}", folder.message());
    folder.edit("calibration.toml", "table.csv", "gamma");
    assert_eq!(
        folder.message(),
        "calibration.toml, line 10: response = \"gamma\", expected \"srgb\", \"linear\" or the name of a .csv \
         or .txt table of 256 numbers"
    );
}

#[test]
fn ground_truth_need_not_match_the_frames() {
    let folder = Folder::complete();
    folder.write("groundtruth.txt", "# c\n-1 0 0 0 0 0 0 1\n0.01 1 0 0 0 0 0 1\n0.5 2 0 0 0 0 0 1\n");
    let dataset = folder.open();
    assert_eq!(dataset.ground_truth().len(), 3);
    assert_eq!(dataset.ground_truth()[1].world_from_camera.translation.x, 1.0);
    assert!(dataset.warnings().is_empty());

    folder.write("groundtruth.txt", "100 0 0 0 0 0 0 1\n");
    assert_eq!(folder.warnings(), ["groundtruth.txt covers none of the frames' times"]);
    // Lines that are no poses are left out, also where the times do not increase over them.
    folder.write(
        "groundtruth.txt",
        "0 0 0 0 1 1 0 0\n0.01 1 0 0 0 0 0 1\n0.01 2 0 0 0 0 0 1\n0.02 nan 0 0 0 0 0 1\n0.03 3 0 0\n0.04 4 0 0 0 0 0 1\n",
    );
    let [warning] = <[String; 1]>::try_from(folder.warnings()).unwrap();
    let expected =
        "4 lines of recorded poses are left out, the first because groundtruth.txt, line 1: the quaternion";
    assert!(warning.starts_with(expected), "{warning}");
    let x = |pose: &TimedPose| pose.world_from_camera.translation.x;
    assert_eq!(folder.open().ground_truth().iter().map(x).collect::<Vec<_>>(), [1.0, 4.0]);

    fs::remove_file(folder.path.join("groundtruth.txt")).unwrap();
    let pose = |x: u8| format!("{x} 0 0 0 0 0 1");
    folder.write("groundtruth_exposure.txt", &format!("0.0 {} {} {}\n", pose(1), pose(2), pose(3)));
    let dataset = folder.open();
    assert_eq!(dataset.ground_truth_exposures()[0].end.translation.x, 3.0);
    assert_eq!(dataset.ground_truth()[0].world_from_camera.translation.x, 2.0);
}
