//! Linear motion between the poses at shutter opening and closing (MBA-SLAM equations 6 and 7).

use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector6};

use crate::geometry::{RigidTransform, so3};

/// The camera's path while the shutter is open: translation linear in time, rotation at constant angular
/// velocity, decoupled (MBA-SLAM equations 6 and 7).
///
/// Both poses are `reference_from_camera`. The decoupled form commutes with a change of the reference frame
/// (left multiplication of both ends), not with a change of the body point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExposureTrajectory {
    /// `reference_from_camera` at shutter opening, s = 0.
    pub start: RigidTransform,
    /// `reference_from_camera` at shutter closing, s = 1.
    pub end: RigidTransform,
}

/// Where the virtual views of one exposure are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleRule {
    /// `s = (k + 1/2)/n`: the estimated ends are the true ends of the exposure.
    Midpoint,
    /// `s = k/(n - 1)`, the papers' rule: only for data that was generated this way with the same n.
    Endpoint,
}

impl SampleRule {
    /// Normalised time of virtual view `k` of `n`; a single view is at mid exposure for either rule.
    #[must_use]
    #[inline]
    pub fn time(self, k: usize, n: usize) -> f64 {
        match self {
            _ if n <= 1 => 0.5,
            Self::Midpoint => (k as f64 + 0.5) / n as f64,
            Self::Endpoint => k as f64 / (n - 1) as f64,
        }
    }
}

impl ExposureTrajectory {
    /// A camera that does not move during the exposure.
    #[must_use]
    pub fn still(reference_from_camera: RigidTransform) -> Self {
        Self { start: reference_from_camera, end: reference_from_camera }
    }

    /// The path with pose `mid` at mid exposure and the whole motion `velocity` (translation in the reference
    /// frame in metres, rotation in the camera frame in radians, per exposure).
    #[must_use]
    pub fn from_mid_and_motion(mid: &RigidTransform, motion: &Vector6<f64>) -> Self {
        let half = motion * 0.5;
        Self { start: mid.perturbed(&-half), end: mid.perturbed(&half) }
    }

    /// Rotation vector of the whole exposure, in the camera frame at opening, radians.
    #[must_use]
    pub fn rotation_vector(&self) -> Vector3<f64> {
        so3::log(&(self.start.rotation.inverse() * self.end.rotation))
    }

    /// Whole motion from opening to closing: translation in the reference frame, rotation in the camera frame.
    #[must_use]
    pub fn motion(&self) -> Vector6<f64> {
        self.start.tangent_to(&self.end)
    }

    /// `reference_from_camera` at normalised time `s`; values outside `[0, 1]` extrapolate.
    #[must_use]
    pub fn at(&self, s: f64) -> RigidTransform {
        self.at_turned(s, &self.rotation_vector())
    }

    /// [`Self::at`] for the [`Self::rotation_vector`] `omega`, which many times of one path share.
    #[must_use]
    pub(super) fn at_turned(&self, s: f64, omega: &Vector3<f64>) -> RigidTransform {
        RigidTransform {
            rotation: self.start.rotation * so3::exp(&(omega * s)),
            translation: self.start.translation * (1.0 - s) + self.end.translation * s,
        }
    }

    /// `reference_from_camera` at mid exposure.
    #[must_use]
    pub fn mid(&self) -> RigidTransform {
        self.at(0.5)
    }

    /// The matrix B with `dr_s = (I - B) dr_start + B dr_end` for right perturbations.
    #[must_use]
    pub fn rotation_blend(&self, s: f64) -> Matrix3<f64> {
        let omega = self.rotation_vector();
        let (c1, c2) = blend_coefficients(omega.norm(), s);
        let w = so3::hat(&omega);
        Matrix3::identity() * s + w * c1 + w * w * c2
    }

    /// The matrix B_L with `phi_s = (I - B_L) phi_start + B_L phi_end` for left perturbations, i.e. rotations
    /// of the reference frame.
    #[must_use]
    pub fn rotation_blend_left(&self, s: f64) -> Matrix3<f64> {
        self.rotation_blend_left_turned(s, &self.rotation_vector())
    }

    /// [`Self::rotation_blend_left`] for the [`Self::rotation_vector`] `omega`.
    #[must_use]
    pub(super) fn rotation_blend_left_turned(&self, s: f64, omega: &Vector3<f64>) -> Matrix3<f64> {
        let omega = self.start.rotation * omega;
        let (c1, c2) = blend_coefficients(omega.norm(), s);
        let w = so3::hat(&omega);
        Matrix3::identity() * s - w * c1 + w * w * c2
    }

    /// Derivative of the pose at `s` with respect to (start, end), all as tangent vectors of
    /// [`RigidTransform::perturbed`]: 6 rows, 12 columns.
    #[must_use]
    pub fn pose_jacobian(&self, s: f64) -> SMatrix<f64, 6, 12> {
        let b = self.rotation_blend(s);
        let mut jacobian = SMatrix::<f64, 6, 12>::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, 0).fill_diagonal(1.0 - s);
        jacobian.fixed_view_mut::<3, 3>(0, 6).fill_diagonal(s);
        jacobian.fixed_view_mut::<3, 3>(3, 3).copy_from(&(Matrix3::identity() - b));
        jacobian.fixed_view_mut::<3, 3>(3, 9).copy_from(&b);
        jacobian
    }

    /// Both ends seen from another reference frame: `other_from_reference` times each end.
    #[must_use]
    pub fn seen_from(&self, other_from_reference: &RigidTransform) -> Self {
        Self {
            start: other_from_reference.compose(&self.start),
            end: other_from_reference.compose(&self.end),
        }
    }

    /// The same path travelled backwards; it produces exactly the same blurred image.
    #[must_use]
    pub fn reversed(&self) -> Self {
        Self { start: self.end, end: self.start }
    }

    /// Applies tangent vectors to both ends, ordered (start, end).
    #[must_use]
    pub fn perturbed(&self, tangent: &SMatrix<f64, 12, 1>) -> Self {
        Self {
            start: self.start.perturbed(&tangent.fixed_rows::<6>(0).into_owned()),
            end: self.end.perturbed(&tangent.fixed_rows::<6>(6).into_owned()),
        }
    }
}

/// `E = blockdiag(I, R)` with `left tangent = E * right tangent` for one pose: turns normal equations that were
/// accumulated for left rotations into the project's tangent, `H = E^T H_L E`.
#[must_use]
pub fn left_from_right(rotation: &Matrix3<f64>) -> Matrix6<f64> {
    let mut e = Matrix6::identity();
    e.fixed_view_mut::<3, 3>(3, 3).copy_from(rotation);
    e
}

/// Coefficients c1 of W and c2 of W^2 in the rotation blend for angle `theta` and time `s`.
fn blend_coefficients(theta: f64, s: f64) -> (f64, f64) {
    let k = so3::sinc(0.5 * theta);
    let c1 = 0.5 * s * (1.0 - s) * so3::sinc(0.5 * s * theta) * so3::sinc(0.5 * (1.0 - s) * theta) / k;
    let h = s - 0.5;
    let c2 = h * (h * h * so3::sinc_deficit(h * theta) - 0.25 * so3::sinc_deficit(0.5 * theta)) / k;
    (c1, c2)
}
