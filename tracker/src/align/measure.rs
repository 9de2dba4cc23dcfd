//! Noise scales and outliers at the current estimate, before a linearisation.

use super::depth_term::{DepthProblem, gate_for, noise_of};
use super::problem::{AlignScratch, DepthPart, Objective};
use super::scale::median;
use super::{AlignSettings, Estimate};
use crate::math::sqrt_f32;
use crate::transfer::{
    self, PATCH_PIXELS, PATTERN_DU, PATTERN_DV, PatchCost, PatchSite, ResidualModel, RowBand,
};

/// Nominal variance per unit of light; the measured scale multiplies it.
pub(super) const NOMINAL_PHOTON_VARIANCE: f32 = 1e-4;

/// Fewest depth points for a depth term.
const MIN_DEPTH_POINTS: usize = 100;

/// Noise model before anything is measured.
pub(super) fn nominal_model(settings: &AlignSettings) -> ResidualModel {
    ResidualModel {
        read_variance: NOMINAL_PHOTON_VARIANCE * settings.dark_intensity,
        photon_variance: NOMINAL_PHOTON_VARIANCE,
        huber: settings.huber,
    }
}

/// Measures the photometric noise scale at `estimate` over the first `in_view` sites of the scratch, drops
/// outlier patches and sets the noise model; returns the number of patches kept, moved to the front.
pub(super) fn measure_photometric(
    objective: &mut Objective,
    estimate: &Estimate,
    in_view: usize,
    scratch: &mut AlignScratch,
) -> usize {
    // Without a threshold the mean cost of a patch is half its mean square.
    let square_model = ResidualModel { huber: f32::MAX, ..objective.model };
    let (sites, costs) = (&mut scratch.sites[..in_view], &mut scratch.costs[..in_view]);
    objective.for_each_band(estimate, sites, |problem, of_band| {
        let (sites, costs) = (&sites[of_band.clone()], &mut costs[of_band]);
        transfer::evaluate_cost(objective.simd, problem, sites, &square_model, costs);
    });
    let mut count = 0;
    for cost in costs.iter().filter(|cost| cost.pixels > 0.0) {
        scratch.medians[count] = mean_cost(cost);
        count += 1;
    }
    let typical = median(&mut scratch.medians[..count]).max(MIN_COST);
    let mut kept = 0;
    for k in 0..in_view {
        if mean_cost(&costs[k]) < objective.settings.outlier_factor * typical {
            sites[kept] = sites[k];
            kept += 1;
        }
    }
    // Half the mean square is half the variance.
    objective.model.read_variance *= 2.0 * typical;
    objective.model.photon_variance *= 2.0 * typical;
    kept
}

/// Least mean cost in nominal variances: a perfect fit must not get infinite weight.
const MIN_COST: f32 = 1e-3;

fn mean_cost(patch: &PatchCost) -> f32 {
    if patch.pixels > 0.0 { patch.cost / patch.pixels } else { f32::MAX }
}

/// Median over the sites of the standard deviation of the frame's light within a patch, in nominal standard deviations of
/// the noise: the residual of a patch that is compared with nothing but its own mean. `medians` is scratch.
pub(super) fn measure_contrast(objective: &Objective, sites: &[PatchSite], medians: &mut [f32]) -> f32 {
    let image = &objective.frame.levels[objective.level];
    let mut count = 0;
    for site in sites {
        let (mut sum, mut squares) = (0.0, 0.0);
        for (du, dv) in PATTERN_DU.iter().zip(&PATTERN_DV) {
            let (column, row) = (i32::from(site.u) + du, i32::from(site.v) + dv);
            let light = image.pixels[row as usize * image.width + column as usize];
            sum += light;
            squares += light * light;
        }
        let mean = sum / PATCH_PIXELS as f32;
        // Rounding may take the variance of a flat patch below zero.
        let variance = (squares / PATCH_PIXELS as f32 - mean * mean).max(0.0);
        medians[count] = variance / (mean + objective.settings.dark_intensity).max(f32::MIN_POSITIVE);
        count += 1;
    }
    sqrt_f32(median(&mut medians[..count]) / NOMINAL_PHOTON_VARIANCE)
}

/// Measures the depth noise scale at `estimate`; `None` where too few points overlap. `medians` is scratch.
pub(super) fn measure_depth<'a>(
    objective: &Objective<'a>,
    estimate: &Estimate,
    stride: usize,
    medians: &mut [f32],
) -> Option<DepthPart<'a>> {
    let camera = objective.depth_camera;
    let mut problem = DepthProblem {
        current: objective.frame.depth,
        keyframe: objective.reference.depth,
        planes: objective.reference.planes,
        camera,
        // A sample of the points is enough for a median.
        stride: stride * 2,
        gate: gate_for(f32::MAX),
        band: RowBand::whole(objective.frame.depth.height),
    };
    let mut count = 0;
    for (band, s) in objective.depth_bands() {
        problem.band = band;
        count += problem.absolute_residuals(objective.simd, &estimate.path().at(s), &mut medians[count..]);
    }
    let sigma = noise_of(&mut medians[..count]);
    if count * stride * stride * 4 < MIN_DEPTH_POINTS * 16 {
        return None;
    }
    let sigma = sigma.max(objective.settings.min_depth_sigma);
    problem.stride = stride;
    problem.gate = gate_for(sigma);
    let area = (stride * stride) as f64;
    let weight = area / objective.settings.depth_correlation.max(area);
    Some(DepthPart { problem, sigma, weight })
}
