//! From predicted intensities to robust cost and normal equations, 32 pixels at a time.
//!
//! Every entry of the normal equations is kept as one vector of partial sums, lane by lane, over a few patches:
//! at most [`PATCH_PIXELS`] additions in f32 per lane, then one horizontal sum into f64. That is as exact as f32
//! within a patch and f64 across patches, and saves all but a fraction of the 119 horizontal sums per patch.

use fearless_simd::prelude::*;
use nalgebra::{SMatrix, SVector};

use super::kernel::{load, store};
use super::pattern::{PATCH_PIXELS, PATTERN_DU, PATTERN_DV, PATTERN_RADIUS};
use super::problem::{BrightnessModel, LevelImage, PatchRows, PatchSite, PatchValues};
use super::sums::{PatchCost, ResidualModel, RowSums};

/// Vectors of a patch when a vector has the least number of lanes, four.
const MAX_VECTORS: usize = PATCH_PIXELS / 4;

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

/// Aligned, so that no vector straddles two cache lines.
#[repr(align(64))]
struct Columns<const ROW: usize> {
    row: [[f32; PATCH_PIXELS]; ROW],
    residual: [f32; PATCH_PIXELS],
}

/// Normal equations of rows with `ROW` columns, an even number, while they are being summed.
pub(super) struct NormalEquations<S: Simd, const ROW: usize> {
    simd: S,
    /// The columns of one patch: row and residual of every pixel.
    columns: Columns<ROW>,
    /// `lanes[i][j]`: products of columns i and j, of which those with `i <= j` are summed.
    lanes: [[S::f32s; ROW]; ROW],
    /// Products of the columns with the residual.
    gradient_lanes: [S::f32s; ROW],
    totals: [[f64; ROW]; ROW],
    gradient: [f64; ROW],
    cost: f64,
    pixels: f64,
    pending_patches: usize,
}

impl<S: Simd, const ROW: usize> NormalEquations<S, ROW> {
    #[inline(always)]
    pub(super) fn new(simd: S) -> Self {
        let zero = S::f32s::splat(simd, 0.0);
        Self {
            simd,
            columns: Columns { row: [[0.0; PATCH_PIXELS]; ROW], residual: [0.0; PATCH_PIXELS] },
            lanes: [[zero; ROW]; ROW],
            gradient_lanes: [zero; ROW],
            totals: [[0.0; ROW]; ROW],
            gradient: [0.0; ROW],
            cost: 0.0,
            pixels: 0.0,
            pending_patches: 0,
        }
    }

    /// Adds a patch and returns its robust cost.
    #[inline(always)]
    pub(super) fn add<const PATH: usize>(
        &mut self,
        whitening: &Whitening<S>,
        site: &PatchSite,
        rows: &PatchRows<PATH>,
    ) -> PatchCost {
        let observed = observed_intensities(&whitening.current, site);
        let mut cost = S::f32s::splat(self.simd, 0.0);
        let mut count = cost;
        for k in (0..PATCH_PIXELS).step_by(S::f32s::LEN) {
            let whitened = whitening.whiten(&rows.values, &observed, k);
            cost += whitened.cost;
            count += whitened.count;
            self.store_columns(whitening.brightness.gain, &whitened, rows, k);
        }
        self.add_products();
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
    fn store_columns<const PATH: usize>(
        &mut self,
        gain: f32,
        whitened: &Whitened<S>,
        rows: &PatchRows<PATH>,
        k: usize,
    ) {
        // H = sum w J J^T: half of the weight on either side.
        let root = whitened.weight.sqrt();
        let scale = root * whitened.inverse_sigma;
        // Derivatives by the path are of the light before the gain.
        let pose_scale = scale * gain;
        let (pose, brightness) = self.columns.row.split_at_mut(rows.pose.len());
        for (column, derivative) in pose.iter_mut().zip(&rows.pose) {
            store(load(self.simd, derivative, k) * pose_scale, column, k);
        }
        let mean = load(self.simd, &rows.values.mean, k);
        for (column, value) in brightness.iter_mut().zip([mean * scale, scale]) {
            store(value, column, k);
        }
        store(whitened.residual * root, &mut self.columns.residual, k);
    }

    /// Two rows of the matrix at a time, so that every column that is read serves two products.
    #[inline(always)]
    fn add_products(&mut self) {
        let residual = self.vectors(&self.columns.residual);
        for i in (0..ROW).step_by(2) {
            let [first, second] = [i, i + 1].map(|column| self.vectors(&self.columns.row[column]));
            self.lanes[i][i] = self.add_dot(&first, &first, self.lanes[i][i]);
            for j in i + 1..ROW {
                let column = self.vectors(&self.columns.row[j]);
                self.lanes[i][j] = self.add_dot(&first, &column, self.lanes[i][j]);
                self.lanes[i + 1][j] = self.add_dot(&second, &column, self.lanes[i + 1][j]);
            }
            self.gradient_lanes[i] = self.add_dot(&first, &residual, self.gradient_lanes[i]);
            self.gradient_lanes[i + 1] = self.add_dot(&second, &residual, self.gradient_lanes[i + 1]);
        }
    }

    /// The vectors of a column; those past the end of the patch are never read.
    #[inline(always)]
    fn vectors(&self, column: &[f32; PATCH_PIXELS]) -> [S::f32s; MAX_VECTORS] {
        core::array::from_fn(
            #[inline(always)]
            |vector| load(self.simd, column, vector * S::f32s::LEN % PATCH_PIXELS),
        )
    }

    #[inline(always)]
    fn add_dot(&self, a: &[S::f32s; MAX_VECTORS], b: &[S::f32s; MAX_VECTORS], sum: S::f32s) -> S::f32s {
        let vectors = PATCH_PIXELS / S::f32s::LEN;
        a.iter().zip(b).take(vectors).fold(
            sum,
            #[inline(always)]
            |sum, (&a, &b)| a.mul_add(b, sum),
        )
    }

    #[inline(always)]
    fn flush(&mut self) {
        // Single precision holds a few patches; their sums go on in double precision.
        for (i, (totals, lanes)) in self.totals.iter_mut().zip(&mut self.lanes).enumerate() {
            for (total, lanes) in totals[i..].iter_mut().zip(&mut lanes[i..]) {
                *total += f64::from(lanes.reduce_sum());
                *lanes = S::f32s::splat(self.simd, 0.0);
            }
        }
        for (total, lanes) in self.gradient.iter_mut().zip(&mut self.gradient_lanes) {
            *total += f64::from(lanes.reduce_sum());
            *lanes = S::f32s::splat(self.simd, 0.0);
        }
        self.pending_patches = 0;
    }

    /// The sums over all patches added so far.
    #[inline(always)]
    pub(super) fn finish(mut self) -> RowSums<ROW> {
        self.flush();
        RowSums {
            cost: self.cost,
            pixels: self.pixels,
            hessian: SMatrix::from_fn(|i, j| self.totals[i.min(j)][i.max(j)]),
            gradient: SVector::from_fn(|i, _| self.gradient[i]),
        }
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
        // The whole patch is inside: one bounds check for all of its pixels.
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
