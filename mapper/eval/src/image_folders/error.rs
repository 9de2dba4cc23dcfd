//! Why folders cannot be compared.

use std::path::PathBuf;

use mba_io::FileError;
use mba_io::dataset::FrameReadError;

use crate::evaluation::ImageError;

/// Two folders of images, or two of their images, cannot be compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageFolderError {
    /// A folder cannot be read.
    #[error(transparent)]
    Folder(#[from] FileError),
    /// An image, or the captured frame, cannot be read.
    #[error(transparent)]
    Image(#[from] FrameReadError),
    /// No name occurs in both folders.
    #[error(
        "{reference} ({reference_images} images) and {estimate} ({estimate_images}) have no name in common"
    )]
    NoCommonName {
        /// Folder of the reference.
        reference: PathBuf,
        /// Number of its images.
        reference_images: usize,
        /// Folder of the estimate.
        estimate: PathBuf,
        /// Number of its images.
        estimate_images: usize,
    },
    /// Two images are of different size.
    #[error("{name}: the reference has {} x {} pixels, the {other} {} x {}", reference[0], reference[1], found[0], found[1])]
    SizesDiffer {
        /// Name of the pair.
        name: String,
        /// Width and height of the reference.
        reference: [usize; 2],
        /// What it is compared with: the estimate or the captured frame.
        other: &'static str,
        /// Its width and height.
        found: [usize; 2],
    },
    /// One image of a pair is a depth map, the other one is not.
    #[error("{name}: one is a depth map (16 bits, one channel), the other a colour image")]
    KindsDiffer {
        /// Name of the pair.
        name: String,
    },
    /// A captured frame is asked for, but the images are not named by numbers.
    #[error("{name} is not the index of a captured frame")]
    NotAnIndex {
        /// Name of the pair.
        name: String,
    },
    /// The images of a pair have no figure.
    #[error("{name}: {reason}")]
    NoFigure {
        /// Name of the pair.
        name: String,
        /// Why.
        reason: ImageError,
    },
}
