//! Sums of squared distances from planes and points, as functions of a position.

use nalgebra::{Matrix3, Vector3};

/// `x' A x - 2 b' x + c`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Quadric {
    a: Matrix3<f64>,
    b: Vector3<f64>,
    c: f64,
}

impl Quadric {
    /// `weight` times the squared distance from the plane through `point` with the unit vector `normal`.
    pub(super) fn plane(normal: &Vector3<f64>, point: &Vector3<f64>, weight: f64) -> Self {
        let along = normal.dot(point);
        Self {
            a: weight * normal * normal.transpose(),
            b: weight * along * normal,
            c: weight * along * along,
        }
    }

    /// `weight` times the squared distance from `point`.
    pub(super) fn point(point: &Vector3<f64>, weight: f64) -> Self {
        Self { a: Matrix3::identity() * weight, b: weight * point, c: weight * point.norm_squared() }
    }

    /// The value at `x`, which rounding does not take below zero.
    pub(super) fn at(&self, x: &Vector3<f64>) -> f64 {
        ((self.a * x - 2.0 * self.b).dot(x) + self.c).max(0.0)
    }

    /// Where the value is least; none where that is not one place.
    pub(super) fn least(&self) -> Option<Vector3<f64>> {
        self.a.cholesky().map(|factor| factor.solve(&self.b)).filter(|x| x.iter().all(|x| x.is_finite()))
    }
}

impl core::ops::AddAssign for Quadric {
    fn add_assign(&mut self, other: Self) {
        self.a += other.a;
        self.b += other.b;
        self.c += other.c;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_planes_meet_where_the_sum_is_least() {
        let corner = Vector3::new(1.0, -2.0, 0.5);
        let mut sum = Quadric::default();
        for (axis, weight) in [(Vector3::x(), 1.0), (Vector3::y(), 2.0), (Vector3::z(), 0.5)] {
            sum += Quadric::plane(&axis, &corner, weight);
        }
        assert!((sum.least().unwrap() - corner).norm() < 1e-12);
        assert!(sum.at(&corner) < 1e-12);
        // One squared, twice four, half of nine.
        assert!((sum.at(&(corner + Vector3::new(1.0, 2.0, -3.0))) - 13.5).abs() < 1e-12);
        sum += Quadric::point(&(corner + Vector3::x()), 1.0);
        assert!((sum.least().unwrap() - (corner + 0.5 * Vector3::<f64>::x())).norm() < 1e-12);
        assert_eq!(Quadric::plane(&Vector3::x(), &corner, 1.0).least(), None);
    }
}
