//! Block means of a raw depth map.

use crate::geometry::PinholeCamera;
use crate::image::DepthView;
use crate::workspace::{Arena, WorkspaceError};

/// Inverse depth in 1/m on a pyramid level; 0 is missing.
#[derive(Debug)]
pub struct InverseDepthMap<'m> {
    /// `width * height` values, row-major.
    pub values: &'m mut [f32],
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Pyramid level: a value is the mean over `2^level x 2^level` raw pixels.
    pub level: usize,
}

/// Largest difference of inverse depth, 1/m, within a neighbourhood that counts as one surface around `rho`:
/// several times the noise of structured-light sensors plus the slope of a slanted surface.
#[inline]
#[must_use]
pub fn spread_limit(rho: f32) -> f32 {
    0.015 + 0.04 * rho
}

impl<'m> InverseDepthMap<'m> {
    /// Takes the memory of a map on `level` of `camera`'s images; all values are missing.
    ///
    /// # Errors
    /// [`WorkspaceError`] when the arena is exhausted.
    pub fn carve(
        arena: &mut Arena<'m>,
        camera: &PinholeCamera,
        level: usize,
    ) -> Result<Self, WorkspaceError> {
        let (width, height) = (camera.width >> level, camera.height >> level);
        Ok(Self { values: arena.take(width * height)?, width, height, level })
    }

    /// Fills the map from the rows of a raw depth image (0 = missing).
    ///
    /// A block is missing when fewer than half of its pixels are measured or when they spread over more than one
    /// surface: a mean across a depth edge lies on neither side. Returns the share of blocks with a value.
    pub fn fill(&mut self, raw: &DepthView, metres_per_unit: f32) -> f32 {
        let block = 1usize << self.level;
        let mut measured = 0usize;
        for v in 0..self.height {
            let out = &mut self.values[v * self.width..][..self.width];
            for (u, value) in out.iter_mut().enumerate() {
                *value = block_inverse_depth(raw, u * block, v * block, block, metres_per_unit);
                measured += usize::from(*value > 0.0);
            }
        }
        measured as f32 / (self.width * self.height).max(1) as f32
    }

    /// Mean of the measured values, 1/m; `None` if there is none.
    #[must_use]
    pub fn mean(&self) -> Option<f32> {
        let (sum, count) = self
            .values
            .iter()
            .filter(|&&rho| rho > 0.0)
            .fold((0.0f64, 0usize), |(s, n), &rho| (s + f64::from(rho), n + 1));
        (count > 0).then(|| (sum / count as f64) as f32)
    }

    /// Bilinear inverse depth at `(u, v)` of this level, or `None` where a neighbour is missing, outside, or on
    /// another surface.
    #[inline]
    #[must_use]
    pub fn sample(&self, u: f32, v: f32) -> Option<f32> {
        let limit_u = (self.width - 1) as f32;
        let limit_v = (self.height - 1) as f32;
        if !(u >= 0.0 && v >= 0.0 && u < limit_u && v < limit_v) {
            return None;
        }
        let (i, j) = (u as usize, v as usize);
        let (fu, fv) = (u - i as f32, v - j as f32);
        let top = &self.values[j * self.width + i..][..2];
        let bottom = &self.values[(j + 1) * self.width + i..][..2];
        let low = top[0].min(top[1]).min(bottom[0].min(bottom[1]));
        let high = top[0].max(top[1]).max(bottom[0].max(bottom[1]));
        if !(low > 0.0 && high - low < spread_limit(low)) {
            return None;
        }
        let t0 = top[0] + fu * (top[1] - top[0]);
        let t1 = bottom[0] + fu * (bottom[1] - bottom[0]);
        Some(t0 + fv * (t1 - t0))
    }
}

fn block_inverse_depth(raw: &DepthView, u: usize, v: usize, block: usize, metres_per_unit: f32) -> f32 {
    let (mut nearest, mut farthest) = (u16::MAX, 0u16);
    let (mut sum, mut count) = (0.0f32, 0usize);
    for row in 0..block {
        for &value in &raw.row(v + row)[u..][..block] {
            if value > 0 {
                nearest = nearest.min(value);
                farthest = farthest.max(value);
                sum += 1.0 / f32::from(value);
                count += 1;
            }
        }
    }
    if count == 0 || 2 * count < block * block {
        return 0.0;
    }
    let per_metre = 1.0 / metres_per_unit;
    let (high, low) = (per_metre / f32::from(nearest), per_metre / f32::from(farthest));
    if high - low > spread_limit(low) { 0.0 } else { sum * per_metre / count as f32 }
}
