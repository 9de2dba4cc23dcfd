//! The photometric term of one pyramid level: robust cost and normal equations over all patches.

use core::ops::Range;

use fearless_simd::{Level, Simd, dispatch};

use super::accumulate::{NormalEquations, Whitening};
use super::kernel::TransferKernel;
use super::problem::{BOWED_PATH, LINEAR_PATH, PatchRows, PatchSite, PatchValues, TransferProblem};
use super::sums::{BowedSums, PatchCost, PhotometricSums, ResidualModel, RowSums};

/// Robust cost of every patch; `patches` has the length of `sites`. Returns the sums over all patches.
///
/// `level` is the instruction set to use; results differ between levels by rounding only. A pixel whose
/// prediction, observation or variance is not finite does not count.
pub fn evaluate_cost(
    level: Level,
    problem: &TransferProblem,
    sites: &[PatchSite],
    model: &ResidualModel,
    patches: &mut [PatchCost],
) -> PatchCost {
    if problem.rows.step == 0.0 {
        dispatch!(level, simd => cost_of_patches::<_, false>(simd, problem, sites, model, patches))
    } else {
        dispatch!(level, simd => cost_of_patches::<_, true>(simd, problem, sites, model, patches))
    }
}

/// Normal equations and robust cost of all patches; see [`evaluate_cost`].
pub fn linearize(
    level: Level,
    problem: &TransferProblem,
    sites: &[PatchSite],
    model: &ResidualModel,
    patches: &mut [PatchCost],
) -> PhotometricSums {
    dispatch!(level, simd => sums_of_patches(simd, problem, sites, model, patches))
}

/// Parts of an image that are transferred one after the other, each with virtual views of its own; an iterator whose items
/// may borrow from it.
pub trait TransferParts {
    /// The next part and the range of its sites; `None` after the last one.
    fn next_part(&mut self) -> Option<(TransferProblem<'_>, Range<usize>)>;
}

/// A single part.
impl TransferParts for Option<(TransferProblem<'_>, Range<usize>)> {
    fn next_part(&mut self) -> Option<(TransferProblem<'_>, Range<usize>)> {
        self.take()
    }
}

/// Normal equations and robust cost of all patches by the parameters of a path with bow, for rows that are exposed one
/// after the other; see [`evaluate_cost`]. The views of each part are those of [`super::RowBand::fill_views`]. Patches of no part
/// cost nothing.
pub fn linearize_bowed(
    level: Level,
    parts: &mut impl TransferParts,
    sites: &[PatchSite],
    model: &ResidualModel,
    patches: &mut [PatchCost],
) -> BowedSums {
    dispatch!(level, simd => sums_of_parts(simd, parts, sites, model, patches))
}

/// Predicted intensities of every patch; `out` has the length of `sites`.
pub fn transfer_values(
    level: Level,
    problem: &TransferProblem,
    sites: &[PatchSite],
    out: &mut [PatchValues],
) {
    dispatch!(level, simd => values_of_patches(simd, problem, sites, out));
}

/// Predicted intensities of every patch and their derivatives; `out` has the length of `sites`.
pub fn transfer_rows(level: Level, problem: &TransferProblem, sites: &[PatchSite], out: &mut [PatchRows]) {
    dispatch!(level, simd => rows_of_patches(simd, problem, sites, out));
}

/// The part of [`linearize`] that follows [`transfer_rows`]: `rows` and `patches` have the length of `sites`.
pub fn accumulate_rows(
    level: Level,
    problem: &TransferProblem,
    sites: &[PatchSite],
    rows: &[PatchRows],
    model: &ResidualModel,
    patches: &mut [PatchCost],
) -> PhotometricSums {
    dispatch!(level, simd => sums_of_rows(simd, problem, sites, rows, model, patches))
}

#[inline(always)]
fn cost_of_patches<S: Simd, const ROLLING: bool>(
    simd: S,
    problem: &TransferProblem,
    sites: &[PatchSite],
    model: &ResidualModel,
    patches: &mut [PatchCost],
) -> PatchCost {
    patches.fill(PatchCost::default());
    let Some(mut kernel) = TransferKernel::new(simd, problem) else { return PatchCost::default() };
    let whitening = Whitening::new(simd, &problem.current, &problem.brightness, model);
    let mut values = PatchValues::default();
    let (mut cost, mut pixels) = (0.0, 0.0);
    for (site, patch) in sites.iter().zip(patches) {
        kernel.patch_values::<ROLLING>(site, &mut values);
        *patch = whitening.cost(site, &values);
        cost += f64::from(patch.cost);
        pixels += f64::from(patch.pixels);
    }
    PatchCost { cost: cost as f32, pixels: pixels as f32 }
}

#[inline(always)]
fn sums_of_patches<S: Simd>(
    simd: S,
    problem: &TransferProblem,
    sites: &[PatchSite],
    model: &ResidualModel,
    patches: &mut [PatchCost],
) -> PhotometricSums {
    patches.fill(PatchCost::default());
    let Some(mut kernel) = TransferKernel::new(simd, problem) else { return RowSums::default() };
    let whitening = Whitening::new(simd, &problem.current, &problem.brightness, model);
    let mut rows = PatchRows::<LINEAR_PATH>::default();
    let mut sums = NormalEquations::new(simd);
    for (site, patch) in sites.iter().zip(patches) {
        kernel.patch_rows(site, &mut rows);
        *patch = sums.add(&whitening, site, &rows);
    }
    sums.finish()
}

/// All parts share the accumulators, which take longer to clear and to sum up than a few patches.
#[inline(always)]
fn sums_of_parts<S: Simd>(
    simd: S,
    parts: &mut impl TransferParts,
    sites: &[PatchSite],
    model: &ResidualModel,
    patches: &mut [PatchCost],
) -> BowedSums {
    patches.fill(PatchCost::default());
    let mut rows = PatchRows::<BOWED_PATH>::default();
    let mut sums = NormalEquations::new(simd);
    while let Some((problem, part)) = parts.next_part() {
        let Some(mut kernel) = TransferKernel::new(simd, &problem) else { continue };
        let whitening = Whitening::new(simd, &problem.current, &problem.brightness, model);
        for (site, patch) in sites[part.clone()].iter().zip(&mut patches[part]) {
            kernel.patch_rows(site, &mut rows);
            *patch = sums.add(&whitening, site, &rows);
        }
    }
    sums.finish()
}

#[inline(always)]
fn values_of_patches<S: Simd>(
    simd: S,
    problem: &TransferProblem,
    sites: &[PatchSite],
    out: &mut [PatchValues],
) {
    let Some(mut kernel) = TransferKernel::new(simd, problem) else {
        return out.fill(PatchValues::default());
    };
    for (site, values) in sites.iter().zip(out) {
        kernel.patch_values::<false>(site, values);
    }
}

#[inline(always)]
fn rows_of_patches<S: Simd>(simd: S, problem: &TransferProblem, sites: &[PatchSite], out: &mut [PatchRows]) {
    let Some(mut kernel) = TransferKernel::new(simd, problem) else { return out.fill(PatchRows::default()) };
    for (site, rows) in sites.iter().zip(out) {
        kernel.patch_rows(site, rows);
    }
}

#[inline(always)]
fn sums_of_rows<S: Simd>(
    simd: S,
    problem: &TransferProblem,
    sites: &[PatchSite],
    rows: &[PatchRows],
    model: &ResidualModel,
    patches: &mut [PatchCost],
) -> PhotometricSums {
    let whitening = Whitening::new(simd, &problem.current, &problem.brightness, model);
    let mut sums = NormalEquations::new(simd);
    for ((site, rows), patch) in sites.iter().zip(rows).zip(patches) {
        *patch = sums.add(&whitening, site, rows);
    }
    sums.finish()
}
