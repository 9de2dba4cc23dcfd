//! The images of a RUN folder: deblurred keyframes and their depth.

use std::fs;
use std::io;
use std::path::Path;

use mba_io::png::{encode_depth, encode_rgb};
use mba_io::run_layout::{DEBLURRED_FOLDER, DEPTH_FOLDER, deblurred_path};
use mba_io::whole_file::{read, write_together};

use super::{RunError, RunWriter};

/// What every PNG starts with.
const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";

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

    /// Copies the images of keyframe `index` that another run has, and counts them.
    ///
    /// # Errors
    /// As [`Self::write_deblurred`], and [`RunError::File`] for an image that cannot be read.
    pub fn copy_images(&mut self, from: &Path, index: usize) -> Result<(), RunError> {
        for name in [DEBLURRED_FOLDER, DEPTH_FOLDER] {
            let path = from.join(name).join(format!("{index:06}.png"));
            if path.is_file() {
                self.write_image(name, index, Ok(read(&path, PNG)?))?;
            }
        }
        if deblurred_path(from, index).is_file() {
            self.count_deblurred();
        }
        Ok(())
    }

    fn write_image(&self, folder: &str, index: usize, png: io::Result<Vec<u8>>) -> Result<(), RunError> {
        let folder = self.folder().join(folder);
        let path = folder.join(format!("{index:06}.png"));
        fs::create_dir_all(&folder).map_err(|reason| RunError::unwritable(&folder, reason))?;
        let png = png.map_err(|reason| RunError::unwritable(&path, reason))?;
        write_together(&[(path, png)]).map_err(RunError::from_write)
    }
}
