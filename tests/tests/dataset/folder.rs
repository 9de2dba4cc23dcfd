//! Small data sets in a temporary folder.

use std::fs;
use std::path::PathBuf;

use image::{DynamicImage, ImageBuffer, Luma, Rgb};
use mba_mapper::dataset::{self, Dataset, DatasetError};
use tempfile::TempDir;

pub(crate) const WIDTH: u32 = 8;
pub(crate) const HEIGHT: u32 = 6;
const CALIBRATION: &str = "width = 8\nheight = 6\nfx = 7.0\nfy = 7.5\ncx = 3.5\ncy = 2.5\ndepth_scale = 5000\n\
    exposure_seconds = 0.016\nframe_rate = 30\nresponse = \"linear\"\nreadout = \"global\"\n";

/// A data set folder under construction.
pub(crate) struct Folder {
    pub(crate) root: TempDir,
    pub(crate) path: PathBuf,
}

impl Folder {
    pub(crate) fn named(name: &str) -> Self {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join(name);
        fs::create_dir_all(path.join("rgb")).unwrap();
        fs::create_dir_all(path.join("depth")).unwrap();
        Self { root, path }
    }

    /// Three frames 1/30 s apart with associations and calibration.
    pub(crate) fn complete() -> Self {
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

    pub(crate) fn write(&self, file: &str, text: &str) {
        fs::write(self.path.join(file), text).unwrap();
    }

    /// Replaces text in a file, which has to contain it.
    pub(crate) fn edit(&self, file: &str, from: &str, to: &str) {
        let text = fs::read_to_string(self.path.join(file)).unwrap();
        assert!(text.contains(from), "{file} does not contain {from}");
        self.write(file, &text.replacen(from, to, 1));
    }

    pub(crate) fn colour(&self, file: &str) {
        colour_image(WIDTH, HEIGHT).save(self.path.join(file)).unwrap();
    }

    pub(crate) fn depth(&self, file: &str, first: u16) {
        let pixel = |x: u32, y: u32| Luma([first + (x + WIDTH * y) as u16]);
        ImageBuffer::from_fn(WIDTH, HEIGHT, pixel).save(self.path.join(file)).unwrap();
    }

    pub(crate) fn truncate(&self, file: &str, keep: usize) {
        let bytes = fs::read(self.path.join(file)).unwrap();
        assert!(keep < bytes.len(), "{file} has only {} bytes", bytes.len());
        fs::write(self.path.join(file), &bytes[..keep]).unwrap();
    }

    pub(crate) fn open(&self) -> Dataset {
        dataset::open(&self.path).unwrap()
    }

    pub(crate) fn open_error(&self) -> DatasetError {
        dataset::open(&self.path).unwrap_err()
    }

    /// The message with the folder's path left out.
    pub(crate) fn message(&self) -> String {
        self.shortened(&self.open_error())
    }

    pub(crate) fn warnings(&self) -> Vec<String> {
        self.open().warnings().iter().map(|warning| self.shortened(warning)).collect()
    }

    pub(crate) fn shortened(&self, message: &dyn std::fmt::Display) -> String {
        let prefix = format!("{}{}", self.path.display(), std::path::MAIN_SEPARATOR);
        message.to_string().replace(&prefix, "").replace(&self.path.display().to_string(), "FOLDER")
    }
}

/// An image whose value says where it is: red 10 x, green 20 y.
pub(crate) fn colour_image(width: u32, height: u32) -> DynamicImage {
    let pixel = |x, y| Rgb([(10 * x) as u8, (20 * y) as u8, 200]);
    DynamicImage::ImageRgb8(ImageBuffer::from_fn(width, height, pixel))
}
