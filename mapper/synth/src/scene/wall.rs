//! One flat wall, so wide that the camera sees nothing else.

use std::f64::consts::FRAC_PI_2;

use glam::Vec3;
use nalgebra::Vector3;

use super::lighting::{Lamps, Lighting};
use super::material::Material;
use super::pattern::colour;
use super::world::{Enclosure, Scene};
use crate::motion::Sweep;
use crate::round::Round;

pub(super) fn build() -> Scene {
    let bricks = Material::Bricks { brick: colour(0xb5634a), mortar: colour(0xc9c1b2) };
    let enclosure = Enclosure {
        low: Vec3::new(-60.0, -60.0, -60.0),
        high: Vec3::new(60.0, 60.0, 2.5),
        materials: [bricks; 6],
    };
    let lighting = Lighting {
        from_above: Vec3::splat(0.75),
        from_below: Vec3::splat(0.75),
        lamps: Lamps::new(&[]),
        shadows: Vec::new(),
    };
    Scene::assemble(enclosure, Vec::new(), lighting, sweep(), round())
}

/// Along the wall and back, never turning away from it.
fn round() -> Round {
    Round {
        centre: Vector3::zeros(),
        radii: Vector3::new(2.6, 0.2, 0.3),
        start: -FRAC_PI_2,
        turn: 0.0,
        pitch: 0.0,
        pitch_sway: 0.1,
    }
}

fn sweep() -> Sweep {
    Sweep {
        centre: Vector3::zeros(),
        sway: Vector3::new(0.6, 0.25, 0.15),
        yaw: 0.0,
        yaw_sway: 0.15,
        pitch: 0.0,
        pitch_sway: 0.1,
        period: 6.0,
    }
}
