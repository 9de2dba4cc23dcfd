//! Steps of the path of an exposure.

use mba_raster::exposure::{ExposurePath, PATH_PARAMETERS};
use mba_tracker::geometry::RigidTransform;
use nalgebra::{SMatrix, SVector, Vector6};
use serde::{Deserialize, Serialize};

use super::path_metric::PathMetric;
use crate::continuity::MotionPrediction;

/// Decay of the mean of the gradient.
const BETA_1: f64 = 0.9;
/// Decay of the mean of its square.
const BETA_2: f64 = 0.99;
/// Cost of one standard deviation from the predicted motion, in units of the loss: far below what a blurred picture
/// says about its motion, above the noise of a sharp one, which says nothing.
const PRIOR_COST: f64 = 2e-5;
/// Cost of a middle one pixel from where it was measured, twice, in units of the loss. A tracker sees the same pixels as the
/// map, so that what it says counts about as much: squared gradient of the picture over its noise, 0.05^2 / 0.01.
const MEASURED_COST: f64 = 0.25;
/// The same of a middle that nobody has measured: enough to keep the scale.
const GUESSED_COST: f64 = 1e-3;
/// Most that either pulls, relative to one component of what the picture does.
const MIDDLE_PULL: f64 = 3.0;
/// Cost of one standard deviation of the bow, as [`PRIOR_COST`]. A picture says less about the shape of its motion than about
/// its length: what a map does not explain would bend the path.
const BOW_COST: f64 = 2e-3;
/// Standard deviation of the bow as a share of the motion: a hand that shakes at 5 Hz bows that far within 25 ms.
const BOW_SHARE: f64 = 0.1;
/// And of the bow of a camera at rest, pixels.
const LEAST_BOW_PX: f64 = 0.03;
/// Mean share of the bow over an exposure: of `4 s (1 - s)`.
const BOW_MEAN: f64 = 2.0 / 3.0;

/// Longest move of a block, in lengths of the step.
const LONGEST: f64 = 3.0;

/// Moments of the gradients of one path.
///
/// The parameters are the middle, the motion from opening to closing and the bow, each six numbers in the units of a
/// [`PathMetric`], which move the picture by about a pixel. In these coordinates the problem nearly falls apart into
/// three: the middle, the mean of the path, says where the picture is, the motion how it is smeared, the bow in which shape,
/// without moving the mean. All directions
/// share one scale of step, that of the middle, so that what the picture does not show hardly moves: Adam's own scales
/// would let it wander.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathMoments {
    first: [[f64; 6]; 3],
    /// Mean squared gradient by one number of the middle.
    second: f64,
    updates: u32,
    /// The bow in units of the metric.
    bow_units: [f64; 6],
}

impl Default for PathMoments {
    fn default() -> Self {
        Self { first: [[0.0; 6]; 3], second: 0.0, updates: 0, bow_units: [0.0; 6] }
    }
}

/// What is known of a path besides its picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathPrior {
    /// Where the tracker found the middle of the linear motion, `world_from_camera`. It measured every frame against
    /// depth; the scale of map and paths together, which no picture shows, would drift.
    pub middle: RigidTransform,
    /// Whether the middle was measured, not guessed from neighbours.
    pub is_measured: bool,
    /// Motion that the neighbours in time suggest.
    pub motion: Option<MotionPrediction>,
}

/// How far one step goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathStep {
    /// Typical movement of the picture, units of the metric.
    pub pixels: f64,
    /// Whether middle, motion and bow stay as they are.
    pub hold: [bool; 3],
}

impl PathMoments {
    /// Moves `path` one step against `gradient`, the gradient of the loss by the parameters of the path.
    pub fn step(
        &mut self,
        path: &mut ExposurePath,
        gradient: &SVector<f64, PATH_PARAMETERS>,
        prior: &PathPrior,
        metric: &PathMetric,
        step: PathStep,
    ) {
        // Middle, motion and bow in units of about a pixel.
        let blocks = grad_coordinates(gradient).map(|block| metric.grad_units(path, &block));
        self.updates += 1;
        let updates = self.updates.min(10_000) as i32;
        // Adam: running means of gradient and square, without the bias of their start at zero.
        let corrections = [BETA_1, BETA_2].map(|beta| 1.0 / (1.0 - beta.powi(updates)));
        self.second = BETA_2 * self.second + (1.0 - BETA_2) * blocks[0].norm_squared() / 6.0;
        // One scale for all unknowns, that of the middle: the direction of the gradient is kept.
        let typical = (self.second * corrections[1]).sqrt() + 1e-20;
        let gradients = self.with_prior(blocks, typical, path, prior, metric);
        let scale = -step.pixels * corrections[0] / typical;
        let mut moves = [Vector6::zeros(); 3];
        for (block, (mean, gradient)) in self.first.iter_mut().zip(gradients).enumerate() {
            let mean_now = Vector6::from(*mean) * BETA_1 + gradient * (1.0 - BETA_1);
            *mean = mean_now.into();
            // A single gradient that is far too large moves the path no further than a few others.
            moves[block] = capped(mean_now * scale, LONGEST * step.pixels);
        }
        let held = moves.iter_mut().zip(step.hold).filter(|(_, hold)| *hold);
        held.for_each(|(block, _)| block.fill(0.0));
        self.bow_units = (Vector6::from(self.bow_units) + moves[2]).into();
        let tangents = moves.map(|units| metric.tangent(path, &units));
        *path = path.perturbed(&from_coordinates(&tangents));
    }

    /// The gradients by middle, motion and bow with those of the prior, units of the metric. Motion and bow are never
    /// pulled harder than a middle is by its picture, `typical`, a middle not much harder.
    fn with_prior(
        &self,
        [middle, motion, bow]: [Vector6<f64>; 3],
        typical: f64,
        path: &ExposurePath,
        prior: &PathPrior,
        metric: &PathMetric,
    ) -> [Vector6<f64>; 3] {
        let bowed = Vector6::from(self.bow_units);
        // The middle of the linear motion, and what the bow has added to the mean since.
        let drift = prior.middle.tangent_to(&path.ends.mid()) + metric.tangent(path, &bowed) * BOW_MEAN;
        let cost = if prior.is_measured { MEASURED_COST } else { GUESSED_COST };
        let grad_middle = metric.grad_squared_pixels(path, &drift) * cost;
        let grad_motion = metric.grad_units(path, &prior.grad_motion(path));
        let sigma = LEAST_BOW_PX + BOW_SHARE * prior.longest_motion(path, metric);
        let grad_bow = bowed * (BOW_COST / (sigma * sigma));
        [
            middle + capped(grad_middle, MIDDLE_PULL * typical),
            motion + capped(grad_motion, typical),
            bow + capped(grad_bow, typical),
        ]
    }
}

impl PathPrior {
    /// Length of the motion, or of the one that is expected, units of the metric.
    fn longest_motion(&self, path: &ExposurePath, metric: &PathMetric) -> f64 {
        let length = |motion: &Vector6<f64>| metric.units(path, motion).norm();
        let expected = self.motion.map_or(0.0, |prediction| length(&prediction.motion));
        length(&path.ends.motion()).max(expected)
    }

    /// Gradient of the prior by the motion.
    fn grad_motion(&self, path: &ExposurePath) -> Vector6<f64> {
        let Some(prediction) = self.motion else { return Vector6::zeros() };
        let [t, r] = [prediction.translation_sigma, prediction.rotation_sigma].map(|sigma| sigma * sigma);
        let variance = Vector6::new(t, t, t, r, r, r);
        (path.ends.motion() - prediction.motion).component_div(&variance) * PRIOR_COST
    }
}

/// A vector of at most that length: a prior is never stronger than the picture, and no step runs away.
fn capped(vector: Vector6<f64>, length: f64) -> Vector6<f64> {
    let norm = vector.norm();
    if norm > length { vector * (length / norm) } else { vector }
}

/// Gradients by middle, motion and bow.
fn grad_coordinates(gradient: &SVector<f64, PATH_PARAMETERS>) -> [Vector6<f64>; 3] {
    let part = |first: usize| Vector6::from_iterator(gradient.iter().copied().skip(first).take(6));
    let [start, end, bow] = [part(0), part(6), part(12)];
    [start + end, (end - start) * 0.5, bow - (start + end) * BOW_MEAN]
}

/// Tangents at both ends and the bow for moves of middle, motion and bow.
fn from_coordinates([middle, motion, bow]: &[Vector6<f64>; 3]) -> SMatrix<f64, PATH_PARAMETERS, 1> {
    let mut step = SMatrix::<f64, PATH_PARAMETERS, 1>::zeros();
    // The chord recedes as the bow grows, so that the mean stays.
    let chord = middle - bow * BOW_MEAN;
    step.fixed_rows_mut::<6>(0).copy_from(&(chord - motion * 0.5));
    step.fixed_rows_mut::<6>(6).copy_from(&(chord + motion * 0.5));
    step.fixed_rows_mut::<6>(12).copy_from(bow);
    step
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::RigidTransform;
    use mba_tracker::trajectory::ExposureTrajectory;

    use super::*;

    const METRES: f64 = 0.008;
    const RADIANS: f64 = 0.002;

    fn prior() -> PathPrior {
        PathPrior { middle: RigidTransform::identity(), is_measured: false, motion: None }
    }

    /// Minimises half the squared distance of the path's parameters from a target, in pixels.
    fn descend(target: &[Vector6<f64>; 3], prior: &PathPrior, hold_middle: bool) -> [Vector6<f64>; 3] {
        let mut path = ExposurePath::linear(ExposureTrajectory::still(RigidTransform::identity()));
        let mut moments = PathMoments::default();
        let metric = PathMetric::uniform(METRES, RADIANS);
        let unit = Vector6::new(METRES, METRES, METRES, RADIANS, RADIANS, RADIANS);
        let state = |path: &ExposurePath| {
            let chord = RigidTransform::identity().tangent_to(&path.ends.mid());
            [chord + path.bow * BOW_MEAN, path.ends.motion(), path.bow].map(|x| x.component_div(&unit))
        };
        for k in 0..400 {
            let now = state(&path);
            let [a, b, c] = [0, 1, 2].map(|i| (now[i] - target[i]).component_div(&unit));
            let mut gradient = SMatrix::<f64, PATH_PARAMETERS, 1>::zeros();
            gradient.fixed_rows_mut::<6>(0).copy_from(&(a * 0.5 - b));
            gradient.fixed_rows_mut::<6>(6).copy_from(&(a * 0.5 + b));
            gradient.fixed_rows_mut::<6>(12).copy_from(&(c + a * BOW_MEAN));
            let step = PathStep { pixels: 0.1 * 0.98_f64.powi(k), hold: [hold_middle, false, false] };
            moments.step(&mut path, &gradient, prior, &metric, step);
        }
        state(&path)
    }

    #[test]
    fn middle_motion_and_bow_are_found() {
        let target = [
            Vector6::new(0.5, -0.4, 0.3, 0.6, -0.2, 0.1),
            Vector6::new(1.0, 0.5, -0.5, 0.3, 0.8, -0.6),
            Vector6::new(0.2, -0.3, 0.1, 0.4, 0.1, -0.2),
        ];
        let found = descend(&target, &prior(), false);
        for (found, target) in found.iter().zip(&target) {
            assert!((found - target).norm() < 0.1, "{found} instead of {target}");
        }
    }

    #[test]
    fn a_held_middle_stays() {
        let target = [Vector6::repeat(0.5), Vector6::repeat(0.5), Vector6::zeros()];
        let [middle, motion, _] = descend(&target, &prior(), true);
        assert!(middle.norm() < 1e-3 && (motion - target[1]).norm() < 0.1, "{middle} {motion}");
    }

    #[test]
    fn a_bow_leaves_the_mean_of_the_path() {
        let bow = Vector6::new(0.01, 0.0, 0.0, 0.0, 0.0, 0.0);
        let step = from_coordinates(&[Vector6::zeros(), Vector6::zeros(), bow]);
        let path = ExposurePath::linear(ExposureTrajectory::still(RigidTransform::identity()));
        let bent = path.perturbed(&step);
        // Simpson's rule is exact for a parabola.
        let mean =
            (bent.at(0.0).translation + bent.at(0.5).translation * 4.0 + bent.at(1.0).translation) / 6.0;
        assert!(mean.norm() < 1e-12, "{mean}");
        assert!((bent.mid().translation.x - 0.01 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn a_middle_that_was_measured_holds_against_a_picture_that_pulls() {
        // A picture that is best half a pixel off, as sharply as the noise of a tracker.
        let target = [Vector6::new(0.5, 0.0, 0.0, 0.0, 0.0, 0.0), Vector6::zeros(), Vector6::zeros()];
        let [guessed, ..] = descend(&target, &prior(), false);
        assert!((guessed[0] - 0.5).abs() < 0.05, "{guessed}");
        let [measured, ..] = descend(&target, &PathPrior { is_measured: true, ..prior() }, false);
        // Costs of 1 and 0.25 by the squared pixel.
        assert!((measured[0] - 0.4).abs() < 0.05, "{measured}");
    }

    #[test]
    fn without_a_picture_the_motion_is_the_predicted_one_and_the_middle_the_tracked_one() {
        let motion = Vector6::new(0.01, 0.0, -0.005, 0.0, 0.002, 0.0);
        let predicted = MotionPrediction { motion, translation_sigma: 0.01, rotation_sigma: 0.002 };
        let prior = PathPrior { motion: Some(predicted), is_measured: true, ..prior() };
        let away = Vector6::new(METRES, 0.0, 0.0, 0.0, RADIANS, 0.0);
        let mut path =
            ExposurePath::linear(ExposureTrajectory::still(RigidTransform::identity().perturbed(&away)));
        let (mut moments, metric) = (PathMoments::default(), PathMetric::uniform(METRES, RADIANS));
        // The noise of a picture that says nothing.
        let noise = |k: i32| SMatrix::<f64, PATH_PARAMETERS, 1>::repeat(0.02 * f64::from(1 - 2 * (k % 2)));
        for k in 0..3000 {
            let step = PathStep { pixels: 0.05, hold: [false; 3] };
            moments.step(&mut path, &noise(k), &prior, &metric, step);
        }
        let [off, missing] = [path.ends.mid().tangent_to(&prior.middle), path.ends.motion() - motion];
        assert!(off[0].abs() < 0.1 * METRES && off[4].abs() < 0.1 * RADIANS, "{off}");
        assert!(missing.norm() < 0.3 * motion.norm(), "{missing}");
    }
}
