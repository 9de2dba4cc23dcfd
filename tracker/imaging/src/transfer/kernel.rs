//! The SIMD transfer kernel: predicted intensities of a patch and their derivatives, for every instruction set.
//!
//! # Layout
//!
//! A lane is a pixel of the patch; the 32 pattern pixels are 2, 4 or 8 vectors. For each of them the virtual
//! views are taken in batches: first every sample of the batch is located, then every sample is read and summed.
//! In one go a sample is a chain of some 90 cycles from division to interpolation, more than the processor can
//! overlap with the next; in two passes the chains are short. What a patch and a view share ([`PatchView`]) is
//! computed once per patch, what a view shares among all patches ([`VirtualView`]) once per evaluation.
//!
//! # Cost
//!
//! Per pixel and view: one division, four pair loads and about 25 arithmetic operations for the value, about 30
//! more for the row over twelve pose parameters. The loads dominate the value, the sums the row.
//!
//! # Invalid pixels
//!
//! Nothing branches on the validity of a lane: indices are clamped, and lanes that left the image, passed the
//! plane or met a NaN are dropped at the end by comparisons that NaN fails.

use fearless_simd::prelude::*;

use super::pattern::{PATCH_PIXELS, PATTERN_DU_F32, PATTERN_DV_F32};
use super::problem::{LINEAR_PATH, PatchRows, PatchSite, PatchValues, TransferProblem};
use super::reference::{MIN_PLANE_DISTANCE, MIN_RAY_Z};
use super::virtual_view::{MAX_VIRTUAL_VIEWS, VirtualView};
use crate::image::{BilinearSampler, Cell, Sampled};

/// Virtual views whose samples are located before the first of them is read.
const BATCH: usize = 8;

/// What a patch and a virtual view share for all pixels of the patch.
#[derive(Clone, Copy, Default)]
struct PatchView {
    /// Viewing ray of the patch centre in the reference frame.
    ray: [f32; 3],
    /// Pixels per unit of `r_x/r_z` and of `r_y/r_z`.
    slope: [f32; 2],
    /// Pixel of the ray along z.
    shift: [f32; 2],
    /// `(1 - s)/w` and `s/w`, with `w` the distance from the virtual camera to the plane.
    end_weights: [f32; 2],
    /// `(s - 1/2)^2`, and the same over `w`; only where rows are exposed one after the other.
    bow: [f32; 2],
}

/// One vector of pixels of a virtual view, located in the reference image.
#[derive(Clone, Copy)]
struct Located<S: Simd> {
    cell: Cell<S>,
    /// `r_x/r_z` and `r_y/r_z` of the viewing ray in the reference frame.
    a: S::f32s,
    b: S::f32s,
}

/// Sums over the virtual views of one vector of pixels.
struct RowSums<S: Simd> {
    value: S::f32s,
    translation_start: [S::f32s; 3],
    translation_end: [S::f32s; 3],
    rotation: [S::f32s; 3],
    rotation_end: [S::f32s; 3],
    /// Sums for the bow; not touched without it.
    translation_bow: [S::f32s; 3],
    rotation_bow: [S::f32s; 3],
}

/// The transfer of all patches of one evaluation.
pub(super) struct TransferKernel<'a, S: Simd> {
    simd: S,
    problem: &'a TransferProblem<'a>,
    views: &'a [VirtualView],
    sampler: BilinearSampler<'a, S>,
    /// `1/n` for n views.
    scale: f32,
    inverse_focal: [f32; 2],
    current_size: [f32; 2],
    patch_views: [PatchView; MAX_VIRTUAL_VIEWS],
    batch: [Located<S>; BATCH],
}

impl<'a, S: Simd> TransferKernel<'a, S> {
    /// `None` if there is no view or the reference image cannot be sampled: then no pixel is valid.
    #[inline(always)]
    pub(super) fn new(simd: S, problem: &'a TransferProblem<'a>) -> Option<Self> {
        let views = &problem.views[..problem.views.len().min(MAX_VIRTUAL_VIEWS)];
        if views.is_empty() {
            return None;
        }
        let zero = S::f32s::splat(simd, 0.0);
        Some(Self {
            simd,
            problem,
            views,
            sampler: BilinearSampler::new(simd, &problem.reference)?,
            scale: 1.0 / views.len() as f32,
            inverse_focal: problem.focal.map(|focal| 1.0 / focal),
            current_size: [problem.current.width as f32, problem.current.height as f32],
            patch_views: [PatchView::default(); MAX_VIRTUAL_VIEWS],
            batch: [Located { cell: Cell::first(simd), a: zero, b: zero }; BATCH],
        })
    }

    /// Predicted intensities of a patch; `ROLLING` where the problem's rows are exposed one after the other.
    #[inline(always)]
    pub(super) fn patch_values<const ROLLING: bool>(&mut self, site: &PatchSite, out: &mut PatchValues) {
        if !self.prepare::<ROLLING>(site) {
            *out = PatchValues::default();
            return;
        }
        for k in (0..PATCH_PIXELS).step_by(S::f32s::LEN) {
            let mut sum = S::f32s::splat(self.simd, 0.0);
            let valid = self.for_each_sample(
                site,
                k,
                #[inline(always)]
                |_, _, _, sampled| sum += sampled.value,
            );
            self.store_values(k, sum, valid, out);
        }
    }

    /// Predicted intensities of a patch and their derivatives by the parameters of the path, for left rotations of its
    /// ends; with a bow where `PATH` has room for it, and then for rows that are exposed one after the other.
    #[inline(always)]
    pub(super) fn patch_rows<const PATH: usize>(&mut self, site: &PatchSite, out: &mut PatchRows<PATH>) {
        let prepared =
            if PATH > LINEAR_PATH { self.prepare::<true>(site) } else { self.prepare::<false>(site) };
        if !prepared {
            *out = PatchRows::default();
            return;
        }
        for k in (0..PATCH_PIXELS).step_by(S::f32s::LEN) {
            let mut sums = RowSums::zero(self.simd);
            let valid = self.for_each_sample(
                site,
                k,
                #[inline(always)]
                |view, patch_view, located, sampled| sums.add::<PATH>(view, patch_view, located, sampled),
            );
            if PATH > LINEAR_PATH {
                sums.delay(self.delay(site));
            }
            self.store_rows(k, &sums, valid, out);
        }
    }

    /// Normalised time by which the row of a patch is exposed later than the views say.
    #[inline(always)]
    fn delay(&self, site: &PatchSite) -> f32 {
        (f32::from(site.v) - self.problem.rows.centre) * self.problem.rows.step
    }

    /// Computes what patch and views share. False if the plane is behind or too near to a virtual camera.
    ///
    /// A patch that is exposed later than the row of the views sees them moved on by their velocity: within a band of
    /// rows the second order is far below a hundredth of a pixel.
    #[inline(always)]
    fn prepare<const ROLLING: bool>(&mut self, site: &PatchSite) -> bool {
        let [fx, fy] = self.problem.focal;
        let [cx, cy] = self.problem.centre;
        // The keypoint on the plane of unit depth, and its plane z = depth in the reference.
        let x = (f32::from(site.u) - cx) * self.inverse_focal[0];
        let y = (f32::from(site.v) - cy) * self.inverse_focal[1];
        let rho = site.inverse_depth;
        let depth = 1.0 / rho;
        let mut in_front = rho > 0.0;
        let delay = self.delay(site);
        for (view, patch_view) in self.views.iter().zip(&mut self.patch_views) {
            // Its ray in the reference frame, R (x, y, 1); pattern pixels are an offset from it.
            let mut ray: [f32; 3] = core::array::from_fn(|i| {
                view.rotation[i][0] * x + view.rotation[i][1] * y + view.rotation[i][2]
            });
            let (mut position, mut time) = (view.position, view.time);
            // First order of the motion until the row of the patch: the ray turns by omega x r, the centre shifts.
            if ROLLING {
                let [shift, turn] = view.velocity;
                let [rx, ry, rz] = ray;
                let cross =
                    [turn[1] * rz - turn[2] * ry, turn[2] * rx - turn[0] * rz, turn[0] * ry - turn[1] * rx];
                for i in 0..3 {
                    ray[i] += delay * cross[i];
                    position[i] += delay * shift[i];
                }
                time += delay;
            }
            // The plane has to be ahead of the view: w = depth - p_z.
            let distance = depth - position[2];
            in_front &= distance > MIN_PLANE_DISTANCE;
            let per_distance = 1.0 / distance;
            let bow = (time - 0.5) * (time - 0.5);
            // u = c + f rho (p + w a): slope and shift of what is linear in a = r_x/r_z.
            *patch_view = PatchView {
                ray,
                slope: [fx * rho * distance, fy * rho * distance],
                shift: [cx + fx * rho * position[0], cy + fy * rho * position[1]],
                end_weights: [(1.0 - time) * per_distance, time * per_distance],
                bow: [bow, bow * per_distance],
            };
        }
        in_front
    }

    /// Calls `add` with every sample of the pixels `k..` and returns the pixels of which all samples are valid;
    /// stops early if there are none.
    #[inline(always)]
    fn for_each_sample(
        &mut self,
        site: &PatchSite,
        k: usize,
        mut add: impl FnMut(&VirtualView, &PatchView, &Located<S>, &Sampled<S>),
    ) -> S::mask32s {
        // First all cells of a batch of views, then all their samples: loads do not wait for arithmetic.
        let mut valid = self.observed(site, k);
        for (views, patch_views) in self.views.chunks(BATCH).zip(self.patch_views.chunks(BATCH)) {
            for ((view, patch_view), located) in views.iter().zip(patch_views).zip(&mut self.batch) {
                valid &= locate(self.simd, &self.sampler, view, patch_view, k, located);
            }
            if valid.all_false() {
                break;
            }
            for ((view, patch_view), located) in views.iter().zip(patch_views).zip(&self.batch) {
                add(view, patch_view, located, &self.sampler.sample(&located.cell));
            }
        }
        valid
    }

    /// Pattern pixels of the patch that lie in the current image.
    #[inline(always)]
    fn observed(&self, site: &PatchSite, k: usize) -> S::mask32s {
        let u = load(self.simd, &PATTERN_DU_F32, k) + f32::from(site.u);
        let v = load(self.simd, &PATTERN_DV_F32, k) + f32::from(site.v);
        let [width, height] = self.current_size;
        (u.simd_ge(0.0) & u.simd_lt(width)) & (v.simd_ge(0.0) & v.simd_lt(height))
    }

    #[inline(always)]
    fn store_values(&self, k: usize, sum: S::f32s, valid: S::mask32s, out: &mut PatchValues) {
        let (zero, one) = (S::f32s::splat(self.simd, 0.0), S::f32s::splat(self.simd, 1.0));
        // Lanes with a sample that is no number are left out, too.
        let mean = sum * self.scale;
        let valid = valid & mean.is_finite();
        store(valid.select(mean, zero), &mut out.mean, k);
        store(valid.select(one, zero), &mut out.valid, k);
    }

    #[inline(always)]
    fn store_rows<const PATH: usize>(
        &self,
        k: usize,
        sums: &RowSums<S>,
        valid: S::mask32s,
        out: &mut PatchRows<PATH>,
    ) {
        let columns = sums.columns::<PATH>();
        // Any number that is not finite makes the total so; a tree, because a chain of twelve would be waited for.
        let [a, b, c, d]: [S::f32s; 4] =
            core::array::from_fn(|i| columns[i] + columns[i + 4] + columns[i + 8]);
        let mut total = (a + b) + (c + d) + sums.value;
        for &column in columns.iter().skip(LINEAR_PATH) {
            total += column;
        }
        let valid = valid & total.is_finite();
        self.store_values(k, sums.value, valid, &mut out.values);
        let (zero, scale) = (S::f32s::splat(self.simd, 0.0), S::f32s::splat(self.simd, self.scale));
        for (&column, pose) in columns.iter().zip(&mut out.pose) {
            store(valid.select(column * scale, zero), pose, k);
        }
    }
}

/// Transfers the pixels `k..` of a virtual view into the reference image; returns the lanes that are valid.
#[inline(always)]
fn locate<S: Simd>(
    simd: S,
    sampler: &BilinearSampler<S>,
    view: &VirtualView,
    patch_view: &PatchView,
    k: usize,
    located: &mut Located<S>,
) -> S::mask32s {
    let ray = |i: usize| load(simd, &view.pattern_offset[i], k) + patch_view.ray[i];
    // Perspective division: (a, b) = (r_x, r_y)/r_z.
    let ray_z = ray(2);
    let z = S::f32s::splat(simd, 1.0) / ray_z;
    let (a, b) = (ray(0) * z, ray(1) * z);
    let u = a.mul_add(patch_view.slope[0], patch_view.shift[0]);
    let v = b.mul_add(patch_view.slope[1], patch_view.shift[1]);
    *located = Located { cell: sampler.locate(u, v), a, b };
    ray_z.simd_gt(MIN_RAY_Z) & sampler.contains(u, v)
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
            translation_bow: [zero; 3],
            rotation_bow: [zero; 3],
        }
    }

    /// Adds one virtual view. With `A = g_u m_u`, `C = g_v m_v` and `e = a A + b C`, the row for a left rotation
    /// is `(-(b e + C), a e + A, a C - b A)` and that for a translation `(A, C, -e)/w`.
    #[inline(always)]
    fn add<const PATH: usize>(
        &mut self,
        view: &VirtualView,
        patch_view: &PatchView,
        t: &Located<S>,
        sampled: &Sampled<S>,
    ) {
        // A and C of the equation above: gradients of the image along the plane.
        let along_u = sampled.gradient_u * patch_view.slope[0];
        let along_v = sampled.gradient_v * patch_view.slope[1];
        let e = t.a.mul_add(along_u, t.b * along_v);
        let translation = [along_u, along_v, -e];
        let rotation =
            [-t.b.mul_add(e, along_v), t.a.mul_add(e, along_u), t.a.mul_sub(along_v, t.b * along_u)];
        // Translations go to both ends by the time of the view, rotations by its blend.
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
        if PATH > LINEAR_PATH {
            for i in 0..3 {
                self.translation_bow[i] = translation[i].mul_add(patch_view.bow[1], self.translation_bow[i]);
                let turn = rotation[i] * patch_view.bow[0];
                for j in 0..3 {
                    self.rotation_bow[j] = turn.mul_add(view.bow_blend_left[i][j], self.rotation_bow[j]);
                }
            }
        }
    }

    /// Moves the blend of the rotations on by `delay` of normalised time, where it grows by the identity per unit.
    #[inline(always)]
    fn delay(&mut self, delay: f32) {
        for (end, &rotation) in self.rotation_end.iter_mut().zip(&self.rotation) {
            *end = rotation.mul_add(delay, *end);
        }
    }

    /// The sums in the order of the row: start translation and rotation, end translation and rotation, those of the
    /// bow.
    #[inline(always)]
    fn columns<const PATH: usize>(&self) -> [S::f32s; PATH] {
        // What does not go to the end of the exposure goes to its start: phi_0 = phi - phi_1.
        let (t0, t1, phi1) = (&self.translation_start, &self.translation_end, &self.rotation_end);
        let phi0: [S::f32s; 3] = core::array::from_fn(|i| self.rotation[i] - phi1[i]);
        core::array::from_fn(|i| match i / 3 {
            0 => t0[i % 3],
            1 => phi0[i % 3],
            2 => t1[i % 3],
            3 => phi1[i % 3],
            4 => self.translation_bow[i % 3],
            _ => self.rotation_bow[i % 3],
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
