//! How uncertain poses are relative to the first frame.

use mba_io::checkpoint::exact_poses::{PoseNumbers, numbers, pose};
use mba_io::statistics::quantile;
use mba_tracker::geometry::{RigidTransform, so3};
use mba_tracker::{FrameResult, FrameStatus};
use nalgebra::{Matrix3, Matrix6};
use serde::{Deserialize, Serialize};

/// Adds up the uncertainty of each frame relative to its keyframe and that of the keyframe.
///
/// A frame is as uncertain relative to its keyframe as the alignment says, times how far picture and depth contradict each
/// other beyond their noise (the ratio of Birge, as in averages of measurements that do not agree). A keyframe that is turned
/// wrongly displaces what is far from it.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Uncertainty {
    frames: Vec<Pose>,
    /// How far picture and depth contradict each other in each frame.
    disagreements: Vec<f64>,
}

/// Uncertainty of one frame relative to the first.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Pose {
    /// Columns of the covariance of the pose, translation in world axes, rotation in the camera's.
    covariance: [[f64; 6]; 6],
    world_from_mid: PoseNumbers,
    measured: Measured,
}

/// What a frame was aligned with, and how uncertain it is relative to that.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Index of the frame that it was aligned with; its own where there is none.
    pub reference: usize,
    /// Standard deviations along one axis, metres, and about one, radians; 0 for a frame that was not aligned.
    pub sigma: [f64; 2],
}

impl Measured {
    /// The same with the reference as a frame of the recording, of which the tracker was `given` some.
    fn of_recording(self, given: &[usize]) -> Self {
        Self { reference: given.get(self.reference).copied().unwrap_or(0), ..self }
    }
}

impl Uncertainty {
    /// Median over the frames of how far picture and depth contradict each other: below 1 where only noise sets them apart.
    pub(crate) fn disagreement(&self) -> f64 {
        quantile(&self.disagreements, 0.5).unwrap_or(0.0)
    }

    /// What each frame was aligned with; `given` are the frames of the recording that were taken in.
    pub(crate) fn measured(&self, given: &[usize]) -> Vec<Measured> {
        self.frames.iter().map(|frame| frame.measured.of_recording(given)).collect()
    }

    /// What the last frame was aligned with.
    pub(crate) fn last_measured(&self, given: &[usize]) -> Measured {
        self.frames.last().map(|frame| frame.measured.of_recording(given)).unwrap_or_default()
    }

    /// Covariance of each frame's pose at mid exposure relative to the first frame: translation in world axes, square metres,
    /// then rotation in the camera's, square radians. None for the first frame and where a frame was lost.
    pub(crate) fn covariances(&self) -> impl Iterator<Item = Option<Matrix6<f64>>> {
        self.frames.iter().map(|frame| {
            let covariance = Matrix6::from(frame.covariance);
            let is_aligned = frame.measured.sigma.iter().all(|sigma| *sigma > 0.0);
            // An alignment that left a direction open has an inverse that is no covariance.
            (is_aligned && covariance.cholesky().is_some()).then_some(covariance)
        })
    }

    /// Takes in the next frame and returns the standard deviation of its position, metres: all axes together, at mid exposure,
    /// relative to the first frame. None where the frame was lost.
    pub(crate) fn add(&mut self, result: &FrameResult) -> Option<f64> {
        self.disagreements.push(result.disagreement);
        let world_from_mid = result.world_from_mid;
        let start = Pose { world_from_mid: numbers(&world_from_mid), ..Pose::default() };
        let reference = self.frames.get(result.reference_index).copied().unwrap_or(start);
        let sigma = sigma_of(result);
        let own = covariance(result).map(|own| own * exaggeration(result)).unwrap_or_default();
        let world_from_reference = pose(reference.world_from_mid);
        let covariance = chained(
            &world_from_reference,
            &world_from_reference.inverse().compose(&world_from_mid),
            [&Matrix6::from(reference.covariance), &own],
        );
        self.frames.push(Pose {
            covariance: covariance.into(),
            world_from_mid: numbers(&world_from_mid),
            measured: Measured { reference: result.reference_index, sigma: sigma.unwrap_or_default() },
        });
        let is_first = self.frames.len() == 1;
        let [position, _] = variances(&covariance);
        (sigma.is_some() || is_first).then(|| position.sqrt()).filter(|sigma| sigma.is_finite())
    }
}

/// Covariance of the pose of a frame relative to what it was aligned with as the alignment says it, translation in the axes of
/// that; none where it was not aligned, or lost: an alignment that was not believed says nothing about the pose that is held.
fn covariance(result: &FrameResult) -> Option<Matrix6<f64>> {
    if result.status == FrameStatus::Lost {
        return None;
    }
    let of_all = result.information.try_inverse()?;
    let of_pose = of_all.fixed_view::<6, 6>(0, 0);
    // Rounding leaves the halves a little different.
    Some((of_pose + of_pose.transpose()) * 0.5)
}

/// How many times larger variances are than an alignment says.
fn exaggeration(result: &FrameResult) -> f64 {
    result.disagreement.max(1.0)
}

/// Covariance of the pose of a frame that was aligned with a reference, from the covariances of the reference's pose and of
/// the alignment; translations in the axes of the world and of the reference, rotations in the cameras'.
fn chained(
    world_from_reference: &RigidTransform,
    reference_from_mid: &RigidTransform,
    [of_reference, of_alignment]: [&Matrix6<f64>; 2],
) -> Matrix6<f64> {
    let turn = world_from_reference.rotation_matrix();
    // A reference that is turned by a little moves what is far from it across the line to it.
    let lever = -turn * so3::hat(&reference_from_mid.translation);
    let by_reference =
        blocks(&Matrix3::identity(), &lever, &reference_from_mid.rotation_matrix().transpose());
    let by_alignment = blocks(&turn, &Matrix3::zeros(), &Matrix3::identity());
    let sum = by_reference * of_reference * by_reference.transpose()
        + by_alignment * of_alignment * by_alignment.transpose();
    (sum + sum.transpose()) * 0.5
}

/// A matrix of blocks whose lower left one is zero.
fn blocks(upper_left: &Matrix3<f64>, upper_right: &Matrix3<f64>, lower_right: &Matrix3<f64>) -> Matrix6<f64> {
    let mut matrix = Matrix6::zeros();
    matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(upper_left);
    matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(upper_right);
    matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(lower_right);
    matrix
}

/// Variances of position, square metres, and rotation, square radians, all axes together.
fn variances(covariance: &Matrix6<f64>) -> [f64; 2] {
    [0, 3].map(|first| (first..first + 3).map(|i| covariance[(i, i)]).sum())
}

/// Three axes share a variance.
fn along_one_axis(variance: f64) -> f64 {
    (variance / 3.0).sqrt()
}

/// The standard deviations of [`Measured`].
pub(crate) fn sigma_of(result: &FrameResult) -> Option<[f64; 2]> {
    let variances = variances(&covariance(result)?);
    Some(variances.map(|variance| along_one_axis(variance * exaggeration(result))))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Vector3, Vector6};

    use super::*;

    /// Numerical derivative of the pose of a frame by `vary`, which moves one of the two poses that it is the product of.
    fn derivative(vary: impl Fn(&Vector6<f64>) -> RigidTransform) -> Matrix6<f64> {
        let at = vary(&Vector6::zeros());
        let step = 1e-5;
        let column = |k: usize| {
            let [ahead, behind] =
                [step, -step].map(|step| at.tangent_to(&vary(&(Vector6::ith(k, 1.0) * step))));
            (ahead - behind) / (2.0 * step)
        };
        Matrix6::from_columns(&[0, 1, 2, 3, 4, 5].map(column))
    }

    fn spread(seed: f64) -> Matrix6<f64> {
        let root = Matrix6::from_fn(|i, j| ((1.7 * i as f64 + 0.9 * j as f64) * seed).sin());
        root * root.transpose() * 1e-4
    }

    #[test]
    fn covariances_go_through_a_keyframe_as_poses_do() {
        let world_from_reference =
            RigidTransform::new(so3::exp(&Vector3::new(0.4, -0.8, 0.3)), Vector3::new(1.0, 2.0, -0.5));
        let reference_from_mid =
            RigidTransform::new(so3::exp(&Vector3::new(-0.2, 0.1, 0.5)), Vector3::new(0.3, -0.1, 0.8));
        let by_reference =
            derivative(|tangent| world_from_reference.perturbed(tangent).compose(&reference_from_mid));
        let by_alignment =
            derivative(|tangent| world_from_reference.compose(&reference_from_mid.perturbed(tangent)));
        let [of_reference, of_alignment] = [spread(1.0), spread(2.3)];
        let expected = by_reference * of_reference * by_reference.transpose()
            + by_alignment * of_alignment * by_alignment.transpose();
        let found = chained(&world_from_reference, &reference_from_mid, [&of_reference, &of_alignment]);
        assert!((found - expected).amax() < 1e-9 * expected.amax(), "{found}{expected}");
    }

    #[test]
    fn a_turned_keyframe_displaces_what_is_far_from_it_across_the_line_to_it() {
        let away = RigidTransform { translation: Vector3::new(0.0, 0.0, 2.0), ..RigidTransform::identity() };
        let turned = Matrix6::from_diagonal(&Vector6::new(0.0, 0.0, 0.0, 1e-4, 1e-4, 1e-4));
        let found = chained(&RigidTransform::identity(), &away, [&turned, &Matrix6::zeros()]);
        // Two metres times a hundredth of a radian.
        for (axis, expected) in [(0, 4e-4), (1, 4e-4), (2, 0.0)] {
            assert!((found[(axis, axis)] - expected).abs() < 1e-15, "{found}");
        }
    }
}
