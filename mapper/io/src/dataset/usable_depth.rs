//! Which pixels of a depth image count: those of some confidence, of a point that is not masked.
//!
//! `confidence/` has an image for each depth image, of its size and name: 0 is no confidence, as the depth cameras of
//! telephones write it. `mask/` (or `masks/`) has an image for each colour image, of its size: white is to be used, black
//! not. A mask is named as the image, with its ending replaced by or followed by `.png`.

use std::path::{Path, PathBuf};

use super::FrameReadError;
use super::frame::read_grey;

const CONFIDENCE: &str = "confidence";
const MASKS: [&str; 2] = ["mask", "masks"];

/// Least grey of a mask where a pixel is used.
const USED: u8 = 128;

/// The folders that a data set has, if any.
#[derive(Clone, Debug, Default)]
pub(super) struct UsableDepth {
    confidence: Option<PathBuf>,
    masks: Option<PathBuf>,
}

impl UsableDepth {
    /// What there is in the folder of a data set.
    pub(super) fn of(folder: &Path) -> Self {
        let existing = |name: &str| Some(folder.join(name)).filter(|path| path.is_dir());
        Self { confidence: existing(CONFIDENCE), masks: MASKS.into_iter().find_map(existing) }
    }

    /// Takes out depth without confidence; `size` (width, height) is that of the stored image at `path`. A depth image
    /// without a map of confidence stays as it is.
    ///
    /// # Errors
    ///
    /// [`FrameReadError`] if that map is damaged or of another size.
    pub(super) fn remove_unsure(
        &self,
        depth: &mut [u16],
        path: &Path,
        size: (usize, usize),
    ) -> Result<(), FrameReadError> {
        let Some(map) = self.confidence.as_deref().and_then(|folder| beside(folder, path)) else {
            return Ok(());
        };
        let confidence = read_grey(&map, size)?;
        let unsure = depth.iter_mut().zip(confidence).filter(|(_, confidence)| *confidence == 0);
        unsure.for_each(|(depth, _)| *depth = 0);
        Ok(())
    }

    /// Which pixels of the stored colour image at `path`, of `size`, are used: 1 for those, 0 for others. None without a
    /// mask.
    ///
    /// # Errors
    ///
    /// [`FrameReadError`] if the mask is damaged or of another size.
    pub(super) fn mask(&self, path: &Path, size: (usize, usize)) -> Result<Option<Vec<u16>>, FrameReadError> {
        let Some(mask) = self.masks.as_deref().and_then(|folder| beside(folder, path)) else {
            return Ok(None);
        };
        let grey = read_grey(&mask, size)?;
        Ok(Some(grey.into_iter().map(|value| u16::from(value >= USED)).collect()))
    }
}

/// The image in `folder` that belongs to the one at `path`.
fn beside(folder: &Path, path: &Path) -> Option<PathBuf> {
    let name = Path::new(path.file_name()?);
    let candidates = [name.with_extension("png"), name.with_added_extension("png"), name.to_owned()];
    candidates.into_iter().map(|name| folder.join(name)).find(|path| path.is_file())
}
