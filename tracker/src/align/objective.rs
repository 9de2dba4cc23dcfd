//! The combined objective and its normal equations in (centre, exposure motion) coordinates.

use fearless_simd::Level;
use nalgebra::{Matrix3, SMatrix, SVector};

use super::depth_term::DepthProblem;
use super::prior::MotionPrior;
use super::{AlignSettings, Estimate, UNKNOWNS};
use crate::geometry::PinholeCamera;
use crate::image::GreyPyramid;
use crate::keyframe::Keypoint;
use crate::surface::{InverseDepthMap, SurfacePlanes};
use crate::trajectory::{ExposureTrajectory, SampleRule};
use crate::transfer::{
    self, BrightnessModel, PatchCost, PatchSite, PhotometricSums, ResidualModel, TransferProblem,
    virtual_views,
};

/// The sharp reference that a frame is aligned with.
#[derive(Clone, Copy, Debug)]
pub struct ReferenceData<'a> {
    /// Sharp image.
    pub pyramid: &'a GreyPyramid<'a>,
    /// Keypoints of every level of the pyramid.
    pub keypoints: &'a [&'a [Keypoint]],
    /// Inverse depth.
    pub depth: &'a InverseDepthMap<'a>,
    /// Surface planes of the depth map.
    pub planes: &'a SurfacePlanes<'a>,
}

/// The frame that is aligned.
#[derive(Clone, Copy, Debug)]
pub struct FrameData<'a> {
    /// Blurred image.
    pub pyramid: &'a GreyPyramid<'a>,
    /// Inverse depth at mid exposure.
    pub depth: &'a InverseDepthMap<'a>,
}

/// Memory that an alignment works in.
#[derive(Debug)]
pub struct AlignScratch<'m> {
    /// Patch positions.
    pub sites: &'m mut [PatchSite],
    /// Cost per patch.
    pub costs: &'m mut [PatchCost],
    /// Values whose median is taken.
    pub medians: &'m mut [f32],
}

/// Everything that stays fixed while steps on one level are tried out.
pub(super) struct Objective<'a> {
    pub simd: Level,
    pub camera: PinholeCamera,
    pub level: usize,
    pub reference: ReferenceData<'a>,
    pub frame: FrameData<'a>,
    pub sites: &'a [PatchSite],
    pub views: usize,
    pub model: ResidualModel,
    pub photometric_weight: f64,
    pub depth: Option<(DepthProblem<'a>, f32, f64)>,
    pub prior: MotionPrior,
    pub expected_brightness: BrightnessModel,
    pub settings: &'a AlignSettings,
}

/// Cost and normal equations at an estimate, in the coordinates of [`Estimate::stepped`].
#[derive(Clone, Debug)]
pub struct Linearised {
    /// Value of the objective.
    pub cost: f64,
    /// Gauss-Newton matrix.
    pub hessian: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    /// Gradient.
    pub gradient: SVector<f64, UNKNOWNS>,
    /// Mean photometric cost per pixel, squared standard deviations.
    pub photometric_cost: f64,
    /// Photometric pixels that took part.
    pub pixels: f64,
    /// Depth points that took part.
    pub depth_points: f64,
}

impl Objective<'_> {
    /// Evaluates the objective. `expected_counts` are the pixels and depth points of the linearisation that this
    /// cost is compared with: costs are scaled to them, so that losing data never looks like an improvement.
    pub(super) fn linearise(
        &self,
        estimate: &Estimate,
        expected_counts: Option<(f64, f64)>,
        costs: &mut [PatchCost],
    ) -> Linearised {
        let trajectory = &estimate.keyframe_from_camera;
        let photometric = self.photometric(estimate, costs);
        let pixels = photometric.pixels;
        let scale = |count: f64, expected: f64| if count > 0.0 { expected / count } else { 1.0 };
        let (expected_pixels, expected_points) = expected_counts.unwrap_or((pixels, -1.0));
        let weight = self.photometric_weight * scale(pixels, expected_pixels);
        let mut cost = weight * photometric.cost;
        let mut hessian = photometric.hessian * weight;
        let mut gradient = photometric.gradient * weight;
        let mut depth_points = 0.0;
        if let Some((problem, sigma, depth_weight)) = &self.depth {
            let sums = problem.linearise(&trajectory.mid(), *sigma, self.settings.huber);
            depth_points = sums.points;
            let expected = if expected_points < 0.0 { sums.points } else { expected_points };
            let weight = depth_weight * scale(sums.points, expected);
            cost += weight * sums.cost;
            let to_ends = mid_from_ends(trajectory);
            let h = to_ends.transpose() * sums.hessian * to_ends * weight;
            let g = to_ends.transpose() * sums.gradient * weight;
            let mut block = hessian.fixed_view_mut::<12, 12>(0, 0);
            block += h;
            let mut rows = gradient.fixed_rows_mut::<12>(0);
            rows += g;
        }
        let change = centre_motion_from_left(trajectory);
        let mut result = Linearised {
            cost,
            hessian: change.transpose() * hessian * change,
            gradient: change.transpose() * gradient,
            photometric_cost: photometric.cost / pixels.max(1.0),
            pixels,
            depth_points,
        };
        self.add_priors(estimate, &mut result);
        result
    }

    fn photometric(&self, estimate: &Estimate, costs: &mut [PatchCost]) -> PhotometricSums {
        let views =
            virtual_views(&estimate.keyframe_from_camera, self.views, SampleRule::Midpoint, &self.camera);
        let problem = self.transfer_problem(estimate, &views);
        transfer::linearize(self.simd, &problem, self.sites, &self.model, costs)
    }

    pub(super) fn transfer_problem<'b>(
        &'b self,
        estimate: &Estimate,
        views: &'b [transfer::VirtualView],
    ) -> TransferProblem<'b> {
        TransferProblem {
            reference: self.reference.pyramid.levels[self.level].image(),
            current: self.frame.pyramid.levels[self.level].image(),
            focal: [self.camera.fx as f32, self.camera.fy as f32],
            centre: [self.camera.cx as f32, self.camera.cy as f32],
            views,
            brightness: estimate.brightness,
        }
    }

    fn add_priors(&self, estimate: &Estimate, result: &mut Linearised) {
        let residual = self.prior.residual(&estimate.keyframe_from_camera);
        result.cost += self.prior.cost(&estimate.keyframe_from_camera);
        for i in 0..6 {
            result.hessian[(6 + i, 6 + i)] += self.prior.information[i];
            result.gradient[6 + i] += self.prior.information[i] * residual[i];
        }
        let brightness = [
            (f64::from(estimate.brightness.gain - self.expected_brightness.gain), self.settings.gain_sigma),
            (
                f64::from(estimate.brightness.offset - self.expected_brightness.offset),
                self.settings.offset_sigma,
            ),
        ];
        for (i, (residual, sigma)) in brightness.into_iter().enumerate() {
            let information = 1.0 / (sigma * sigma);
            result.cost += 0.5 * information * residual * residual;
            result.hessian[(12 + i, 12 + i)] += information;
            result.gradient[12 + i] += information * residual;
        }
    }
}

/// Derivative of the mid pose's left tangent by the left tangents of both ends.
fn mid_from_ends(trajectory: &ExposureTrajectory) -> SMatrix<f64, 6, 12> {
    let blend = trajectory.rotation_blend_left(0.5);
    let mut m = SMatrix::<f64, 6, 12>::zeros();
    m.fixed_view_mut::<3, 3>(0, 0).fill_diagonal(0.5);
    m.fixed_view_mut::<3, 3>(0, 6).fill_diagonal(0.5);
    m.fixed_view_mut::<3, 3>(3, 3).copy_from(&(Matrix3::identity() - blend));
    m.fixed_view_mut::<3, 3>(3, 9).copy_from(&blend);
    m
}

/// Derivative of (start, end) left tangents by (centre, motion) right tangents; gain and offset pass through.
fn centre_motion_from_left(trajectory: &ExposureTrajectory) -> SMatrix<f64, UNKNOWNS, UNKNOWNS> {
    let mut change = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::identity();
    for (row, end, half) in [(0, &trajectory.start, -0.5), (6, &trajectory.end, 0.5)] {
        let left = crate::trajectory::left_from_right(&end.rotation_matrix());
        change.fixed_view_mut::<6, 6>(row, 0).copy_from(&left);
        change.fixed_view_mut::<6, 6>(row, 6).copy_from(&(left * half));
    }
    change
}
