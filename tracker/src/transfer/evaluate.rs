//! The photometric term of one pyramid level: robust cost and normal equations over all patches.

use bytemuck::{Pod, Zeroable};
use nalgebra::{SMatrix, SVector};

use super::problem::{PatchRows, PatchSite, PatchValues, ROW_LENGTH, TransferProblem};
use super::reference;
use super::{PATCH_PIXELS, PATTERN_DU, PATTERN_DV};
use crate::math::sqrt_f32;

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

/// Sums over all patches: `cost = sum rho(r)`, `hessian = sum w J^T J`, `gradient = sum w r J^T`, columns in the
/// order of [`ROW_LENGTH`], left rotations.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotometricSums {
    /// Robust cost.
    pub cost: f64,
    /// Number of valid pixels.
    pub pixels: f64,
    /// Gauss-Newton matrix.
    pub hessian: SMatrix<f64, ROW_LENGTH, ROW_LENGTH>,
    /// Gradient.
    pub gradient: SVector<f64, ROW_LENGTH>,
}

impl Default for PhotometricSums {
    fn default() -> Self {
        Self { cost: 0.0, pixels: 0.0, hessian: SMatrix::zeros(), gradient: SVector::zeros() }
    }
}

/// Robust cost of every patch; `patches` has the length of `sites`. Returns the sums over all patches.
pub fn evaluate_cost(
    problem: &TransferProblem,
    sites: &[PatchSite],
    model: &ResidualModel,
    patches: &mut [PatchCost],
) -> PatchCost {
    let mut values = PatchValues::default();
    let mut total = PatchCost::default();
    for (site, patch) in sites.iter().zip(patches) {
        reference::patch_values(problem, site, &mut values);
        *patch = PatchCost::default();
        for k in 0..PATCH_PIXELS {
            if values.valid[k] > 0.0 {
                let (r, _) = whitened_residual(problem, site, model, k, values.mean[k]);
                patch.cost += huber(r, model.huber).0;
                patch.pixels += 1.0;
            }
        }
        total.cost += patch.cost;
        total.pixels += patch.pixels;
    }
    total
}

/// Normal equations and robust cost of all patches.
pub fn linearize(
    problem: &TransferProblem,
    sites: &[PatchSite],
    model: &ResidualModel,
    patches: &mut [PatchCost],
) -> PhotometricSums {
    let mut rows = PatchRows::default();
    let mut sums = PhotometricSums::default();
    for (site, patch) in sites.iter().zip(patches) {
        reference::patch_rows(problem, site, &mut rows);
        *patch = PatchCost::default();
        let mut h = [[0.0f32; ROW_LENGTH]; ROW_LENGTH];
        let mut g = [0.0f32; ROW_LENGTH];
        for k in 0..PATCH_PIXELS {
            if rows.values.valid[k] <= 0.0 {
                continue;
            }
            let (r, inverse_sigma) = whitened_residual(problem, site, model, k, rows.values.mean[k]);
            let (cost, weight) = huber(r, model.huber);
            patch.cost += cost;
            patch.pixels += 1.0;
            let mut row = [0.0f32; ROW_LENGTH];
            for (entry, column) in row.iter_mut().zip(&rows.pose) {
                *entry = problem.brightness.gain * inverse_sigma * column[k];
            }
            row[12] = inverse_sigma * rows.values.mean[k];
            row[13] = inverse_sigma;
            for i in 0..ROW_LENGTH {
                let weighted = weight * row[i];
                g[i] += weighted * r;
                for j in i..ROW_LENGTH {
                    h[i][j] += weighted * row[j];
                }
            }
        }
        sums.cost += f64::from(patch.cost);
        sums.pixels += f64::from(patch.pixels);
        for i in 0..ROW_LENGTH {
            sums.gradient[i] += f64::from(g[i]);
            for j in i..ROW_LENGTH {
                sums.hessian[(i, j)] += f64::from(h[i][j]);
            }
        }
    }
    sums.hessian.fill_lower_triangle_with_upper_triangle();
    sums
}

/// Residual in standard deviations and the factor `1/sigma` it was divided by.
fn whitened_residual(
    problem: &TransferProblem,
    site: &PatchSite,
    model: &ResidualModel,
    k: usize,
    mean: f32,
) -> (f32, f32) {
    let u = (i32::from(site.u) + PATTERN_DU[k]) as usize;
    let v = (i32::from(site.v) + PATTERN_DV[k]) as usize;
    let observed = problem.current.pixels[v * problem.current.width + u];
    let inverse_sigma = 1.0 / sqrt_f32(model.read_variance + model.photon_variance * observed);
    let predicted = problem.brightness.gain * mean + problem.brightness.offset;
    ((predicted - observed) * inverse_sigma, inverse_sigma)
}

/// Huber cost `rho(r)` and weight `rho'(r)/r` with threshold `delta`.
#[must_use]
pub fn huber(r: f32, delta: f32) -> (f32, f32) {
    let magnitude = r.abs();
    if magnitude <= delta {
        (0.5 * r * r, 1.0)
    } else {
        (delta * magnitude - 0.5 * delta * delta, delta / magnitude)
    }
}
