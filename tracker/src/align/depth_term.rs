//! Depth term: the current depth map against the keyframe's surface at mid exposure.
//!
//! Depth is nearly free of motion blur and holds the mid pose; the photometric term gives the motion within the
//! exposure. A point of the current map is carried into the keyframe and its inverse depth there compared with
//! the keyframe's map. The normal of the surface enters through the slopes of the fitted planes, which makes this
//! the point-to-plane distance in units in which the sensor's noise is uniform.

use fearless_simd::{Level, dispatch, prelude::*};
use nalgebra::{Matrix6, Vector6};

use super::depth_accumulate::DepthBatch;
pub use super::depth_problem::{DepthProblem, DepthSums};
use super::depth_samples::DepthSampler;
use super::scale::{SIGMA_PER_MEDIAN_ABSOLUTE, median};
use crate::geometry::RigidTransform;
use crate::surface::spread_limit;

impl DepthProblem<'_> {
    /// Robust standard deviation of the residuals at `keyframe_from_camera`, 1/m, and the number of points behind
    /// it; `scratch` bounds the number of residuals that are looked at.
    pub fn noise_scale(
        &self,
        level: Level,
        keyframe_from_camera: &RigidTransform,
        scratch: &mut [f32],
    ) -> (f32, usize) {
        let count = self.absolute_residuals(level, keyframe_from_camera, scratch);
        (noise_of(&mut scratch[..count]), count)
    }

    /// Writes the magnitudes of the residuals at `keyframe_from_camera`, 1/m, as many as fit; returns their number.
    pub(super) fn absolute_residuals(
        &self,
        level: Level,
        keyframe_from_camera: &RigidTransform,
        magnitudes: &mut [f32],
    ) -> usize {
        dispatch!(level, simd => self.fill_magnitudes(simd, keyframe_from_camera, magnitudes))
    }

    #[inline(always)]
    fn fill_magnitudes<S: Simd>(
        &self,
        simd: S,
        keyframe_from_camera: &RigidTransform,
        magnitudes: &mut [f32],
    ) -> usize {
        let mut count = 0;
        DepthSampler::new(self, keyframe_from_camera).for_each_block(simd, |samples| {
            let compared = samples.compared.to_bitmask();
            for (lane, residual) in samples.residual.as_slice().iter().enumerate() {
                if compared >> lane & 1 == 1
                    && let Some(magnitude) = magnitudes.get_mut(count)
                {
                    *magnitude = residual.abs();
                    count += 1;
                }
            }
        });
        count
    }

    /// Robust cost and normal equations at `keyframe_from_camera` (mid exposure) for residuals of standard
    /// deviation `sigma`, with Huber threshold `delta` in standard deviations.
    #[must_use]
    pub fn linearise(
        &self,
        level: Level,
        keyframe_from_camera: &RigidTransform,
        sigma: f32,
        delta: f32,
    ) -> DepthSums {
        dispatch!(level, simd => self.sum_up(simd, keyframe_from_camera, sigma, delta))
    }

    #[inline(always)]
    fn sum_up<S: Simd>(
        &self,
        simd: S,
        keyframe_from_camera: &RigidTransform,
        sigma: f32,
        delta: f32,
    ) -> DepthSums {
        let mut sums = DepthSums {
            cost: 0.0,
            points: 0.0,
            gated: 0.0,
            hessian: Matrix6::zeros(),
            gradient: Vector6::zeros(),
        };
        let mut batch = DepthBatch::new(delta);
        let inverse_sigma = 1.0 / sigma;
        let mut gated = 0;
        DepthSampler::new(self, keyframe_from_camera).for_each_block(simd, |samples| {
            gated += samples.gated;
            batch.push(simd, samples, inverse_sigma, &mut sums);
        });
        batch.flush(simd, &mut sums);
        // Without their cost, a step that brings points into the gate would look like a step uphill.
        let clipped = delta.min(self.gate * inverse_sigma);
        sums.gated = gated as f64;
        sums.cost += sums.gated * f64::from(clipped * (self.gate * inverse_sigma - 0.5 * clipped));
        sums.hessian.fill_lower_triangle_with_upper_triangle();
        sums
    }
}

/// Robust standard deviation of residuals with these magnitudes, which are reordered.
pub(super) fn noise_of(magnitudes: &mut [f32]) -> f32 {
    SIGMA_PER_MEDIAN_ABSOLUTE * median(magnitudes)
}

/// Gate for a robust scale `sigma` around inverse depth of the scene: several deviations, but no farther than
/// another surface would be.
#[must_use]
pub fn gate_for(sigma: f32) -> f32 {
    (6.0 * sigma).clamp(0.012, 2.0 * spread_limit(0.3))
}
