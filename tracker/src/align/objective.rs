//! The combined objective and its normal equations in (centre, exposure motion) coordinates.

use fearless_simd::Level;
use nalgebra::{Matrix3, SMatrix, SVector};

use super::depth_term::DepthProblem;
use super::prior::MotionPrior;
use super::{AlignSettings, Estimate, UNKNOWNS};
use crate::geometry::{PinholeCamera, RigidTransform};
use crate::image::{GreyLevel, PixelRectangle};
use crate::keyframe::Keypoint;
use crate::surface::{InverseDepthMap, SurfacePlanes};
use crate::trajectory::{ExposureTrajectory, SampleRule};
use crate::transfer::{
    self, BrightnessModel, PatchCost, PatchSite, PhotometricSums, ResidualModel, TransferProblem,
    virtual_views,
};
use crate::work::Work;

/// The sharp reference that a frame is aligned with.
#[derive(Clone, Copy, Debug)]
pub struct ReferenceData<'a> {
    /// Sharp image, finest level first.
    pub levels: &'a [GreyLevel<'a>],
    /// Keypoints of every level.
    pub keypoints: &'a [&'a [Keypoint]],
    /// Inverse depth.
    pub depth: &'a InverseDepthMap<'a>,
    /// Surface planes of the depth map.
    pub planes: &'a SurfacePlanes<'a>,
}

/// The frame that is aligned.
#[derive(Clone, Copy, Debug)]
pub struct FrameData<'a> {
    /// Blurred image, finest level first.
    pub levels: &'a [GreyLevel<'a>],
    /// Inverse depth at mid exposure.
    pub depth: &'a InverseDepthMap<'a>,
    /// Which of `levels` has the size of `depth`.
    pub depth_level: usize,
    /// Part of `levels[0]` that holds data.
    pub region: PixelRectangle,
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

/// The depth term with its measured noise.
#[derive(Clone, Copy, Debug)]
pub(super) struct DepthPart<'a> {
    pub(super) problem: DepthProblem<'a>,
    /// Robust standard deviation, 1/m.
    pub(super) sigma: f32,
    /// Independent measurements per point.
    pub(super) weight: f64,
}

/// Everything that stays fixed while steps on one level are tried out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Objective<'a> {
    pub(super) simd: Level,
    pub(super) camera: PinholeCamera,
    pub(super) depth_camera: PinholeCamera,
    pub(super) level: usize,
    pub(super) reference: ReferenceData<'a>,
    pub(super) frame: FrameData<'a>,
    pub(super) sites: &'a [PatchSite],
    pub(super) views: usize,
    pub(super) model: ResidualModel,
    pub(super) depth: Option<DepthPart<'a>>,
    pub(super) prior: MotionPrior,
    pub(super) expected_brightness: BrightnessModel,
    /// Typical inverse depth of the scene, 1/m.
    pub(super) inverse_depth: f64,
    pub(super) settings: &'a AlignSettings,
}

/// Cost and normal equations at an estimate, in the coordinates of [`Estimate::stepped`].
#[derive(Clone, Debug)]
pub(super) struct Linearised {
    /// Value of the objective.
    pub cost: f64,
    /// Gauss-Newton matrix.
    pub hessian: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    /// Gradient.
    pub gradient: SVector<f64, UNKNOWNS>,
    /// Photometric pixels that took part.
    pub pixels: f64,
    /// Depth points that took part.
    pub depth_points: f64,
    /// Depth points that were compared, within the gate or beyond.
    pub depth_compared: f64,
}

impl Objective<'_> {
    /// What one evaluation takes.
    pub(super) fn work(&self) -> Work {
        let patches = Work::of_patches(self.sites.len(), self.views);
        let depth = self.depth.as_ref().map_or(Work::none(), |depth| {
            let map = depth.problem.current;
            Work::of_depth(map.width, map.height, depth.problem.stride)
        });
        Work { linearisations: 1, ..patches + depth }
    }

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
        let mut weight = 1.0 / self.settings.photometric_correlation;
        if let Some((expected, _)) = expected_counts {
            weight *= count_ratio(expected, pixels);
        }
        let mut sums = Linearised {
            cost: weight * photometric.cost,
            hessian: photometric.hessian * weight,
            gradient: photometric.gradient * weight,
            pixels,
            depth_points: 0.0,
            depth_compared: 0.0,
        };
        if let Some(depth) = &self.depth {
            self.add_depth(depth, trajectory, expected_counts.map(|counts| counts.1), &mut sums);
        }
        // The matrix is symmetric: what is done to its rows is done to its columns after transposing it.
        let ends = [&trajectory.start, &trajectory.end].map(RigidTransform::rotation_matrix);
        for _ in 0..2 {
            rows_by_centre_and_motion(&ends, &mut sums.hessian);
            sums.hessian.transpose_mut();
        }
        rows_by_centre_and_motion(&ends, &mut sums.gradient);
        self.add_priors(estimate, &mut sums);
        sums
    }

    /// Adds the depth term, distributed from the mid pose to both ends, in left rotations.
    fn add_depth(
        &self,
        depth: &DepthPart,
        trajectory: &ExposureTrajectory,
        expected_points: Option<f64>,
        sums: &mut Linearised,
    ) {
        let depth_sums =
            depth.problem.linearise(self.simd, &trajectory.mid(), depth.sigma, self.settings.huber);
        let compared = depth_sums.points + depth_sums.gated;
        let weight = depth.weight * expected_points.map_or(1.0, |expected| count_ratio(expected, compared));
        let blend = trajectory.rotation_blend_left(0.5);
        sums.cost += weight * depth_sums.cost;
        sums.depth_points = depth_sums.points;
        sums.depth_compared = compared;
        let mut block = sums.hessian.fixed_view_mut::<12, 12>(0, 0);
        // Symmetric: the columns are spread like the rows, after transposing.
        let spread = rows_by_ends(&blend, &(depth_sums.hessian * weight)).transpose();
        block += rows_by_ends(&blend, &spread);
        let mut rows = sums.gradient.fixed_rows_mut::<12>(0);
        rows += rows_by_ends(&blend, &(depth_sums.gradient * weight));
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
            reference: self.reference.levels[self.level].image(),
            current: self.frame.levels[self.level].image(),
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

fn count_ratio(expected: f64, count: f64) -> f64 {
    if count > 0.0 { expected / count } else { 1.0 }
}

/// Turns rows that belong to the mid pose's left tangent into those of the left tangents of both ends, where
/// `blend` is the part of the end in the mid rotation: multiplies by the transpose of
/// `(I/2, 0, I/2, 0; 0, I - B, 0, B)` without the products with zero and one.
fn rows_by_ends<const COLUMNS: usize>(
    blend: &Matrix3<f64>,
    mid: &SMatrix<f64, 6, COLUMNS>,
) -> SMatrix<f64, 12, COLUMNS> {
    let translation = mid.fixed_rows::<3>(0) * 0.5;
    let turn = mid.fixed_rows::<3>(3);
    let end_turn = blend.transpose() * turn;
    let mut ends = SMatrix::<f64, 12, COLUMNS>::zeros();
    ends.fixed_rows_mut::<3>(0).copy_from(&translation);
    ends.fixed_rows_mut::<3>(3).copy_from(&(turn - end_turn));
    ends.fixed_rows_mut::<3>(6).copy_from(&translation);
    ends.fixed_rows_mut::<3>(9).copy_from(&end_turn);
    ends
}

/// Turns rows that belong to (start, end) left tangents, at the rotations `ends`, into those of (centre, motion)
/// right tangents; gain and offset stay. With `R` the rotation of an end, the left turn is `R` times the right one;
/// start and end are `centre -+ motion/2`.
fn rows_by_centre_and_motion<const COLUMNS: usize>(
    ends: &[Matrix3<f64>; 2],
    rows: &mut SMatrix<f64, UNKNOWNS, COLUMNS>,
) {
    for (row, rotation) in [3, 9].into_iter().zip(ends) {
        let turned = rotation.transpose() * rows.fixed_rows::<3>(row);
        rows.fixed_rows_mut::<3>(row).copy_from(&turned);
    }
    for column in 0..COLUMNS {
        for row in 0..6 {
            let (start, end) = (rows[(row, column)], rows[(row + 6, column)]);
            rows[(row, column)] = start + end;
            rows[(row + 6, column)] = 0.5 * (end - start);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A symmetric matrix without any other structure.
    fn symmetric<const N: usize>() -> SMatrix<f64, N, N> {
        SMatrix::from_fn(|i, j| 1.0 + 0.1 * (i * j) as f64 + 0.37 * (i + j) as f64 % 1.0)
    }

    fn turns() -> [Matrix3<f64>; 2] {
        let turn = |x, y, z| crate::geometry::so3::exp_matrix(&nalgebra::Vector3::new(x, y, z));
        [turn(0.3, -0.5, 0.2), turn(-0.1, 0.4, 0.3)]
    }

    #[test]
    fn centre_and_motion_are_the_product_with_the_change_of_coordinates() {
        let ends = turns();
        let mut change = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::identity();
        for (row, end, half) in [(0, &ends[0], -0.5), (6, &ends[1], 0.5)] {
            let left = crate::trajectory::left_from_right(end);
            change.fixed_view_mut::<6, 6>(row, 0).copy_from(&left);
            change.fixed_view_mut::<6, 6>(row, 6).copy_from(&(left * half));
        }
        let mut rows = symmetric::<UNKNOWNS>();
        let expected = change.transpose() * rows;
        rows_by_centre_and_motion(&ends, &mut rows);
        assert!((rows - expected).norm() < 1e-12 * expected.norm());
    }

    #[test]
    fn both_ends_are_the_product_with_the_blend() {
        let blend = turns()[0] * 0.5;
        let mut mid_from_ends = SMatrix::<f64, 6, 12>::zeros();
        mid_from_ends.fixed_view_mut::<3, 3>(0, 0).fill_diagonal(0.5);
        mid_from_ends.fixed_view_mut::<3, 3>(0, 6).fill_diagonal(0.5);
        mid_from_ends.fixed_view_mut::<3, 3>(3, 3).copy_from(&(Matrix3::identity() - blend));
        mid_from_ends.fixed_view_mut::<3, 3>(3, 9).copy_from(&blend);
        let mid = symmetric::<6>();
        let expected = mid_from_ends.transpose() * mid;
        assert!((rows_by_ends(&blend, &mid) - expected).norm() < 1e-12 * expected.norm());
    }
}
