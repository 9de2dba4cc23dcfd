//! Images in a folder.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use image::{ColorType, DynamicImage};

use mba_io::FileError;
use mba_io::dataset::{FrameReadError, read_image};

/// An image as it is compared.
pub(super) struct StoredImage {
    /// Width and height in pixels.
    pub(super) size: [usize; 2],
    pub(super) pixels: Pixels,
}

/// Pixels, row by row.
pub(super) enum Pixels {
    /// Bytes R, G, B per pixel.
    Colour(Vec<u8>),
    /// Raw units, 0 is missing.
    Depth(Vec<u16>),
}

impl StoredImage {
    pub(super) fn read(path: &Path) -> Result<Self, FrameReadError> {
        let image = read_image(path)?;
        let size = [image.width() as usize, image.height() as usize];
        let pixels = match image.color() {
            ColorType::L16 => Pixels::Depth(image.into_luma16().into_raw()),
            _ => Pixels::Colour(DynamicImage::into_rgb8(image).into_raw()),
        };
        Ok(Self { size, pixels })
    }
}

/// The images of a folder by their names without extension. Of several with the same name the first counts.
pub(super) fn list(folder: &Path) -> Result<BTreeMap<String, PathBuf>, FileError> {
    let unreadable = |reason: io::Error| FileError::Unreadable { path: folder.to_owned(), reason };
    let mut paths = Vec::new();
    for file in fs::read_dir(folder).map_err(unreadable)? {
        paths.push(file.map_err(unreadable)?.path());
    }
    paths.sort();
    let mut images = BTreeMap::new();
    for path in paths {
        if let Some(name) = image_name(&path) {
            images.entry(name).or_insert(path);
        }
    }
    Ok(images)
}

fn image_name(path: &Path) -> Option<String> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    matches!(extension.as_str(), "png" | "jpg" | "jpeg")
        .then(|| path.file_stem().map(|stem| stem.to_string_lossy().into_owned()))?
}
