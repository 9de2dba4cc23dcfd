//! The SIMD transfer kernel: predicted intensities of a patch and their derivatives, for every instruction set.
//!
//! # Layout
//!
//! A lane is a pixel of the patch. The 32 pattern pixels are 2, 4 or 8 vectors; for each of them the loop over
//! the virtual views runs with all sums in registers. What a patch and a view share ([`PatchView`]) is computed
//! once per patch, what a view shares among all patches ([`VirtualView`]) once per evaluation.
//!
//! # Cost
//!
//! Per pixel and view: one division, four pair loads and about 25 arithmetic operations for the value, about 30
//! more for the row over twelve pose parameters. The loads dominate the value, the sums the row.
//!
//! # Invalid pixels
//!
//! Nothing branches on validity: indices are clamped, and lanes that left the image, passed the plane or met a
//! NaN are dropped at the end by comparisons that NaN fails.

use arrayvec::ArrayVec;
use fearless_simd::prelude::*;

use super::bilinear::{BilinearSampler, Sampled};
use super::pattern::{PATCH_PIXELS, PATTERN_DU_F32, PATTERN_DV_F32};
use super::problem::{PatchRows, PatchSite, PatchValues, TransferProblem};
use super::reference::{MIN_PLANE_DISTANCE, MIN_RAY_Z};
use super::virtual_view::{MAX_VIRTUAL_VIEWS, VirtualView};

/// What a patch and a virtual view share for all pixels of the patch.
struct PatchView {
    /// Viewing ray of the patch centre in the reference frame.
    ray: [f32; 3],
    /// Pixels per unit of `r_x/r_z` and of `r_y/r_z`.
    slope: [f32; 2],
    /// Pixel of the ray along z.
    shift: [f32; 2],
    /// `(1 - s)/w` and `s/w`, with `w` the distance from the virtual camera to the plane.
    end_weights: [f32; 2],
}

/// Pixels of the virtual view transferred into the reference image.
struct Transferred<S: Simd> {
    u: S::f32s,
    v: S::f32s,
    /// `r_x/r_z` and `r_y/r_z` of the viewing ray in the reference frame.
    a: S::f32s,
    b: S::f32s,
    ray_z: S::f32s,
}

/// Sums over the virtual views of one vector of pixels.
struct RowSums<S: Simd> {
    value: S::f32s,
    translation_start: [S::f32s; 3],
    translation_end: [S::f32s; 3],
    rotation: [S::f32s; 3],
    rotation_end: [S::f32s; 3],
}

/// The transfer of all patches of one evaluation.
pub(super) struct TransferKernel<'a, S: Simd> {
    simd: S,
    problem: &'a TransferProblem<'a>,
    views: &'a [VirtualView],
    sampler: BilinearSampler<'a, S>,
    scale: f32,
}

impl<'a, S: Simd> TransferKernel<'a, S> {
    /// `None` if there is no view or the reference image cannot be sampled: then no pixel is valid.
    #[inline(always)]
    pub(super) fn new(simd: S, problem: &'a TransferProblem<'a>) -> Option<Self> {
        let views = &problem.views[..problem.views.len().min(MAX_VIRTUAL_VIEWS)];
        if views.is_empty() {
            return None;
        }
        let sampler = BilinearSampler::new(simd, &problem.reference)?;
        Some(Self { simd, problem, views, sampler, scale: 1.0 / views.len() as f32 })
    }

    /// Predicted intensities of a patch.
    #[inline(always)]
    pub(super) fn patch_values(&self, site: &PatchSite, out: &mut PatchValues) {
        let Some(patch_views) = self.patch_views(site) else {
            *out = PatchValues::default();
            return;
        };
        for k in (0..PATCH_PIXELS).step_by(S::f32s::LEN) {
            let mut valid = self.observed(site, k);
            let mut sum = S::f32s::splat(self.simd, 0.0);
            for (view, patch_view) in self.views.iter().zip(&patch_views) {
                let t = self.transfer(view, patch_view, k);
                valid &= self.accepts(&t);
                if valid.all_false() {
                    break;
                }
                sum += self.sampler.sample(t.u, t.v).value;
            }
            self.store_values(k, sum, valid, out);
        }
    }

    /// Predicted intensities of a patch and their derivatives by the poses at shutter opening and closing, for
    /// left rotations.
    #[inline(always)]
    pub(super) fn patch_rows(&self, site: &PatchSite, out: &mut PatchRows) {
        let Some(patch_views) = self.patch_views(site) else {
            *out = PatchRows::default();
            return;
        };
        for k in (0..PATCH_PIXELS).step_by(S::f32s::LEN) {
            let mut valid = self.observed(site, k);
            let mut sums = RowSums::zero(self.simd);
            for (view, patch_view) in self.views.iter().zip(&patch_views) {
                let t = self.transfer(view, patch_view, k);
                valid &= self.accepts(&t);
                if valid.all_false() {
                    break;
                }
                sums.add(view, patch_view, &t, &self.sampler.sample(t.u, t.v));
            }
            self.store_rows(k, &sums, valid, out);
        }
    }

    /// `None` if the plane is behind or too near to one of the virtual cameras.
    #[inline(always)]
    fn patch_views(&self, site: &PatchSite) -> Option<ArrayVec<PatchView, MAX_VIRTUAL_VIEWS>> {
        let [fx, fy] = self.problem.focal;
        let [cx, cy] = self.problem.centre;
        let x = (f32::from(site.u) - cx) / fx;
        let y = (f32::from(site.v) - cy) / fy;
        let rho = site.inverse_depth;
        let depth = 1.0 / rho;
        let mut patch_views = ArrayVec::new();
        for view in self.views {
            let distance = depth - view.position[2];
            if !(distance > MIN_PLANE_DISTANCE && rho > 0.0) {
                return None;
            }
            let per_distance = 1.0 / distance;
            patch_views.push(PatchView {
                ray: core::array::from_fn(|i| {
                    view.rotation[i][0] * x + view.rotation[i][1] * y + view.rotation[i][2]
                }),
                slope: [fx * rho * distance, fy * rho * distance],
                shift: [cx + fx * rho * view.position[0], cy + fy * rho * view.position[1]],
                end_weights: [(1.0 - view.time) * per_distance, view.time * per_distance],
            });
        }
        Some(patch_views)
    }

    #[inline(always)]
    fn transfer(&self, view: &VirtualView, patch_view: &PatchView, k: usize) -> Transferred<S> {
        let ray = |i: usize| load(self.simd, &view.pattern_offset[i], k) + patch_view.ray[i];
        let ray_z = ray(2);
        let z = S::f32s::splat(self.simd, 1.0) / ray_z;
        let (a, b) = (ray(0) * z, ray(1) * z);
        Transferred {
            u: a.mul_add(patch_view.slope[0], patch_view.shift[0]),
            v: b.mul_add(patch_view.slope[1], patch_view.shift[1]),
            a,
            b,
            ray_z,
        }
    }

    #[inline(always)]
    fn accepts(&self, t: &Transferred<S>) -> S::mask32s {
        t.ray_z.simd_gt(MIN_RAY_Z) & self.sampler.contains(t.u, t.v)
    }

    /// Pattern pixels of the patch that lie in the current image.
    #[inline(always)]
    fn observed(&self, site: &PatchSite, k: usize) -> S::mask32s {
        let u = load(self.simd, &PATTERN_DU_F32, k) + f32::from(site.u);
        let v = load(self.simd, &PATTERN_DV_F32, k) + f32::from(site.v);
        let (width, height) = (self.problem.current.width as f32, self.problem.current.height as f32);
        (u.simd_ge(0.0) & u.simd_lt(width)) & (v.simd_ge(0.0) & v.simd_lt(height))
    }

    #[inline(always)]
    fn store_values(&self, k: usize, sum: S::f32s, valid: S::mask32s, out: &mut PatchValues) {
        let (zero, one) = (S::f32s::splat(self.simd, 0.0), S::f32s::splat(self.simd, 1.0));
        let mean = sum * self.scale;
        let valid = valid & mean.is_finite();
        store(valid.select(mean, zero), &mut out.mean, k);
        store(valid.select(one, zero), &mut out.valid, k);
    }

    #[inline(always)]
    fn store_rows(&self, k: usize, sums: &RowSums<S>, valid: S::mask32s, out: &mut PatchRows) {
        let columns = sums.columns();
        let total = columns.iter().fold(S::f32s::splat(self.simd, 0.0), |total, &column| total + column);
        let valid = valid & total.is_finite();
        self.store_values(k, sums.value, valid, &mut out.values);
        let (zero, scale) = (S::f32s::splat(self.simd, 0.0), S::f32s::splat(self.simd, self.scale));
        for (&column, pose) in columns.iter().zip(&mut out.pose) {
            store(valid.select(column * scale, zero), pose, k);
        }
    }
}

impl<S: Simd> RowSums<S> {
    #[inline(always)]
    fn zero(simd: S) -> Self {
        let zero = S::f32s::splat(simd, 0.0);
        Self {
            value: zero,
            translation_start: [zero; 3],
            translation_end: [zero; 3],
            rotation: [zero; 3],
            rotation_end: [zero; 3],
        }
    }

    /// Adds one virtual view. With `A = g_u m_u`, `C = g_v m_v` and `e = a A + b C`, the row for a left rotation
    /// is `(-(b e + C), a e + A, a C - b A)` and that for a translation `(A, C, -e)/w`.
    #[inline(always)]
    fn add(&mut self, view: &VirtualView, patch_view: &PatchView, t: &Transferred<S>, sampled: &Sampled<S>) {
        let along_u = sampled.gradient_u * patch_view.slope[0];
        let along_v = sampled.gradient_v * patch_view.slope[1];
        let e = t.a.mul_add(along_u, t.b * along_v);
        let translation = [along_u, along_v, -e];
        let rotation =
            [-t.b.mul_add(e, along_v), t.a.mul_add(e, along_u), t.a.mul_sub(along_v, t.b * along_u)];
        self.value += sampled.value;
        for i in 0..3 {
            self.translation_start[i] =
                translation[i].mul_add(patch_view.end_weights[0], self.translation_start[i]);
            self.translation_end[i] =
                translation[i].mul_add(patch_view.end_weights[1], self.translation_end[i]);
            self.rotation[i] += rotation[i];
            for j in 0..3 {
                self.rotation_end[j] = rotation[i].mul_add(view.blend_left[i][j], self.rotation_end[j]);
            }
        }
    }

    /// The sums in the order of the row: start translation and rotation, end translation and rotation.
    #[inline(always)]
    fn columns(&self) -> [S::f32s; 12] {
        let (t0, t1, phi1) = (&self.translation_start, &self.translation_end, &self.rotation_end);
        let phi0: [S::f32s; 3] = core::array::from_fn(|i| self.rotation[i] - phi1[i]);
        core::array::from_fn(|i| match i / 3 {
            0 => t0[i % 3],
            1 => phi0[i % 3],
            2 => t1[i % 3],
            _ => phi1[i % 3],
        })
    }
}

/// The vector of pattern pixels `k..`.
#[inline(always)]
pub(super) fn load<S: Simd>(simd: S, pixels: &[f32; PATCH_PIXELS], k: usize) -> S::f32s {
    S::f32s::from_slice(simd, &pixels[k..k + S::f32s::LEN])
}

/// Writes the vector of pattern pixels `k..`.
#[inline(always)]
pub(super) fn store<S: Simd, V: SimdBase<S, Element = f32>>(
    vector: V,
    pixels: &mut [f32; PATCH_PIXELS],
    k: usize,
) {
    vector.store_slice(&mut pixels[k..k + V::LEN]);
}
