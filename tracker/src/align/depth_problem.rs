//! What the depth term is given, and what it sums up.

use nalgebra::{Matrix6, Vector6};

use crate::geometry::PinholeCamera;
use crate::surface::{InverseDepthMap, SurfacePlanes};
use crate::transfer::RowBand;

/// Inputs of the depth term.
#[derive(Clone, Copy, Debug)]
pub struct DepthProblem<'a> {
    /// Current inverse depth.
    pub current: &'a InverseDepthMap<'a>,
    /// Inverse depth of the keyframe.
    pub keyframe: &'a InverseDepthMap<'a>,
    /// Surface planes of the keyframe.
    pub planes: &'a SurfacePlanes<'a>,
    /// Camera of the maps' pyramid level.
    pub camera: PinholeCamera,
    /// Step between the pixels of the current map that take part.
    pub stride: usize,
    /// Residuals beyond this many 1/m belong to another surface: they cost as much as one at the gate and pull
    /// nowhere.
    pub gate: f32,
    /// Rows of the current map that take part: those that were measured at the pose in question.
    pub band: RowBand,
}

/// Sums of the depth term for the mid pose, tangent (translation, left rotation) in the keyframe.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthSums {
    /// Robust cost in squared standard deviations.
    pub cost: f64,
    /// Number of compared points within the gate.
    pub points: f64,
    /// Number of compared points beyond the gate.
    pub gated: f64,
    /// Gauss-Newton matrix.
    pub hessian: Matrix6<f64>,
    /// Gradient.
    pub gradient: Vector6<f64>,
}
