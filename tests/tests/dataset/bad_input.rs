//! What is said about bad or odd input.

use std::fs;
use std::path::Path;

use image::ImageEncoder;
use mba_mapper::dataset::{self, Dataset, DatasetError, FrameReadError, Response, Shutter};

use crate::folder::{Folder, HEIGHT, WIDTH, colour_image};

#[test]
fn a_damaged_frame_is_an_error_of_that_frame_only() {
    let folder = Folder::complete();
    fs::remove_file(folder.path.join("rgb/0.png")).unwrap();
    folder.truncate("depth/1.png", 60);
    let dataset = folder.open();
    assert_eq!(folder.warnings(), ["1 listed images do not exist, first rgb/0.png"]);
    let missing = dataset.frame(0).unwrap_err();
    assert!(folder.shortened(&missing).starts_with("cannot read rgb/0.png: "), "{missing}");
    let damaged = dataset.frame(1).unwrap_err();
    assert!(folder.shortened(&damaged).starts_with("depth/1.png is damaged or cut off: "), "{damaged}");
    assert!(dataset.frame(2).is_ok());
    assert_eq!(dataset.frame(3).unwrap_err().to_string(), "frame 3 does not exist, the data set has 3");

    folder.write("rgb/0.png", "this is no image");
    let no_image = dataset.frame(0).unwrap_err();
    assert!(matches!(no_image, FrameReadError::Damaged { .. }), "{no_image}");
    folder.write("depth/2.png", "");
    assert!(matches!(dataset.frame(2).unwrap_err(), FrameReadError::Damaged { .. }));
}

#[test]
#[should_panic(expected = "frame 3 of a data set of 3 frames")]
fn the_time_of_a_frame_that_is_not_there_is_refused() {
    let _ = Folder::complete().open().timestamp(3);
}

#[test]
fn images_of_another_size_or_type_are_errors() {
    let folder = Folder::complete();
    let larger = colour_image(9, HEIGHT);
    larger.save(folder.path.join("rgb/1.png")).unwrap();
    let message = folder.shortened(&folder.open().frame(1).unwrap_err());
    assert_eq!(message, "rgb/1.png has 9 x 6 pixels, the calibration says 8 x 6");
    larger.to_luma8().save(folder.path.join("depth/0.png")).unwrap();
    let expected = "depth/0.png has 9 x 6 pixels, the colour images 8 x 6; depth of other \
                    proportions needs its camera as [depth] in calibration.toml";
    assert_eq!(folder.message(), expected);
    colour_image(WIDTH, HEIGHT).to_luma8().save(folder.path.join("depth/0.png")).unwrap();
    let message = folder.shortened(&folder.open().frame(0).unwrap_err());
    assert_eq!(message, "depth/0.png has pixels of type L8, expected 16-bit grey (L16) for depth");
}

#[test]
fn bad_lists_are_named_with_line_and_value() {
    let folder = Folder::complete();
    let line = |time: &str| format!("{time} rgb/0.png {time} depth/0.png\n");
    folder.write("associations.txt", &[line("2"), line("1.5"), line("2")].concat());
    assert!(folder.message().starts_with("associations.txt, line 3: timestamp 2 occurs twice"));
    folder.write("associations.txt", &[line("2"), line("2.0")].concat());
    assert_eq!(
        folder.message(),
        "associations.txt, line 2: timestamp 2 occurs twice; remove one of the lines"
    );
    folder.write("associations.txt", "# nothing\n");
    assert_eq!(folder.message(), "associations.txt lists no images");
    folder.write("associations.txt", "1 rgb/0.png depth/0.png\n");
    assert_eq!(
        folder.message(),
        "associations.txt, line 1: expected timestamp image timestamp depth-image, \
         found \"1 rgb/0.png depth/0.png\""
    );
    folder.write("associations.txt", &line("inf"));
    assert_eq!(folder.message(), "associations.txt, line 1: inf is not a finite number");

    fs::remove_file(folder.path.join("associations.txt")).unwrap();
    assert!(matches!(folder.open_error(), DatasetError::UnknownLayout { .. }));
    folder.write("rgb.txt", "1 rgb/0.png\n");
    folder.write("depth.txt", "2 depth/0.png\n1 depth/1.png\n2 depth/2.png\n");
    assert!(folder.message().starts_with("depth.txt, line 3: timestamp 2 occurs twice"));
    folder.write("depth.txt", "");
    assert_eq!(folder.message(), "depth.txt lists no images");
}

#[test]
fn lists_in_another_order_are_read_in_that_of_time() {
    let folder = Folder::complete();
    let line = |time: f64, k: u32| format!("{time} rgb/{k}.png {time} depth/{k}.png\n");
    folder.write("associations.txt", &[line(1.0, 0), line(1.2, 2), line(1.1, 1), line(1.3, 3)].concat());
    let times = |dataset: &Dataset| (0..4).map(|k| dataset.timestamp(k)).collect::<Vec<_>>();
    assert_eq!(times(&folder.open()), [1.0, 1.1, 1.2, 1.3]);
    let expected =
        "associations.txt: 1 lines are earlier than the one before; the list is read in the order of time";
    assert!(folder.warnings().iter().any(|warning| warning.ends_with(expected)), "{:?}", folder.warnings());
    fs::remove_file(folder.path.join("associations.txt")).unwrap();
    folder.write("rgb.txt", "1.3 rgb/3.png\n1.2 rgb/2.png\n1.1 rgb/1.png\n1 rgb/0.png\n");
    folder.write("depth.txt", "1 depth/0.png\n1.1 depth/1.png\n1.2 depth/2.png\n1.3 depth/3.png\n");
    assert_eq!(times(&folder.open()), [1.0, 1.1, 1.2, 1.3]);
}

#[test]
fn images_that_are_marked_as_turned_are_read_as_they_are_shown() {
    let folder = Folder::complete();
    let path = folder.path.join("rgb/0.png");
    let upright = folder.open().frame(0).unwrap().rgb;
    let turned = image::open(&path).unwrap().into_rgb8();
    let write = |image: &image::RgbImage, orientation: u8| {
        // A TIFF header and one entry: tag 0x0112, one short.
        let exif =
            [b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0".as_slice(), &[orientation, 0, 0, 0], &[0; 4]]
                .concat();
        let mut encoder = image::codecs::png::PngEncoder::new(fs::File::create(&path).unwrap());
        encoder.set_exif_metadata(exif).unwrap();
        image.write_with_encoder(encoder).unwrap();
    };
    // To be turned by half a circle.
    write(&image::imageops::rotate180(&turned), 3);
    assert_eq!(folder.open().frame(0).unwrap().rgb, upright);
    let said = folder.warnings().concat();
    assert!(said.contains("marked to be shown turned") && said.contains("read as it is shown"), "{said}");
    // Stored upright with the size of the calibration, but marked as if it lay on its side.
    write(&turned, 6);
    assert_eq!(folder.open().frame(0).unwrap().rgb, upright);
    assert!(folder.warnings().concat().contains("read as it is stored"));
    // Stored on its side.
    write(&image::imageops::rotate270(&turned), 6);
    assert_eq!(folder.open().frame(0).unwrap().rgb, upright);
}

#[test]
fn absurd_calibrations_are_named_with_line_and_value() {
    for (from, to, expected) in [
        ("fx = 7.0", "fx = 0", "line 3: fx = 0, expected a focal length in pixels, above 1 and at most 100"),
        ("fx = 7.0", "fx = 1e300", "line 3: fx = 1e300, expected a focal length"),
        ("fy = 7.5", "fy = -7.5", "line 4: fy = -7.5, expected a focal length"),
        ("fx = 7.0", "fx = 801.0", "line 3: fx = 801, expected a focal length"),
        ("fx = 7.0", "fx = nan", "line 3: fx = NaN, expected a focal length"),
        ("cx = 3.5", "cx = 17", "line 5: cx = 17, expected a principal point in pixels, in or near"),
        ("cy = 2.5", "cy = -inf", "line 6: cy = -inf, expected a principal point"),
        ("width = 8", "width = 0", "line 1: width = 0, expected a size from 1 to 16384 pixels"),
        ("height = 6", "height = 99999", "line 2: height = 99999, expected a size"),
        (
            "depth_scale = 5000",
            "depth_scale = 0",
            "line 7: depth_scale = 0, expected a positive number of raw",
        ),
        (
            "exposure_seconds = 0.016",
            "exposure_seconds = -1",
            "line 8: exposure_seconds = -1, expected a pos",
        ),
        (
            "frame_rate = 30",
            "frame_rate = 0",
            "line 9: frame_rate = 0, expected frames per second, 0.001 to 100000",
        ),
        ("frame_rate = 30", "frame_rate = 1e300", "line 9: frame_rate = 1e300, expected frames per second"),
        (
            "frame_rate",
            "distortion = [0, 0, inf, 0, 0]\nframe_rate",
            "line 9: distortion = inf, expected fin",
        ),
        ("fy = 7.5", "fyy = 7.5", "line 4: unknown field `fyy`, expected one of `width`"),
        ("fy = 7.5\n", "", "line 1: missing field `fy`"),
        ("fy = 7.5", "fy = \"a\"", "line 4: invalid type: string \"a\", expected f64"),
        ("fy = 7.5", "fy 7.5", "line 4: "),
        (
            "exposure_seconds = 0.016",
            "exposure_seconds = 16",
            "line 8: exposure_seconds = 16, expected a positive number of seconds, 0.000001 to 1 (16 ms are 0.016)",
        ),
        (
            "readout = \"global\"",
            "readout_seconds = 20",
            "line 11: readout_seconds = 20, expected seconds from the first row to the last, -0.1 to 0.1",
        ),
        (
            "readout = \"global\"",
            "readout = \"global\"\nreadout_seconds = 0.02",
            "line 12: readout_seconds = 0.02, expected 0 or nothing with readout = \"global\"",
        ),
        (
            "frame_rate",
            "depth_readout_seconds = -0.11\nframe_rate",
            "line 9: depth_readout_seconds = -0.11, expected seconds from the first row to the last",
        ),
        (
            "frame_rate",
            "depth_delay_seconds = 11\nframe_rate",
            "line 9: depth_delay_seconds = 11, expected seconds from colour to depth, -0.2 to 0.2",
        ),
        (
            "frame_rate",
            "vignetting = [-1.5, 0.5]\nframe_rate",
            "line 9: vignetting = [-1.5, 0.5], expected [a2, a4], each from -10 to 10, with 1 + a2 r^2 + a4 r^4 above 0",
        ),
        (
            "frame_rate",
            "vignetting = [nan, 0]\nframe_rate",
            "line 9: vignetting = [NaN, 0], expected [a2, a4]",
        ),
        (
            "frame_rate",
            "imu_from_camera = [1, 0, 0, 0, 1, 0, 0, 0, -1]\nframe_rate",
            "line 9: imu_from_camera = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0], expected the 9 numbers",
        ),
        (
            "frame_rate",
            "imu_from_camera = [1, 0]\nframe_rate",
            "line 9: imu_from_camera must be 9 numbers or three rows of 3",
        ),
        (
            "frame_rate",
            "estimated = [\"readout\", \"vignetting\"]\nframe_rate",
            "line 9: estimated = \"vignetting\", expected names of facts that have a value in this file",
        ),
        (
            "depth_scale = 5000",
            "depth_scale = 0.0002",
            "line 7: depth_scale = 0.0002, expected a positive number of raw units per metre, above 1",
        ),
        (
            "frame_rate",
            // At the edge, half a focal length out, 1 - 6 r^2 is negative.
            "distortion = [-2.0, 0, 0, 0, 0]\nframe_rate",
            "line 9: distortion = [-2, 0, .., 0], expected k1 k2 p1 p2 k3 of a lens that does not fold",
        ),
        ("frame_rate", "estimated = [\"weather\"]\nframe_rate", "line 9: unknown variant `weather`"),
        ("\"global\"", "\"sideways\"", "line 11: unknown variant `sideways`, expected `global` or `rolling`"),
    ] {
        let folder = Folder::complete();
        folder.edit("calibration.toml", from, to);
        let message = folder.message();
        assert!(message.starts_with(&format!("calibration.toml, {expected}")), "{message}");
        assert!(!message.contains('\n'), "{message}");
    }
}

#[test]
fn folders_that_hold_nothing_are_named() {
    let folder = Folder::named("empty");
    assert!(folder.message().starts_with("FOLDER holds no known data set; expected associations.txt or"));
    let missing = folder.root.path().join("missing");
    let message = dataset::open(Path::new(&missing)).unwrap_err().to_string();
    assert!(message.starts_with(&format!("cannot read {}: ", missing.display())), "{message}");
}

#[test]
fn odd_timing_is_reported() {
    let folder = Folder::complete();
    folder.edit("calibration.toml", "0.016", "0.05");
    assert_eq!(folder.warnings(), ["exposure of 0.05 s is longer than the 0.033333 s between frames"]);
    folder.edit("calibration.toml", "frame_rate = 30", "frame_rate = 5");
    assert_eq!(folder.warnings(), ["the calibration says 5 frames per second, the timestamps 30.00"]);

    let folder = Folder::complete();
    let line = |time: f64| format!("{time} rgb/0.png {time} depth/0.png\n");
    let times = [0.0, 0.033, 0.066, 0.2, 0.233, 0.266, 1.0, 1.033];
    folder.write("associations.txt", &times.map(line).concat());
    assert_eq!(folder.warnings(), ["2 gaps between frames, the longest 0.734 s after 0.266"]);

    for (factor, unit) in [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")] {
        folder.write("associations.txt", &[0.0, 0.032, 0.064].map(|time| line(factor * time)).concat());
        let expected = format!(
            "FOLDER: frames are {:.3} s apart, which 30 frames per second are not; timestamps are in seconds, these look \
             like {unit}",
            0.032 * factor
        );
        assert_eq!(folder.message(), expected);
    }
}

#[test]
fn assumptions_about_the_camera_are_reported() {
    let folder = Folder::complete();
    for line in [
        "exposure_seconds = 0.016\n",
        "frame_rate = 30\n",
        "response = \"linear\"\n",
        "readout = \"global\"\n",
    ] {
        folder.edit("calibration.toml", line, "");
    }
    let calibration = folder.open().calibration().clone();
    assert!((calibration.frame_rate - 30.0).abs() < 0.01);
    assert_eq!((calibration.response, calibration.readout), (Response::Srgb, Shutter::Global));
    assert_eq!(
        folder.warnings(),
        [
            "frame_rate is not given, 30.00 (from the timestamps) is assumed",
            "readout is not given, \"global\" is assumed",
            "response is not given, \"srgb\" is assumed",
            "exposure_seconds is not given, 0.0167 s (0.5 of the frame interval) is assumed",
        ]
    );
}

#[test]
fn what_stands_in_for_the_list_of_pairs_is_not_passed_over() {
    let folder = Folder::complete();
    std::fs::remove_file(folder.path.join("associations.txt")).unwrap();
    for list in ["rgb", "depth"] {
        folder.write(&format!("{list}.txt"), &format!("0 {list}/0.png\n"));
    }
    assert_eq!(folder.open().len(), 1);
    std::fs::create_dir(folder.path.join("associations.txt")).unwrap();
    assert_eq!(folder.message(), "cannot read associations.txt: it is a folder, not a file");
}

#[test]
fn times_that_results_could_not_tell_apart_are_refused() {
    let folder = Folder::complete();
    folder.edit("associations.txt", "0.033333 rgb", "0.0000004 rgb");
    assert_eq!(
        folder.message(),
        "associations.txt, line 2: timestamp 0.0000004 occurs twice; remove one of the lines"
    );
}
