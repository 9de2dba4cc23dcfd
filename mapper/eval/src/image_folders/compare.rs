//! All pairs of two folders.

use std::path::{Path, PathBuf};

use mba_io::dataset::Dataset;
use rayon::prelude::*;

use super::error::ImageFolderError;
use super::figures::{ColourFigures, ColourMean, DepthFigures, FolderFigures, ImageFigures, Unpaired};
use super::stored::{Pixels, StoredImage, list};
use crate::evaluation::{DepthDifference, ImageError, depth_difference};

/// What is compared.
#[derive(Clone, Copy)]
pub struct Comparison<'a> {
    /// Folder of the true images.
    pub reference: &'a Path,
    /// Folder of the images to judge.
    pub estimate: &'a Path,
    /// Data set of the captured frames: colour images are named by the index of the frame, and the frame is compared
    /// with the reference too.
    pub captured: Option<&'a Dataset>,
    /// Raw units per metre of depth maps, positive.
    pub depth_scale: f64,
}

/// Two images of a name.
struct Pair {
    name: String,
    reference: PathBuf,
    estimate: PathBuf,
}

/// Figures of a pair.
enum PairFigures {
    Colour(ColourFigures),
    Depth(DepthFigures),
}

/// Compares every image of the estimate with that of the same name in the reference, over all threads of the current
/// pool.
///
/// # Errors
/// [`ImageFolderError`] for a folder or image that cannot be read, for folders without a common name, and for the first
/// pair by name that cannot be compared.
pub fn compare(comparison: &Comparison) -> Result<FolderFigures, ImageFolderError> {
    let (pairs, unpaired) = pair(comparison)?;
    // All results before the first error: which error is told must not depend on the threads.
    let results: Vec<_> = pairs.into_par_iter().map(|pair| comparison.figures(pair)).collect();
    let (mut images, mut depth) = (Vec::new(), Vec::new());
    for figures in results {
        match figures? {
            PairFigures::Colour(figures) => images.push(figures),
            PairFigures::Depth(figures) => depth.push(figures),
        }
    }
    let (mean, mean_depth_l1_m) = (ColourMean::of(&images), DepthFigures::mean(&depth));
    Ok(FolderFigures { images, mean, depth, mean_depth_l1_m, unpaired })
}

/// Common names in their order, and how many images are left over.
fn pair(comparison: &Comparison) -> Result<(Vec<Pair>, Unpaired), ImageFolderError> {
    let [mut reference, estimate] = [list(comparison.reference)?, list(comparison.estimate)?];
    let [reference_images, estimate_images] = [reference.len(), estimate.len()];
    let pairs: Vec<Pair> = estimate
        .into_iter()
        .filter_map(|(name, estimate)| Some(Pair { reference: reference.remove(&name)?, name, estimate }))
        .collect();
    if pairs.is_empty() {
        return Err(ImageFolderError::NoCommonName {
            reference: comparison.reference.to_owned(),
            reference_images,
            estimate: comparison.estimate.to_owned(),
            estimate_images,
        });
    }
    let unpaired = Unpaired { reference: reference.len(), estimate: estimate_images - pairs.len() };
    Ok((pairs, unpaired))
}

impl Comparison<'_> {
    fn figures(&self, pair: Pair) -> Result<PairFigures, ImageFolderError> {
        let reference = StoredImage::read(&pair.reference)?;
        let estimate = StoredImage::read(&pair.estimate)?;
        let name = pair.name;
        check_size(&name, reference.size, "estimate", estimate.size)?;
        match (&reference.pixels, &estimate.pixels) {
            (Pixels::Colour(true_rgb), Pixels::Colour(rgb)) => {
                let captured = self.captured_figures(&name, reference.size, true_rgb)?;
                let estimate = ImageFigures::new(reference.size, true_rgb, rgb).map_err(no_figure(&name))?;
                Ok(PairFigures::Colour(ColourFigures { estimate, captured, name }))
            }
            (Pixels::Depth(true_depth), Pixels::Depth(depth)) => {
                let difference = self.depth_difference(true_depth, depth).map_err(no_figure(&name))?;
                Ok(PairFigures::Depth(DepthFigures::new(name, &difference)))
            }
            _ => Err(ImageFolderError::KindsDiffer { name }),
        }
    }

    /// The captured frame against the reference, if there is a data set.
    fn captured_figures(
        &self,
        name: &str,
        size: [usize; 2],
        true_rgb: &[u8],
    ) -> Result<Option<ImageFigures>, ImageFolderError> {
        let Some(dataset) = self.captured else { return Ok(None) };
        let index = name.parse().map_err(|_| ImageFolderError::NotAnIndex { name: name.to_owned() })?;
        let frame = dataset.frame(index)?;
        check_size(name, size, "captured frame", [frame.width, frame.height])?;
        ImageFigures::new(size, true_rgb, &frame.rgb).map(Some).map_err(no_figure(name))
    }

    fn depth_difference(&self, reference: &[u16], estimate: &[u16]) -> Result<DepthDifference, ImageError> {
        let metres = |raw: &[u16]| -> Vec<f64> {
            raw.iter().map(|&depth| f64::from(depth) / self.depth_scale).collect()
        };
        depth_difference(&metres(reference), &metres(estimate))
    }
}

fn no_figure(name: &str) -> impl Fn(ImageError) -> ImageFolderError {
    move |reason| ImageFolderError::NoFigure { name: name.to_owned(), reason }
}

fn check_size(
    name: &str,
    reference: [usize; 2],
    other: &'static str,
    found: [usize; 2],
) -> Result<(), ImageFolderError> {
    if reference == found {
        return Ok(());
    }
    Err(ImageFolderError::SizesDiffer { name: name.to_owned(), reference, other, found })
}
