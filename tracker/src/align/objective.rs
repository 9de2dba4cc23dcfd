//! The combined objective and its normal equations in (centre, exposure motion) coordinates.

use arrayvec::ArrayVec;
use core::ops::Range;

use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Vector6};

use super::bands::Bands;
use super::depth_problem::{DepthProblem, DepthSums};
use super::problem::{DepthPart, Objective};
use super::{BOWED_UNKNOWNS, Estimate, UNKNOWNS};
use crate::geometry::RigidTransform;
use crate::trajectory::{BowedTrajectory, SampleRule};
use crate::transfer::{
    self, BOWED_PATH, LINEAR_PATH, MAX_BANDS, PatchCost, PatchSite, ROW_LENGTH, RowBand, RowDelay,
    TransferParts, TransferProblem, virtual_views,
};
use crate::work::Work;

/// Cost and normal equations at an estimate, in the coordinates of [`Estimate::stepped`].
#[derive(Clone, Debug)]
pub(super) struct Linearised {
    /// Value of the objective.
    pub cost: f64,
    /// Gauss-Newton matrix.
    pub hessian: SMatrix<f64, BOWED_UNKNOWNS, BOWED_UNKNOWNS>,
    /// Gradient.
    pub gradient: SVector<f64, BOWED_UNKNOWNS>,
    /// Photometric pixels that took part.
    pub pixels: f64,
    /// What the depth term alone says about the camera's pose: matrix and gradient in left rotations.
    pub depth_pose: (Matrix6<f64>, Vector6<f64>),
    /// Depth points that took part.
    pub depth_points: f64,
    /// Depth points that were compared, within the gate or beyond.
    pub depth_compared: f64,
}

impl Linearised {
    /// Adds a residual that grows with the second unknown and, `per_centre` times as fast, falls with the first.
    fn add_tie(&mut self, [centre, unknown]: [usize; 2], per_centre: f64, information: f64, residual: f64) {
        self.cost += 0.5 * information * residual * residual;
        self.hessian[(unknown, unknown)] += information;
        self.gradient[unknown] += information * residual;
        if per_centre != 0.0 {
            self.hessian[(centre, centre)] += per_centre * per_centre * information;
            self.hessian[(centre, unknown)] -= per_centre * information;
            self.hessian[(unknown, centre)] -= per_centre * information;
            self.gradient[centre] -= per_centre * information * residual;
        }
    }
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
        let mut sums = self.photometric(estimate, costs);
        let mut weight = 1.0 / self.settings.photometric_correlation;
        if let Some((expected, _)) = expected_counts {
            weight *= count_ratio(expected, sums.pixels);
        }
        sums.cost *= weight;
        sums.hessian *= weight;
        sums.gradient *= weight;
        if let Some(depth) = &self.depth {
            self.add_depth(depth, &estimate.path(), expected_counts.map(|counts| counts.1), &mut sums);
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

    /// Adds the depth term, distributed from the poses at which depth was measured to the unknowns of the path, in left
    /// rotations of its ends.
    fn add_depth(
        &self,
        depth: &DepthPart,
        path: &BowedTrajectory,
        expected_points: Option<f64>,
        sums: &mut Linearised,
    ) {
        let mut parts: ArrayVec<(DepthSums, PoseWeights), MAX_BANDS> = ArrayVec::new();
        for (band, s) in self.depth_bands() {
            let problem = DepthProblem { band, ..depth.problem };
            let of_band = problem.linearise(self.simd, &path.at(s), depth.sigma, self.settings.huber);
            parts.push((of_band, PoseWeights::new(path, s)));
        }
        let total = |count: fn(&DepthSums) -> f64| parts.iter().map(|part| count(&part.0)).sum::<f64>();
        let compared = total(|sums| sums.points + sums.gated);
        let weight = depth.weight * expected_points.map_or(1.0, |expected| count_ratio(expected, compared));
        sums.depth_points = total(|sums| sums.points);
        sums.depth_compared = compared;
        let bowed = self.frame.timing.reaches_outside();
        for (of_band, weights) in &parts {
            sums.cost += weight * of_band.cost;
            sums.depth_pose.0 += of_band.hessian * weight;
            sums.depth_pose.1 += of_band.gradient * weight;
            // Symmetric: the columns are spread like the rows, after transposing.
            let spread = weights.rows(&(of_band.hessian * weight)).transpose();
            let block = weights.rows(&spread);
            let rows = weights.rows(&(of_band.gradient * weight));
            let mut linear = sums.hessian.fixed_view_mut::<LINEAR_PATH, LINEAR_PATH>(0, 0);
            linear += block.fixed_view::<LINEAR_PATH, LINEAR_PATH>(0, 0);
            let mut linear = sums.gradient.fixed_rows_mut::<LINEAR_PATH>(0);
            linear += rows.fixed_rows::<LINEAR_PATH>(0);
            if bowed {
                add_bow_block(&block, &rows, sums);
            }
        }
    }

    /// Bands of rows of the depth map and the normalised times at which they were measured.
    pub(super) fn depth_bands(&self) -> impl Iterator<Item = (RowBand, f64)> {
        let (timing, height) = (self.frame.timing, self.frame.depth.height);
        let count = if timing.depth_readout == 0.0 { 1 } else { timing.bands.clamp(1, MAX_BANDS) };
        (0..count).map(move |index| {
            let band = RowBand::new(index, count, height);
            (band, timing.depth_row_time(band.centre(), height))
        })
    }

    /// Normal equations of the photometric term in left rotations, of unit weight.
    fn photometric(&self, estimate: &Estimate, costs: &mut [PatchCost]) -> Linearised {
        let mut sums = Linearised {
            cost: 0.0,
            hessian: SMatrix::zeros(),
            gradient: SVector::zeros(),
            pixels: 0.0,
            depth_pose: (Matrix6::zeros(), Vector6::zeros()),
            depth_points: 0.0,
            depth_compared: 0.0,
        };
        if self.frame.timing.reaches_outside() {
            // Rows at times of their own: bands with views of their own, a path with bow.
            let mut bands = Bands::new(self, estimate, self.sites);
            let all = transfer::linearize_bowed(self.simd, &mut bands, self.sites, &self.model, costs);
            sums.cost = all.cost;
            sums.pixels = all.pixels;
            for i in 0..BOWED_UNKNOWNS {
                sums.gradient[unknown_of_column(i)] = all.gradient[i];
                for j in 0..BOWED_UNKNOWNS {
                    sums.hessian[(unknown_of_column(i), unknown_of_column(j))] = all.hessian[(i, j)];
                }
            }
            return sums;
        }
        // All rows at once: one set of views for all patches; the bow has no share.
        self.for_each_band(estimate, self.sites, |problem, _| {
            let all = transfer::linearize(self.simd, problem, self.sites, &self.model, costs);
            sums.cost = all.cost;
            sums.pixels = all.pixels;
            sums.hessian.fixed_view_mut::<ROW_LENGTH, ROW_LENGTH>(0, 0).copy_from(&all.hessian);
            sums.gradient.fixed_rows_mut::<ROW_LENGTH>(0).copy_from(&all.gradient);
        });
        sums
    }

    /// Calls `visit` with the transfer of every band of rows and the range of `sites` in it; once, with all sites, where
    /// the rows are exposed at the same time.
    pub(super) fn for_each_band(
        &self,
        estimate: &Estimate,
        sites: &[PatchSite],
        mut visit: impl FnMut(&TransferProblem, Range<usize>),
    ) {
        let timing = &self.frame.timing;
        if !timing.reaches_outside() {
            let path = &estimate.keyframe_from_camera;
            let views = virtual_views(path, self.views, SampleRule::Midpoint, &self.camera);
            return visit(&self.transfer_problem(estimate, &views, RowDelay::default()), 0..sites.len());
        }
        let mut bands = Bands::new(self, estimate, sites);
        while let Some((problem, of_band)) = bands.next_part() {
            visit(&problem, of_band);
        }
    }

    fn add_priors(&self, estimate: &Estimate, result: &mut Linearised) {
        let [motion, bow] = self.prior.residuals(&estimate.keyframe_from_camera, &estimate.bow);
        let (of_motion, of_bow) =
            self.prior.follows.map_or(([0.0; 2], [0.0; 2]), |follows| (follows.motion, follows.bow));
        for i in 0..6 {
            result.add_tie([i, 6 + i], of_motion[i / 3], self.prior.information[i], motion[i]);
        }
        for i in 0..6 {
            if self.frame.timing.reaches_outside() {
                result.add_tie([i, UNKNOWNS + i], of_bow[i / 3], self.prior.bow_information[i], bow[i]);
            } else {
                // Not an unknown: it stays where it is.
                result.hessian[(UNKNOWNS + i, UNKNOWNS + i)] = 1.0;
            }
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

/// Unknown that column `column` of a row with bow belongs to: gain and offset come before the bow among the unknowns.
const fn unknown_of_column(column: usize) -> usize {
    match column {
        0..LINEAR_PATH => column,
        LINEAR_PATH..BOWED_PATH => column + (UNKNOWNS - LINEAR_PATH),
        _ => column - (BOWED_PATH - LINEAR_PATH),
    }
}

/// Adds the rows and columns of the bow of a matrix in the order of [`BOWED_PATH`].
fn add_bow_block(
    block: &SMatrix<f64, BOWED_PATH, BOWED_PATH>,
    rows: &SVector<f64, BOWED_PATH>,
    sums: &mut Linearised,
) {
    for i in LINEAR_PATH..BOWED_PATH {
        sums.gradient[unknown_of_column(i)] += rows[i];
        for j in 0..BOWED_PATH {
            sums.hessian[(unknown_of_column(i), unknown_of_column(j))] += block[(i, j)];
            if j < LINEAR_PATH {
                sums.hessian[(unknown_of_column(j), unknown_of_column(i))] += block[(j, i)];
            }
        }
    }
}

/// How the pose at one time of a path follows from its parameters, in left rotations: the matrix
/// `((1 - s) I, 0, s I, 0, q I, 0; 0, I - B, 0, B, 0, q C)` with `q = (s - 1/2)^2`, without its zeros and ones.
struct PoseWeights {
    /// Parts of start, end and bow in the translation.
    translation: [f64; 3],
    /// B.
    blend: Matrix3<f64>,
    /// q C.
    bow_blend: Matrix3<f64>,
}

impl PoseWeights {
    fn new(path: &BowedTrajectory, s: f64) -> Self {
        let height = (s - 0.5) * (s - 0.5);
        Self {
            translation: [1.0 - s, s, height],
            blend: path.linear.rotation_blend_left(s),
            bow_blend: path.bow_blend_left(s) * height,
        }
    }

    /// Turns rows that belong to the pose's left tangent into those of the parameters: multiplies by the transpose.
    fn rows<const COLUMNS: usize>(
        &self,
        pose: &SMatrix<f64, 6, COLUMNS>,
    ) -> SMatrix<f64, BOWED_PATH, COLUMNS> {
        let shift = pose.fixed_rows::<3>(0);
        let turn = pose.fixed_rows::<3>(3);
        let end_turn = self.blend.transpose() * turn;
        let mut rows = SMatrix::<f64, BOWED_PATH, COLUMNS>::zeros();
        for (row, weight) in [0, 6, 12].into_iter().zip(self.translation) {
            rows.fixed_rows_mut::<3>(row).copy_from(&(shift * weight));
        }
        rows.fixed_rows_mut::<3>(3).copy_from(&(turn - end_turn));
        rows.fixed_rows_mut::<3>(9).copy_from(&end_turn);
        rows.fixed_rows_mut::<3>(15).copy_from(&(self.bow_blend.transpose() * turn));
        rows
    }
}

/// Turns rows that belong to (start, end) left tangents, at the rotations `ends`, into those of (centre, motion)
/// right tangents; gain, offset and bow stay. With `R` the rotation of an end, the left turn is `R` times the right one;
/// start and end are `centre -+ motion/2`.
fn rows_by_centre_and_motion<const COLUMNS: usize>(
    ends: &[Matrix3<f64>; 2],
    rows: &mut SMatrix<f64, BOWED_UNKNOWNS, COLUMNS>,
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
        let mut change = SMatrix::<f64, BOWED_UNKNOWNS, BOWED_UNKNOWNS>::identity();
        for (row, end, half) in [(0, &ends[0], -0.5), (6, &ends[1], 0.5)] {
            let left = crate::trajectory::left_from_right(end);
            change.fixed_view_mut::<6, 6>(row, 0).copy_from(&left);
            change.fixed_view_mut::<6, 6>(row, 6).copy_from(&(left * half));
        }
        let mut rows = symmetric::<BOWED_UNKNOWNS>();
        let expected = change.transpose() * rows;
        rows_by_centre_and_motion(&ends, &mut rows);
        assert!((rows - expected).norm() < 1e-12 * expected.norm());
    }

    #[test]
    fn rows_of_the_path_are_the_product_with_the_weights_of_the_pose() {
        let (s, height) = (0.8, 0.09);
        let weights = PoseWeights {
            translation: [1.0 - s, s, height],
            blend: turns()[0] * s,
            bow_blend: turns()[1] * height,
        };
        let mut pose_from_path = SMatrix::<f64, 6, BOWED_PATH>::zeros();
        for (column, weight) in [(0, 1.0 - s), (6, s), (12, height)] {
            pose_from_path.fixed_view_mut::<3, 3>(0, column).fill_diagonal(weight);
        }
        pose_from_path.fixed_view_mut::<3, 3>(3, 3).copy_from(&(Matrix3::identity() - weights.blend));
        pose_from_path.fixed_view_mut::<3, 3>(3, 9).copy_from(&weights.blend);
        pose_from_path.fixed_view_mut::<3, 3>(3, 15).copy_from(&weights.bow_blend);
        let pose = symmetric::<6>();
        let expected = pose_from_path.transpose() * pose;
        assert!((weights.rows(&pose) - expected).norm() < 1e-12 * expected.norm());
    }
}
