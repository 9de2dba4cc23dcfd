//! From predicted intensities to robust cost and normal equations, 32 pixels at a time.
//!
//! Every entry of the normal equations is kept as one vector of partial sums, lane by lane, over a few patches:
//! at most [`PATCH_PIXELS`] additions in f32 per lane, then one horizontal sum into f64. That is as exact as f32
//! within a patch and f64 across patches, and saves all but a fraction of the 119 horizontal sums per patch.

use fearless_simd::prelude::*;

use super::evaluate::{PatchCost, PhotometricSums, ResidualModel};
use super::kernel::load;
use super::pattern::{PATCH_PIXELS, PATTERN_DU, PATTERN_DV, PATTERN_RADIUS};
use super::problem::{BrightnessModel, LevelImage, PatchRows, PatchSite, PatchValues, ROW_LENGTH};

/// Products of two columns of (row, residual), upper triangle without the squared residual.
const ENTRIES: usize = ROW_LENGTH * (ROW_LENGTH + 1) / 2 + ROW_LENGTH;

/// The residual stands behind the row, as if it were one more column.
const RESIDUAL: usize = ROW_LENGTH;

/// Turns predictions into whitened, robustly weighted residuals.
pub(super) struct Whitening<'a, S: Simd> {
    simd: S,
    current: LevelImage<'a>,
    brightness: BrightnessModel,
    model: ResidualModel,
}

/// Residuals of one vector of pixels; everything is zero in lanes that do not count.
struct Whitened<S: Simd> {
    /// `(predicted - observed)/sigma`.
    residual: S::f32s,
    inverse_sigma: S::f32s,
    /// Huber weight.
    weight: S::f32s,
    cost: S::f32s,
    /// One in lanes that count.
    count: S::f32s,
}

impl<'a, S: Simd> Whitening<'a, S> {
    #[inline(always)]
    pub(super) fn new(
        simd: S,
        current: &LevelImage<'a>,
        brightness: &BrightnessModel,
        model: &ResidualModel,
    ) -> Self {
        Self { simd, current: *current, brightness: *brightness, model: *model }
    }

    /// Robust cost of a patch.
    #[inline(always)]
    pub(super) fn cost(&self, site: &PatchSite, values: &PatchValues) -> PatchCost {
        let observed = observed_intensities(&self.current, site);
        let mut cost = S::f32s::splat(self.simd, 0.0);
        let mut count = cost;
        for k in (0..PATCH_PIXELS).step_by(S::f32s::LEN) {
            let whitened = self.whiten(values, &observed, k);
            cost += whitened.cost;
            count += whitened.count;
        }
        PatchCost { cost: cost.reduce_sum(), pixels: count.reduce_sum() }
    }

    #[inline(always)]
    fn whiten(&self, values: &PatchValues, observed: &[f32; PATCH_PIXELS], k: usize) -> Whitened<S> {
        let (zero, one) = (S::f32s::splat(self.simd, 0.0), S::f32s::splat(self.simd, 1.0));
        let observed = load(self.simd, observed, k);
        let variance = observed * self.model.photon_variance + self.model.read_variance;
        let inverse_sigma = one / variance.sqrt();
        let predicted = load(self.simd, &values.mean, k) * self.brightness.gain + self.brightness.offset;
        let residual = (predicted - observed) * inverse_sigma;
        let counts = load(self.simd, &values.valid, k).simd_gt(0.0) & residual.is_finite();
        let residual = counts.select(residual, zero);
        let magnitude = residual.abs();
        let delta = self.model.huber;
        let inside = magnitude.simd_le(delta);
        let weight = inside.select(one, S::f32s::splat(self.simd, delta) / magnitude);
        let cost = inside.select(residual * residual * 0.5, magnitude * delta - 0.5 * delta * delta);
        Whitened {
            residual,
            inverse_sigma: counts.select(inverse_sigma, zero),
            weight: counts.select(weight, zero),
            cost,
            count: counts.select(one, zero),
        }
    }
}

/// Normal equations while they are being summed.
pub(super) struct NormalEquations<S: Simd> {
    simd: S,
    lanes: [S::f32s; ENTRIES],
    totals: [f64; ENTRIES],
    cost: f64,
    pixels: f64,
    pending_patches: usize,
}

impl<S: Simd> NormalEquations<S> {
    #[inline(always)]
    pub(super) fn new(simd: S) -> Self {
        let zero = S::f32s::splat(simd, 0.0);
        Self {
            simd,
            lanes: [zero; ENTRIES],
            totals: [0.0; ENTRIES],
            cost: 0.0,
            pixels: 0.0,
            pending_patches: 0,
        }
    }

    /// Adds a patch and returns its robust cost.
    #[inline(always)]
    pub(super) fn add(&mut self, whitening: &Whitening<S>, site: &PatchSite, rows: &PatchRows) -> PatchCost {
        let observed = observed_intensities(&whitening.current, site);
        let mut cost = S::f32s::splat(self.simd, 0.0);
        let mut count = cost;
        for k in (0..PATCH_PIXELS).step_by(S::f32s::LEN) {
            let whitened = whitening.whiten(&rows.values, &observed, k);
            cost += whitened.cost;
            count += whitened.count;
            self.add_products(&self.columns(whitening.brightness.gain, &whitened, rows, k));
        }
        let patch = PatchCost { cost: cost.reduce_sum(), pixels: count.reduce_sum() };
        self.cost += f64::from(patch.cost);
        self.pixels += f64::from(patch.pixels);
        self.pending_patches += 1;
        // LEN patches of 32/LEN vectors each: 32 additions per lane.
        if self.pending_patches == S::f32s::LEN {
            self.flush();
        }
        patch
    }

    /// Row and residual, both times the square root of the weight.
    #[inline(always)]
    fn columns(
        &self,
        gain: f32,
        whitened: &Whitened<S>,
        rows: &PatchRows,
        k: usize,
    ) -> [S::f32s; ROW_LENGTH + 1] {
        let root = whitened.weight.sqrt();
        let scale = root * whitened.inverse_sigma;
        let pose_scale = scale * gain;
        core::array::from_fn(|i| match i {
            0..12 => load(self.simd, &rows.pose[i], k) * pose_scale,
            12 => load(self.simd, &rows.values.mean, k) * scale,
            13 => scale,
            _ => whitened.residual * root,
        })
    }

    #[inline(always)]
    fn add_products(&mut self, columns: &[S::f32s; ROW_LENGTH + 1]) {
        let mut entry = 0;
        for i in 0..ROW_LENGTH {
            for j in i..=RESIDUAL {
                self.lanes[entry] = columns[i].mul_add(columns[j], self.lanes[entry]);
                entry += 1;
            }
        }
    }

    #[inline(always)]
    fn flush(&mut self) {
        for (total, lanes) in self.totals.iter_mut().zip(&mut self.lanes) {
            *total += f64::from(lanes.reduce_sum());
            *lanes = S::f32s::splat(self.simd, 0.0);
        }
        self.pending_patches = 0;
    }

    /// The sums over all patches added so far.
    #[inline(always)]
    pub(super) fn finish(mut self) -> PhotometricSums {
        self.flush();
        let mut sums = PhotometricSums { cost: self.cost, pixels: self.pixels, ..PhotometricSums::default() };
        let mut entries = self.totals.iter();
        for i in 0..ROW_LENGTH {
            for j in i..=RESIDUAL {
                let entry = entries.next().copied().unwrap_or(0.0);
                if j == RESIDUAL {
                    sums.gradient[i] = entry;
                } else {
                    sums.hessian[(i, j)] = entry;
                    sums.hessian[(j, i)] = entry;
                }
            }
        }
        sums
    }
}

/// Intensities of the pattern pixels in the current image, zero outside of it.
#[inline(always)]
fn observed_intensities(image: &LevelImage, site: &PatchSite) -> [f32; PATCH_PIXELS] {
    let (u, v) = (usize::try_from(site.u), usize::try_from(site.v));
    if let (Ok(u), Ok(v)) = (u, v)
        && u >= PATTERN_RADIUS
        && v >= PATTERN_RADIUS
        && u + PATTERN_RADIUS <= image.width
        && let Some(patch) = image.pixels.get((v - PATTERN_RADIUS) * image.width + u - PATTERN_RADIUS..)
        && patch.len() >= (2 * PATTERN_RADIUS - 1) * image.width + 2 * PATTERN_RADIUS
    {
        return core::array::from_fn(|k| {
            let row = (PATTERN_DV[k] + PATTERN_RADIUS as i32) as usize;
            let column = (PATTERN_DU[k] + PATTERN_RADIUS as i32) as usize;
            patch[row * image.width + column]
        });
    }
    core::array::from_fn(|k| observed_intensity(image, site, k).unwrap_or(0.0))
}

fn observed_intensity(image: &LevelImage, site: &PatchSite, k: usize) -> Option<f32> {
    let u = usize::try_from(i32::from(site.u) + PATTERN_DU[k]).ok().filter(|&u| u < image.width)?;
    let v = usize::try_from(i32::from(site.v) + PATTERN_DV[k]).ok()?;
    image.pixels.get(v * image.width + u).copied()
}
