//! The figures of a comparison in the form that `--json` carries.

use serde::Serialize;

use crate::evaluation::{DepthDifference, ImageError, psnr, ssim};

/// Figures of two folders.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FolderFigures {
    /// Pairs of colour images by name.
    pub images: Vec<ColourFigures>,
    /// Means over the pairs of colour images; absent without any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean: Option<ColourMean>,
    /// Pairs of depth maps by name.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub depth: Vec<DepthFigures>,
    /// Mean over the pairs of depth maps of their differences in metres; absent if none shares a pixel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_depth_l1_m: Option<f64>,
    /// Images that only one of the folders has.
    pub unpaired: Unpaired,
}

/// A pair of colour images.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ColourFigures {
    /// Name without extension.
    pub name: String,
    /// The estimate.
    #[serde(flatten)]
    pub estimate: ImageFigures,
    /// The frame as it was captured, against the same reference.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub captured: Option<ImageFigures>,
}

/// How alike an image is to the reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ImageFigures {
    /// Peak signal-to-noise ratio in dB; infinite, in JSON null, for equal images.
    pub psnr_db: f64,
    /// Structural similarity, at most 1.
    pub ssim: f64,
}

impl ImageFigures {
    /// Compares 8-bit RGB images of `[width, height]` pixels.
    pub(super) fn new(size: [usize; 2], reference: &[u8], estimate: &[u8]) -> Result<Self, ImageError> {
        Ok(Self { psnr_db: psnr(reference, estimate)?, ssim: ssim(size, reference, estimate)? })
    }

    /// Means of both figures; none of nothing.
    fn mean(figures: &[Self]) -> Option<Self> {
        let mean = |value: fn(&Self) -> f64| figures.iter().map(value).sum::<f64>() / figures.len() as f64;
        (!figures.is_empty()).then(|| Self { psnr_db: mean(|f| f.psnr_db), ssim: mean(|f| f.ssim) })
    }
}

/// Means over images.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ColourMean {
    /// The estimates.
    #[serde(flatten)]
    pub estimate: ImageFigures,
    /// The captured frames, if they were compared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub captured: Option<ImageFigures>,
}

impl ColourMean {
    /// Means over all images.
    pub(super) fn of(images: &[ColourFigures]) -> Option<Self> {
        let estimates: Vec<_> = images.iter().map(|image| image.estimate).collect();
        let captured: Vec<_> = images.iter().filter_map(|image| image.captured).collect();
        Some(Self { estimate: ImageFigures::mean(&estimates)?, captured: ImageFigures::mean(&captured) })
    }
}

/// A pair of depth maps.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DepthFigures {
    /// Name without extension.
    pub name: String,
    /// Mean absolute difference in metres over the pixels with depth in both; absent if there are none.
    pub l1_m: Option<f64>,
    /// Share (0 to 1) of the pixels with depth in both.
    pub share: f64,
}

impl DepthFigures {
    pub(super) fn new(name: String, difference: &DepthDifference) -> Self {
        let DepthDifference { l1, share } = *difference;
        Self { name, l1_m: (share > 0.0).then_some(l1), share }
    }

    /// Mean over the maps that can be compared.
    pub(super) fn mean(maps: &[Self]) -> Option<f64> {
        let differences: Vec<f64> = maps.iter().filter_map(|map| map.l1_m).collect();
        (!differences.is_empty()).then(|| differences.iter().sum::<f64>() / differences.len() as f64)
    }
}

/// Numbers of images without a partner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Unpaired {
    /// Images that only the reference has.
    pub reference: usize,
    /// Images that only the estimate has.
    pub estimate: usize,
}
