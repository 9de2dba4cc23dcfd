//! `mba eval images`.

use mba_mapper::dataset::FrameReadError;
use mba_mapper::image_folders::{Comparison, ImageFolderError, compare};
use mba_tracker::SimdLevel;

use super::open;
use crate::args::EvalImages;
use crate::console::Console;
use crate::failure::OrBadInput;
use crate::report::image_table;

/// Compares two folders of images and prints the figures.
///
/// # Errors
/// Bad input when a folder or image is unreadable or the two do not belong together.
pub fn run(args: &EvalImages, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let dataset = args.captured.as_deref().map(|folder| open::dataset(folder, simd)).transpose()?;
    let comparison = Comparison {
        reference: &args.reference,
        estimate: &args.estimate,
        captured: dataset.as_ref(),
        depth_scale: args.depth_scale,
    };
    let figures = compare(&comparison)
        .map_err(|error| (hint(&error), error))
        .or_else(|(hint, error)| Err(error).or_bad_input(hint))?;
    console.result(&figures, image_table::folders)
}

fn hint(error: &ImageFolderError) -> &'static str {
    match error {
        ImageFolderError::Folder(_) => "give folders of .png or .jpg images",
        ImageFolderError::NoCommonName { .. } => {
            "images of both folders are paired by their names without extension; rename those of one folder"
        }
        ImageFolderError::SizesDiffer { .. } => "render or resize the images to one size",
        ImageFolderError::KindsDiffer { .. } => "keep colour images and depth maps in different folders",
        ImageFolderError::NotAnIndex { .. }
        | ImageFolderError::Image(FrameReadError::IndexOutOfRange { .. }) => {
            "--captured is for images named by the index of their frame, such as 000012.png; else leave it out"
        }
        ImageFolderError::Image(_) => "restore or remove that image",
        _ => "remove that image from one of the folders",
    }
}
