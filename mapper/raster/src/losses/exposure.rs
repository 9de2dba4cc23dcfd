//! One exposure that a map is compared with, and what comes of it.

use nalgebra::SVector;

use super::image_loss::LossTerms;
use crate::exposure::{ExposurePath, PATH_PARAMETERS};
use crate::sensor::Observation;

/// What a frame is compared with.
#[derive(Clone, Copy, Debug)]
pub struct Exposure<'a> {
    /// What was captured, at the resolution of the plan.
    pub seen: &'a Observation,
    /// Path of the camera.
    pub path: &'a ExposurePath,
    /// Gain on the map's light.
    pub gain: f64,
    /// Number of virtual views of the exposure of a row.
    pub views: usize,
}

/// Loss of an exposure, and gradients by what belongs to it alone.
#[derive(Clone, Copy, Debug)]
pub struct ExposureLoss {
    /// The terms.
    pub terms: LossTerms,
    /// Gradient by the parameters of the path.
    pub grad_path: SVector<f64, PATH_PARAMETERS>,
    /// Gradient by the logarithm of the gain.
    pub grad_log_gain: f64,
}
