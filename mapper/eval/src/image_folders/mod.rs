//! Folders of images against folders of images: which belong together, and how alike they are.
//!
//! Images are paired by their names without extension. Colour images are compared as stored, 8 bits per channel; 16-bit
//! images with one channel are depth maps.

mod compare;
mod error;
mod figures;
mod stored;

pub use compare::{Comparison, compare};
pub use error::ImageFolderError;
pub use figures::{ColourFigures, ColourMean, DepthFigures, FolderFigures, ImageFigures, Unpaired};
