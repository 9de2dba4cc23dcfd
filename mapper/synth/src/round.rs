//! A way round a scene that ends where it began.

use std::f64::consts::TAU;

use mba_tracker::geometry::RigidTransform;
use nalgebra::Vector3;

use super::heading::upright_camera;

/// A walk on an ellipse, or out along its longer side and back. Metres, radians.
#[derive(Clone, Copy)]
pub(super) struct Round {
    pub(super) centre: Vector3<f64>,
    /// Half axes of the ellipse along x and z; along y the height goes up and down twice.
    pub(super) radii: Vector3<f64>,
    /// Angle of the first and last position, from +z towards +x.
    pub(super) start: f64,
    /// Heading per angle: 1 looks outward all the way round, 0 looks along +z.
    pub(super) turn: f64,
    /// Elevation, positive upward.
    pub(super) pitch: f64,
    pub(super) pitch_sway: f64,
}

/// How much slower than on average the camera moves at both ends, and how much faster half way.
const EASE: f64 = 0.4;

impl Round {
    /// `world_from_camera` at a share of the round, 0 at its begin and 1 at its end; smooth beyond both.
    pub(super) fn pose(&self, share: f64) -> RigidTransform {
        let way = TAU * share - EASE * (TAU * share).sin();
        let angle = self.start + way;
        let place = Vector3::new(angle.sin(), (2.0 * way).sin(), angle.cos());
        let pitch = self.pitch + self.pitch_sway * way.sin();
        RigidTransform::new(
            upright_camera(self.turn * angle, pitch),
            self.centre + self.radii.component_mul(&place),
        )
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn ends_where_it_began_and_looks_the_other_way_in_between() {
        let round = Round {
            centre: Vector3::new(0.1, 1.4, -0.9),
            radii: Vector3::new(1.3, 0.1, 0.7),
            start: 0.3,
            turn: 1.0,
            pitch: -0.1,
            pitch_sway: 0.05,
        };
        let [begin, middle, end] = [0.0, 0.5, 1.0].map(|share| round.pose(share));
        assert!(begin.tangent_to(&end).norm() < 1e-12);
        let forward = |pose: &RigidTransform| pose.rotation * Vector3::z();
        // Heading 0.3 from +z towards +x, 0.1 below the horizon.
        let expected =
            Vector3::new(0.3_f64.sin() * 0.1_f64.cos(), -(0.1_f64.sin()), 0.3_f64.cos() * 0.1_f64.cos());
        assert!((forward(&begin) - expected).norm() < 1e-12);
        assert!(begin.rotation.angle_to(&middle.rotation) > PI - 0.3);
        // Outward: the position lies on the side that is looked at.
        let outward = middle.translation - round.centre;
        assert!(outward.dot(&forward(&middle)) > 0.6, "{outward}");
    }
}
