//! What residuals count, and what is summed over patches.

use bytemuck::{Pod, Zeroable};
use nalgebra::{SMatrix, SVector};

use super::problem::{BOWED_ROW_LENGTH, ROW_LENGTH};

/// How residuals are weighted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResidualModel {
    /// Variance of an intensity that does not depend on the signal (linear light squared).
    pub read_variance: f32,
    /// Variance per unit of intensity (photon noise), linear light.
    pub photon_variance: f32,
    /// Huber threshold in standard deviations.
    pub huber: f32,
}

/// Outcome of one patch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PatchCost {
    /// Sum of the robust cost over the valid pixels, in squared standard deviations.
    pub cost: f32,
    /// Number of valid pixels.
    pub pixels: f32,
}

/// Sums of the normal equations of a path without bow.
pub type PhotometricSums = RowSums<ROW_LENGTH>;

/// Sums of the normal equations of a path with bow.
pub type BowedSums = RowSums<BOWED_ROW_LENGTH>;

/// Sums over all patches: `cost = sum rho(r)`, `hessian = sum w J^T J`, `gradient = sum w r J^T`, columns in the
/// order of [`ROW_LENGTH`] or [`BOWED_ROW_LENGTH`], left rotations of the ends.
#[derive(Clone, Debug, PartialEq)]
pub struct RowSums<const ROW: usize> {
    /// Robust cost.
    pub cost: f64,
    /// Number of valid pixels.
    pub pixels: f64,
    /// Gauss-Newton matrix.
    pub hessian: SMatrix<f64, ROW, ROW>,
    /// Gradient.
    pub gradient: SVector<f64, ROW>,
}

impl<const ROW: usize> Default for RowSums<ROW> {
    fn default() -> Self {
        Self { cost: 0.0, pixels: 0.0, hessian: SMatrix::zeros(), gradient: SVector::zeros() }
    }
}

/// Huber cost `rho(r)` and weight `rho'(r)/r` with threshold `delta`.
#[must_use]
#[inline]
pub fn huber(r: f32, delta: f32) -> (f32, f32) {
    let magnitude = r.abs();
    if magnitude <= delta {
        (0.5 * r * r, 1.0)
    } else {
        (delta * magnitude - 0.5 * delta * delta, delta / magnitude)
    }
}
