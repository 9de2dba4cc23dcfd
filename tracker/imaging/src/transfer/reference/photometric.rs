//! Scalar robust cost and normal equations over all patches of a level.

use super::{patch_rows, patch_values};
use crate::math::sqrt_f32;
use crate::transfer::{
    PATCH_PIXELS, PATTERN_DU, PATTERN_DV, PatchCost, PatchRows, PatchSite, PatchValues, PhotometricSums,
    ROW_LENGTH, ResidualModel, TransferProblem, huber,
};

/// Scalar twin of [`crate::transfer::evaluate_cost`].
pub fn evaluate_cost(
    problem: &TransferProblem,
    sites: &[PatchSite],
    model: &ResidualModel,
    patches: &mut [PatchCost],
) -> PatchCost {
    let mut values = PatchValues::default();
    let (mut cost, mut pixels) = (0.0, 0.0);
    for (site, patch) in sites.iter().zip(patches) {
        patch_values(problem, site, &mut values);
        *patch = PatchCost::default();
        for k in 0..PATCH_PIXELS {
            if let Some((r, _)) = whitened_residual(problem, site, model, k, &values) {
                patch.cost += huber(r, model.huber).0;
                patch.pixels += 1.0;
            }
        }
        cost += f64::from(patch.cost);
        pixels += f64::from(patch.pixels);
    }
    PatchCost { cost: cost as f32, pixels: pixels as f32 }
}

/// Scalar twin of [`crate::transfer::linearize`].
pub fn linearize(
    problem: &TransferProblem,
    sites: &[PatchSite],
    model: &ResidualModel,
    patches: &mut [PatchCost],
) -> PhotometricSums {
    let mut rows = PatchRows::default();
    let mut sums = PhotometricSums::default();
    for (site, patch) in sites.iter().zip(patches) {
        patch_rows(problem, site, &mut rows);
        *patch = PatchCost::default();
        let mut h = [[0.0f32; ROW_LENGTH]; ROW_LENGTH];
        let mut g = [0.0f32; ROW_LENGTH];
        for k in 0..PATCH_PIXELS {
            let Some((r, inverse_sigma)) = whitened_residual(problem, site, model, k, &rows.values) else {
                continue;
            };
            let (cost, weight) = huber(r, model.huber);
            patch.cost += cost;
            patch.pixels += 1.0;
            // Derivatives of (gain mean + offset - observed)/sigma: twelve by the path, then by gain and offset.
            let mut row = [0.0f32; ROW_LENGTH];
            for (entry, column) in row.iter_mut().zip(&rows.pose) {
                *entry = problem.brightness.gain * inverse_sigma * column[k];
            }
            // By the gain and by the offset.
            row[12] = inverse_sigma * rows.values.mean[k];
            row[13] = inverse_sigma;
            add_row(&row, weight, r, &mut h, &mut g);
        }
        add_patch(patch, &h, &g, &mut sums);
    }
    sums.hessian.fill_lower_triangle_with_upper_triangle();
    sums
}

fn add_row(
    row: &[f32; ROW_LENGTH],
    weight: f32,
    r: f32,
    h: &mut [[f32; ROW_LENGTH]; ROW_LENGTH],
    g: &mut [f32; ROW_LENGTH],
) {
    for i in 0..ROW_LENGTH {
        let weighted = weight * row[i];
        g[i] += weighted * r;
        for (sum, entry) in h[i][i..].iter_mut().zip(&row[i..]) {
            *sum += weighted * entry;
        }
    }
}

fn add_patch(
    patch: &PatchCost,
    h: &[[f32; ROW_LENGTH]; ROW_LENGTH],
    g: &[f32; ROW_LENGTH],
    sums: &mut PhotometricSums,
) {
    sums.cost += f64::from(patch.cost);
    sums.pixels += f64::from(patch.pixels);
    for i in 0..ROW_LENGTH {
        sums.gradient[i] += f64::from(g[i]);
        for (j, &product) in h[i].iter().enumerate().skip(i) {
            sums.hessian[(i, j)] += f64::from(product);
        }
    }
}

/// Residual in standard deviations and the factor `1/sigma` it was divided by; `None` for a pixel that does not
/// count.
fn whitened_residual(
    problem: &TransferProblem,
    site: &PatchSite,
    model: &ResidualModel,
    k: usize,
    values: &PatchValues,
) -> Option<(f32, f32)> {
    if values.valid[k] <= 0.0 {
        return None;
    }
    let u = (i32::from(site.u) + PATTERN_DU[k]) as usize;
    let v = (i32::from(site.v) + PATTERN_DV[k]) as usize;
    let observed = problem.current.pixels[v * problem.current.width + u];
    // Noise of the sensor: a constant part, and shot noise that grows with the light.
    let inverse_sigma = 1.0 / sqrt_f32(model.read_variance + model.photon_variance * observed);
    let predicted = problem.brightness.gain * values.mean[k] + problem.brightness.offset;
    let r = (predicted - observed) * inverse_sigma;
    r.is_finite().then_some((r, inverse_sigma))
}
