//! Rigid transforms: the one pose representation of the project.

use nalgebra::{Matrix3, UnitQuaternion, Vector3, Vector6};

use super::so3;

/// A rigid transform `a_from_b`: maps coordinates of frame b into frame a, `x_a = R x_b + p`.
///
/// Variables of this type are named after the mapping, e.g. `world_from_camera`, `keyframe_from_current`.
/// Translations are in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidTransform {
    /// R as a unit quaternion.
    pub rotation: UnitQuaternion<f64>,
    /// p, the origin of frame b in frame a, metres.
    pub translation: Vector3<f64>,
}

impl Default for RigidTransform {
    fn default() -> Self {
        Self::identity()
    }
}

impl RigidTransform {
    /// The transform from rotation and translation.
    #[must_use]
    pub const fn new(rotation: UnitQuaternion<f64>, translation: Vector3<f64>) -> Self {
        Self { rotation, translation }
    }

    /// The transform that changes nothing.
    #[must_use]
    pub fn identity() -> Self {
        Self { rotation: UnitQuaternion::identity(), translation: Vector3::zeros() }
    }

    /// R as a matrix.
    #[must_use]
    #[inline]
    pub fn rotation_matrix(&self) -> Matrix3<f64> {
        self.rotation.to_rotation_matrix().into_inner()
    }

    /// `b_from_a` of an `a_from_b`.
    #[must_use]
    #[inline]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// `a_from_c` of `a_from_b` (self) and `b_from_c`.
    #[must_use]
    #[inline]
    pub fn compose(&self, b_from_c: &Self) -> Self {
        Self {
            rotation: self.rotation * b_from_c.rotation,
            translation: self.rotation * b_from_c.translation + self.translation,
        }
    }

    /// Maps a point of frame b into frame a.
    #[must_use]
    #[inline]
    pub fn transform_point(&self, x_b: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * x_b + self.translation
    }

    /// Applies the tangent vector (translation in frame a, rotation in frame b): `p + dt`, `R exp(dr)`; the
    /// quaternion is renormalised.
    #[must_use]
    pub fn perturbed(&self, tangent: &Vector6<f64>) -> Self {
        let dt = tangent.fixed_rows::<3>(0).into_owned();
        let dr = tangent.fixed_rows::<3>(3).into_owned();
        Self {
            rotation: so3::renormalised(&(self.rotation * so3::exp(&dr))),
            translation: self.translation + dt,
        }
    }

    /// The tangent vector that [`Self::perturbed`] would need to reach `other`.
    #[must_use]
    pub fn tangent_to(&self, other: &Self) -> Vector6<f64> {
        let dt = other.translation - self.translation;
        let dr = so3::log(&(self.rotation.inverse() * other.rotation));
        Vector6::new(dt.x, dt.y, dt.z, dr.x, dr.y, dr.z)
    }

    /// Whether every number is finite and the quaternion has unit length within 1e-3.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let norm = self.rotation.into_inner().norm_squared();
        self.translation.iter().all(|v| v.is_finite()) && (norm - 1.0).abs() < 2e-3
    }
}
