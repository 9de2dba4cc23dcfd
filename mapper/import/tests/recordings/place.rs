//! Where recordings lie and data sets go.

use std::fs;
use std::path::{Path, PathBuf};

use mba_import::{ImportError, ImportOptions, Imported, Source, import};
use mba_io::dataset::{self, Dataset};
use tempfile::TempDir;

/// A file of the tests.
pub(crate) fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

/// A data set that was brought in.
pub(crate) struct Brought {
    _root: TempDir,
    pub(crate) folder: PathBuf,
    pub(crate) imported: Imported,
    pub(crate) dataset: Dataset,
}

/// Brings a recording in.
pub(crate) fn bring(source: &Path, options: &ImportOptions) -> Result<Brought, ImportError> {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("data");
    let source = Source::recognise(source)?;
    let imported = import(&source, &folder, options, &|_, _| ())?;
    let dataset = dataset::open(&folder).unwrap();
    Ok(Brought { _root: root, folder, imported, dataset })
}

impl Brought {
    /// A text of the data set.
    pub(crate) fn text(&self, name: &str) -> String {
        fs::read_to_string(self.folder.join(name)).unwrap()
    }

    /// The lines of a text that are no comments.
    pub(crate) fn lines(&self, name: &str) -> Vec<String> {
        self.text(name).lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect()
    }

    /// The pixels of a colour image as stored.
    pub(crate) fn rgb(&self, name: &str) -> Vec<u8> {
        image::open(self.folder.join(name)).unwrap().into_rgb8().into_raw()
    }

    /// The pixels of an image of 16 bits as stored.
    pub(crate) fn depth(&self, name: &str) -> Vec<u16> {
        match image::open(self.folder.join(name)).unwrap() {
            image::DynamicImage::ImageLuma16(image) => image.into_raw(),
            other => panic!("{name} is {:?}", other.color()),
        }
    }
}

/// The colour of the pixels of image `k`, as the scripts have it.
pub(crate) fn colour(k: usize, (width, height): (usize, usize)) -> Vec<u8> {
    let pixel =
        |index: usize| [10 * (index % width) + k, 20 * (index / width), 200 - k].map(|value| value as u8);
    (0..width * height).flat_map(pixel).collect()
}

/// The depth of the pixels of image `k`, as the scripts have it.
pub(crate) fn depth(k: usize, (width, height): (usize, usize)) -> Vec<u16> {
    (0..width * height).map(|index| (1000 + index % width + 8 * (index / width) + 100 * k) as u16).collect()
}
