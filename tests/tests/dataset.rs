//! Data sets in the TUM layout: what is read, and what is said about bad input.

use std::fs;
use std::path::{Path, PathBuf};

use image::{DynamicImage, ImageBuffer, ImageFormat, Luma, Rgb};
use mba_mapper::dataset::{
    self, Dataset, DatasetError, ExposureSource, FrameError, OpenOptions, Readout, Response,
};
use tempfile::TempDir;

const WIDTH: u32 = 8;
const HEIGHT: u32 = 6;
const CALIBRATION: &str = "width = 8\nheight = 6\nfx = 7.0\nfy = 7.5\ncx = 3.5\ncy = 2.5\ndepth_scale = 5000\n\
    exposure_seconds = 0.016\nframe_rate = 30\nresponse = \"linear\"\nreadout = \"global\"\n";

/// A data set folder under construction.
struct Folder {
    root: TempDir,
    path: PathBuf,
}

impl Folder {
    fn named(name: &str) -> Self {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join(name);
        fs::create_dir_all(path.join("rgb")).unwrap();
        fs::create_dir_all(path.join("depth")).unwrap();
        Self { root, path }
    }

    /// Three frames 1/30 s apart with associations and calibration.
    fn complete() -> Self {
        let folder = Self::named("sequence");
        folder.write("calibration.toml", CALIBRATION);
        let mut associations = String::new();
        for k in 0..3 {
            folder.colour(&format!("rgb/{k}.png"));
            folder.depth(&format!("depth/{k}.png"), 100 * (k + 1));
            let time = f64::from(k) / 30.0;
            associations += &format!("{time:.6} rgb/{k}.png {time:.6} depth/{k}.png\n");
        }
        folder.write("associations.txt", &associations);
        folder
    }

    fn write(&self, file: &str, text: &str) {
        fs::write(self.path.join(file), text).unwrap();
    }

    /// Replaces text in a file, which has to contain it.
    fn edit(&self, file: &str, from: &str, to: &str) {
        let text = fs::read_to_string(self.path.join(file)).unwrap();
        assert!(text.contains(from), "{file} does not contain {from}");
        self.write(file, &text.replacen(from, to, 1));
    }

    fn colour(&self, file: &str) {
        colour_image(WIDTH, HEIGHT).save(self.path.join(file)).unwrap();
    }

    fn depth(&self, file: &str, first: u16) {
        let pixel = |x: u32, y: u32| Luma([first + (x + WIDTH * y) as u16]);
        ImageBuffer::from_fn(WIDTH, HEIGHT, pixel).save(self.path.join(file)).unwrap();
    }

    fn truncate(&self, file: &str, keep: usize) {
        let bytes = fs::read(self.path.join(file)).unwrap();
        assert!(keep < bytes.len(), "{file} has only {} bytes", bytes.len());
        fs::write(self.path.join(file), &bytes[..keep]).unwrap();
    }

    fn open(&self) -> Dataset {
        dataset::open(&self.path).unwrap()
    }

    fn open_error(&self) -> DatasetError {
        dataset::open(&self.path).unwrap_err()
    }

    /// The message with the folder's path left out.
    fn message(&self) -> String {
        self.shortened(&self.open_error())
    }

    fn warnings(&self) -> Vec<String> {
        self.open().warnings().iter().map(|warning| self.shortened(warning)).collect()
    }

    fn shortened(&self, message: &dyn std::fmt::Display) -> String {
        let prefix = format!("{}{}", self.path.display(), std::path::MAIN_SEPARATOR);
        message.to_string().replace(&prefix, "").replace(&self.path.display().to_string(), "FOLDER")
    }
}

fn colour_image(width: u32, height: u32) -> DynamicImage {
    let pixel = |x, y| Rgb([(10 * x) as u8, (20 * y) as u8, 200]);
    DynamicImage::ImageRgb8(ImageBuffer::from_fn(width, height, pixel))
}

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
    assert_eq!((&calibration.response, calibration.readout), (&Response::Linear, Readout::Global));

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
    let strict = OpenOptions { association_tolerance: 0.001 };
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
    assert!(matches!(no_image, FrameError::Damaged { .. }), "{no_image}");
    folder.write("depth/2.png", "");
    assert!(matches!(dataset.frame(2).unwrap_err(), FrameError::Damaged { .. }));
}

#[test]
fn images_of_another_size_or_type_are_errors() {
    let folder = Folder::complete();
    let larger = colour_image(9, HEIGHT);
    larger.save(folder.path.join("rgb/1.png")).unwrap();
    let message = folder.shortened(&folder.open().frame(1).unwrap_err());
    assert_eq!(message, "rgb/1.png has 9 x 6 pixels, the calibration says 8 x 6");
    larger.to_luma8().save(folder.path.join("depth/0.png")).unwrap();
    assert_eq!(folder.message(), "depth/0.png has 9 x 6 pixels, the calibration says 8 x 6");
    colour_image(WIDTH, HEIGHT).to_luma8().save(folder.path.join("depth/0.png")).unwrap();
    let message = folder.shortened(&folder.open().frame(0).unwrap_err());
    assert_eq!(message, "depth/0.png has pixels of type L8, expected 16-bit grey (L16) for depth");
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
        folder.write("associations.txt", "1.0 rgb/0.png 1.0 depth/0.png\n");
        let dataset = folder.open();
        let calibration = dataset.calibration();
        assert_eq!((calibration.camera.fx, calibration.distortion.k1), (fx, k1));
        assert_eq!((calibration.depth_scale, calibration.frame_rate), (5000.0, 30.0));
        assert_eq!(calibration.readout, Readout::Rolling);
        assert!((dataset.exposure_seconds(0) - 0.5 / 30.0).abs() < 1e-12);
        assert_eq!(folder.warnings().len(), 2);
        assert!(folder.warnings()[0].starts_with("no calibration.toml, using the published"));
        assert_eq!(dataset.frame(0).unwrap().depth[640 * 240 + 320], 5000);
    }
    let folder = Folder::complete();
    fs::remove_file(folder.path.join("calibration.toml")).unwrap();
    assert_eq!(
        folder.message(),
        "FOLDER has no calibration.toml and its name is not that of a known camera (freiburg1, freiburg2, \
         freiburg3); add that file with the camera's width, height, fx, fy, cx, cy and depth_scale"
    );
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
    assert_eq!((calibration.response, calibration.readout), (Response::Srgb, Readout::Global));
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
    let Response::Table(values) = &dataset.calibration().response else { panic!("no table") };
    assert_eq!((values[0], values[51], values[255]), (0.0, 0.2, 1.0));

    folder.write("table.csv", &table[..255].join("\n"));
    assert!(
        folder.message().starts_with("table.csv, line 255: expected 256 numbers"),
        "{}",
        folder.message()
    );
    folder.write("table.csv", &table.join("\n").replace("\n100\n", "\n90\n"));
    assert!(folder.message().ends_with("found \"90\""), "{}", folder.message());
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
    folder.write("groundtruth.txt", "0 0 0 0 1 1 0 0\n");
    assert!(folder.message().starts_with("groundtruth.txt, line 1: the quaternion has length 1.4142"));

    fs::remove_file(folder.path.join("groundtruth.txt")).unwrap();
    let pose = |x: u8| format!("{x} 0 0 0 0 0 1");
    folder.write("groundtruth_exposure.txt", &format!("0.0 {} {} {}\n", pose(1), pose(2), pose(3)));
    let dataset = folder.open();
    assert_eq!(dataset.ground_truth_exposures()[0].end.translation.x, 3.0);
    assert_eq!(dataset.ground_truth()[0].world_from_camera.translation.x, 2.0);
}

#[test]
fn bad_lists_are_named_with_line_and_value() {
    let folder = Folder::complete();
    let line = |time: &str| format!("{time} rgb/0.png {time} depth/0.png\n");
    folder.write("associations.txt", &[line("2"), line("1.5")].concat());
    assert!(folder.message().starts_with("associations.txt, line 2: timestamp 1.5 comes after 2; sort"));
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
    folder.write("depth.txt", "2 depth/0.png\n1 depth/1.png\n");
    assert!(folder.message().starts_with("depth.txt, line 2: timestamp 1 comes after 2; sort"));
    folder.write("depth.txt", "");
    assert_eq!(folder.message(), "depth.txt lists no images");
}

#[test]
fn absurd_calibrations_are_named_with_line_and_value() {
    for (from, to, expected) in [
        ("fx = 7.0", "fx = 0", "line 3: fx = 0, expected a focal length in pixels, above 0 and at most 100"),
        ("fy = 7.5", "fy = -7.5", "line 4: fy = -7.5, expected a focal length"),
        ("fx = 7.0", "fx = 801.0", "line 3: fx = 801, expected a focal length"),
        ("fx = 7.0", "fx = nan", "line 3: fx = NaN, expected a focal length"),
        ("cx = 3.5", "cx = 17", "line 5: cx = 17, expected a principal point in pixels, in or near"),
        ("cy = 2.5", "cy = -inf", "line 6: cy = -inf, expected a principal point"),
        ("width = 8", "width = 0", "line 1: width = 0, expected a size from 1 to 32768 pixels"),
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
        ("frame_rate = 30", "frame_rate = 0", "line 9: frame_rate = 0, expected a positive number of frames"),
        (
            "frame_rate",
            "distortion = [0, 0, inf, 0, 0]\nframe_rate",
            "line 9: distortion = inf, expected fin",
        ),
        ("fy = 7.5", "fyy = 7.5", "line 4: unknown field `fyy`, expected one of `width`"),
        ("fy = 7.5\n", "", "line 1: missing field `fy`"),
        ("fy = 7.5", "fy = \"a\"", "line 4: invalid type: string \"a\", expected f64"),
        ("fy = 7.5", "fy 7.5", "line 4: "),
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
}

#[test]
fn folders_that_hold_nothing_are_named() {
    let folder = Folder::named("empty");
    assert!(folder.message().starts_with("FOLDER holds no known data set; expected associations.txt or"));
    let missing = folder.root.path().join("missing");
    let message = dataset::open(Path::new(&missing)).unwrap_err().to_string();
    assert!(message.starts_with(&format!("cannot read {}: ", missing.display())), "{message}");
}
