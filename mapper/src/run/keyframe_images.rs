//! The images of a RUN folder: deblurred keyframes and their depth.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::{RunError, RunWriter};
use crate::png::{encode_depth, encode_rgb};
use crate::whole_file::write_together;

/// Name of the folder of deblurred keyframes.
pub const DEBLURRED_FOLDER: &str = "deblurred";

/// Name of the folder of the keyframes' depth maps, 16 bit in the units of the data set.
pub const DEPTH_FOLDER: &str = "depth";

/// Where a run in `folder` keeps the deblurred image of keyframe `index`, the index of the frame in the data set.
#[must_use]
pub fn deblurred_path(folder: &Path, index: usize) -> PathBuf {
    folder.join(DEBLURRED_FOLDER).join(format!("{index:06}.png"))
}

impl RunWriter {
    /// Writes the deblurred image of keyframe `index`: `rgb` holds red, green, blue of each of `width * height`
    /// pixels, row-major, encoded as the data set's images are. Can be called from several threads.
    ///
    /// # Errors
    /// [`RunError::Unwritable`], also for an image that does not have that size, or [`RunError::DiskFull`].
    pub fn write_deblurred(
        &self,
        index: usize,
        [width, height]: [usize; 2],
        rgb: Vec<u8>,
    ) -> Result<(), RunError> {
        self.write_image(DEBLURRED_FOLDER, index, encode_rgb([width, height], &rgb))
    }

    /// Writes the depth of keyframe `index` at mid exposure: `depth` holds `width * height` raw depths, row-major; 0 where
    /// there is none. Can be called from several threads.
    ///
    /// # Errors
    /// As [`Self::write_deblurred`].
    pub fn write_depth(
        &self,
        index: usize,
        [width, height]: [usize; 2],
        depth: &[u16],
    ) -> Result<(), RunError> {
        self.write_image(DEPTH_FOLDER, index, encode_depth([width, height], depth))
    }

    fn write_image(&self, folder: &str, index: usize, png: io::Result<Vec<u8>>) -> Result<(), RunError> {
        let folder = self.folder().join(folder);
        let path = folder.join(format!("{index:06}.png"));
        fs::create_dir_all(&folder).map_err(|reason| RunError::unwritable(&folder, reason))?;
        let png = png.map_err(|reason| RunError::unwritable(&path, reason))?;
        write_together(&[(path, png)]).map_err(RunError::from_write)
    }
}

/// Removes the images of an earlier run in `folder`, and nothing else.
pub(super) fn remove_keyframe_images(folder: &Path) -> Result<(), RunError> {
    [DEBLURRED_FOLDER, DEPTH_FOLDER].iter().try_for_each(|images| remove_images(&folder.join(images)))
}

fn remove_images(images: &Path) -> Result<(), RunError> {
    let Ok(files) = fs::read_dir(images) else { return Ok(()) };
    for path in files.flatten().map(|file| file.path()).filter(|path| is_keyframe_image(path)) {
        fs::remove_file(&path).map_err(|reason| RunError::unwritable(&path, reason))?;
    }
    // Whatever else lies in the folder is somebody else's and stays.
    let _ = fs::remove_dir(images);
    Ok(())
}

fn is_keyframe_image(path: &Path) -> bool {
    let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    let is_number = stem.len() >= 6 && stem.bytes().all(|byte| byte.is_ascii_digit());
    is_number && path.extension().is_some_and(|extension| extension == "png")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_images_of_keyframes_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let images = folder.path().join(DEBLURRED_FOLDER);
        remove_keyframe_images(folder.path()).unwrap();
        fs::create_dir(&images).unwrap();
        for name in ["000012.png", "1234567.png", "notes.png", "000012.txt"] {
            fs::write(images.join(name), "").unwrap();
        }
        remove_keyframe_images(folder.path()).unwrap();
        let mut left: Vec<_> = fs::read_dir(&images).unwrap().map(|file| file.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, ["000012.txt", "notes.png"]);
    }
}
