//! `mba eval images`.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use image::{ImageBuffer, Luma, Rgb, RgbImage};
use mba_tests::small_dataset::FRAMES;

use super::{Outcome, Workplace, mba};

const SHARP: &[u8] = include_bytes!("../../data/image_figures/sharp.png");
const BLURRED: &[u8] = include_bytes!("../../data/image_figures/blurred.png");
const FIGURES: &str = include_str!("../../data/image_figures/figures.json");

/// Two empty folders and a data set.
struct Folders {
    place: Workplace,
    reference: PathBuf,
    estimate: PathBuf,
}

impl Folders {
    fn new() -> Self {
        let place = Workplace::new();
        let [reference, estimate] = [place.path("reference"), place.path("estimate")];
        fs::create_dir(&reference).unwrap();
        fs::create_dir(&estimate).unwrap();
        Self { place, reference, estimate }
    }

    fn write(&self, name: &str, reference: &[u8], estimate: &[u8]) {
        fs::write(self.reference.join(name), reference).unwrap();
        fs::write(self.estimate.join(name), estimate).unwrap();
    }

    fn eval<S: AsRef<OsStr>>(&self, more: impl IntoIterator<Item = S>) -> Outcome {
        let fixed = ["eval", "images", "--reference"].map(OsStr::new).into_iter();
        let fixed =
            fixed.chain([self.reference.as_os_str(), "--estimate".as_ref(), self.estimate.as_os_str()]);
        let more: Vec<_> = more.into_iter().map(|argument| argument.as_ref().to_owned()).collect();
        mba(fixed.map(OsStr::to_owned).chain(more))
    }

    fn assert_error(&self, parts: &[&str]) {
        self.eval::<&str>([]).assert_error(2, parts);
    }
}

fn near(value: &serde_json::Value, expected: f64, tolerance: f64) -> bool {
    (value.as_f64().unwrap_or(f64::NAN) - expected).abs() < tolerance
}

fn save_grey(path: &Path, value: u8) {
    RgbImage::from_pixel(160, 120, Rgb([value; 3])).save(path).unwrap();
}

#[test]
fn figures_are_those_of_scikit_image() {
    let folders = Folders::new();
    folders.write("000001.png", SHARP, BLURRED);
    folders.write("000002.png", SHARP, SHARP);
    for name in ["000003.png", "000004.png", "notes.txt"] {
        fs::write(folders.reference.join(name), SHARP).unwrap();
    }
    let expected: serde_json::Value = serde_json::from_str(FIGURES).unwrap();
    let [psnr, ssim] = ["psnr_db", "ssim"].map(|figure| expected[figure].as_f64().unwrap());
    let figures = folders.eval(["--json"]).json();
    let images = figures["images"].as_array().unwrap();
    assert_eq!(
        (images.len(), &images[0]["name"], &images[1]["name"]),
        (2, &"000001".into(), &"000002".into())
    );
    assert!(near(&images[0]["psnr_db"], psnr, 1e-9), "{figures}");
    assert!(near(&images[0]["ssim"], ssim, 1e-9), "{figures}");
    assert!(images[1]["psnr_db"].is_null() && near(&images[1]["ssim"], 1.0, 1e-12), "{figures}");
    assert!(near(&figures["mean"]["ssim"], 0.5 * (ssim + 1.0), 1e-9), "{figures}");
    assert_eq!(figures["unpaired"], serde_json::json!({"reference": 2, "estimate": 0}));

    let table = folders.eval(["--threads", "1"]);
    assert!(table.stdout.contains("24.52      0.7378") && table.stdout.contains(" inf "), "{}", table.stdout);
    assert_eq!(table.stdout, folders.eval(["--threads", "2"]).stdout);
}

#[test]
fn depth_maps_are_compared_in_metres() {
    let folders = Folders::new();
    let save = |folder: &Path, raw: [u16; 4]| {
        ImageBuffer::<Luma<u16>, _>::from_vec(2, 2, raw.to_vec())
            .unwrap()
            .save(folder.join("7.png"))
            .unwrap();
    };
    save(&folders.reference, [1000, 0, 2000, 3000]);
    save(&folders.estimate, [1100, 500, 1700, 0]);
    let figures = folders.eval(["--json", "--depth-scale", "1000"]).json();
    assert!(near(&figures["depth"][0]["l1_m"], 0.2, 1e-12), "{figures}");
    assert_eq!((&figures["depth"][0]["name"], &figures["depth"][0]["share"]), (&"7".into(), &0.5.into()));
    let figures = folders.eval(["--json"]).json();
    assert!(near(&figures["mean_depth_l1_m"], 0.04, 1e-12), "5000 units per metre: {figures}");
    assert_eq!(folders.eval(["--depth-scale", "0"]).code, Some(2));
}

#[test]
fn captured_frames_show_what_was_gained() {
    let folders = Folders::new();
    for frame in [0, FRAMES - 1] {
        // The captured wall is no flat grey; the estimate is 10 steps too bright.
        save_grey(&folders.reference.join(format!("{frame:06}.png")), 100);
        save_grey(&folders.estimate.join(format!("{frame:06}.png")), 110);
    }
    let data = folders.place.path("data");
    let captured = [OsStr::new("--captured"), data.as_os_str()];
    let figures = folders.eval(captured.into_iter().chain(["--json".as_ref()])).json();
    let square: u64 = image::open(data.join("rgb/000000.png"))
        .unwrap()
        .into_rgb8()
        .iter()
        .map(|&value| u64::from(value.abs_diff(100)).pow(2))
        .sum();
    let psnr = |mean_square: f64| 10.0 * (255.0 * 255.0 / mean_square).log10();
    let expected = psnr(square as f64 / (3.0 * 160.0 * 120.0));
    assert!(near(&figures["images"][0]["captured"]["psnr_db"], expected, 1e-9), "{figures}");
    assert!(near(&figures["mean"]["psnr_db"], psnr(100.0), 1e-9), "{figures}");
    assert!(folders.eval(captured).stdout.contains("gain [dB]"));

    save_grey(&folders.reference.join("000099.png"), 1);
    save_grey(&folders.estimate.join("000099.png"), 1);
    folders.eval(captured).assert_error(2, &["frame 99 does not exist"]);
    fs::rename(folders.reference.join("000099.png"), folders.reference.join("end.png")).unwrap();
    fs::rename(folders.estimate.join("000099.png"), folders.estimate.join("end.png")).unwrap();
    folders.eval(captured).assert_error(2, &["end is not the index"]);
}

#[test]
fn folders_that_do_not_belong_together_are_refused() {
    let folders = Folders::new();
    fs::write(folders.reference.join("a.png"), SHARP).unwrap();
    fs::write(folders.estimate.join("b.png"), SHARP).unwrap();
    folders.assert_error(&["reference (1 images)", "estimate (1)", "no name in common"]);
    fs::remove_dir_all(&folders.estimate).unwrap();
    folders.assert_error(&["estimate", "No such file"]);
}

#[test]
fn images_that_do_not_belong_together_are_refused() {
    let folders = Folders::new();
    folders.write("a.png", SHARP, BLURRED);
    folders.write("c.png", SHARP, &SHARP[..SHARP.len() / 2]);
    folders.assert_error(&["c.png", "damaged"]);
    folders.write("c.png", SHARP, b"");
    folders.assert_error(&["c.png", "damaged"]);
    // The first by name is told, whatever comes later.
    save_grey(&folders.estimate.join("b.png"), 3);
    fs::write(folders.reference.join("b.png"), SHARP).unwrap();
    folders.assert_error(&["b: the reference has 96 x 64 pixels, the estimate 160 x 120"]);
    let depth = ImageBuffer::from_pixel(96, 64, Luma([500u16]));
    depth.save(folders.estimate.join("b.png")).unwrap();
    folders.assert_error(&["b: one is a depth map"]);
    for folder in [&folders.reference, &folders.estimate] {
        RgbImage::new(10, 20).save(folder.join("b.png")).unwrap();
    }
    folders.assert_error(&["b: the images have 10 x 20 pixels; 11 x 11"]);
}
