//! Normal equations of the depth term, a batch of points at a time.
//!
//! # Layout and cost
//!
//! A lane is a point; a batch is stored as seven columns (six of the Jacobian row, the residual). Per eight points
//! about 70 arithmetic operations, no gathers. Sums are single precision within a batch, double across batches.

use fearless_simd::{f32x8, prelude::*};

use super::depth_problem::DepthSums;
use super::depth_samples::{DepthSamples, LANES};

/// Points per batch: whole blocks.
const BATCH: usize = 8 * LANES;

/// Points waiting to be summed.
pub(super) struct DepthBatch {
    /// Translation row, rotation row, residual; in standard deviations.
    columns: [[f32; BATCH]; 7],
    len: usize,
    delta: f32,
}

impl DepthBatch {
    pub(super) fn new(delta: f32) -> Self {
        Self { columns: [[0.0; BATCH]; 7], len: 0, delta }
    }

    /// Adds eight points, each residual divided by its standard deviation.
    #[inline(always)]
    pub(super) fn push<S: Simd>(
        &mut self,
        simd: S,
        samples: &DepthSamples<S>,
        inverse_sigma: f32,
        sums: &mut DepthSums,
    ) {
        let [x, y, z] = samples.normal.map(|normal| normal * inverse_sigma);
        let [a, b, c] = samples.arm;
        // The lever arm times the normal, as a cross product.
        let turn = [b * z - c * y, c * x - a * z, a * y - b * x];
        let row = [x, y, z, turn[0], turn[1], turn[2], samples.residual * inverse_sigma];
        for (column, value) in self.columns.iter_mut().zip(row) {
            value.store_slice(&mut column[self.len..self.len + LANES]);
        }
        self.len += LANES;
        sums.points += f64::from(samples.compared.to_bitmask().count_ones());
        if self.len == BATCH {
            self.flush(simd, sums);
        }
    }

    /// Moves the waiting points into `sums`.
    #[inline(always)]
    pub(super) fn flush<S: Simd>(&mut self, simd: S, sums: &mut DepthSums) {
        for column in &mut self.columns {
            column[self.len..].fill(0.0);
        }
        let zero = f32x8::splat(simd, 0.0);
        let mut hessian = [zero; 21];
        let mut gradient = [zero; 6];
        let mut cost = zero;
        for k in (0..BATCH).step_by(8) {
            let load = |column: &[f32; BATCH]| f32x8::from_slice(simd, &column[k..k + 8]);
            let residual = load(&self.columns[6]);
            let magnitude = residual.abs();
            // min(1, delta/|r|) is the Huber weight; w r (|r| - w |r| / 2) its cost.
            let weight = (f32x8::splat(simd, self.delta) / magnitude.max(1e-12)).min(1.0);
            let clipped = weight * magnitude;
            cost += clipped * (magnitude - clipped * 0.5);
            let row: [f32x8<S>; 6] = core::array::from_fn(|i| load(&self.columns[i]));
            let mut entry = 0;
            for i in 0..6 {
                let weighted = weight * row[i];
                gradient[i] = weighted.mul_add(residual, gradient[i]);
                for &other in &row[i..] {
                    hessian[entry] = weighted.mul_add(other, hessian[entry]);
                    entry += 1;
                }
            }
        }
        let total = |lanes: f32x8<S>| f64::from(lanes.as_slice().iter().sum::<f32>());
        sums.cost += total(cost);
        let mut entries = hessian.into_iter();
        for (i, lanes) in gradient.into_iter().enumerate() {
            sums.gradient[i] += total(lanes);
            for (j, entry) in (i..6).zip(&mut entries) {
                sums.hessian[(i, j)] += total(entry);
            }
        }
        self.len = 0;
    }
}
