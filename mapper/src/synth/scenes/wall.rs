//! One flat wall, 2 m from the camera, in a room too large to matter.

use glam::{Vec2, Vec3};

use super::build::Furniture;
use crate::synth::illumination::{Lamp, Lighting};
use crate::synth::pattern::Material;
use crate::synth::scene::Blueprint;
use crate::synth::trajectory::Sweep;

pub(super) fn blueprint() -> Blueprint {
    let mut furniture = Furniture { solids: Vec::new() };
    furniture.block(Vec3::new(0.0, -4.0, -0.1), Vec3::new(10.0, 8.0, 0.2), 0.0, Material::Bricks);
    let lamp =
        Lamp { centre: Vec3::new(0.5, 5.0, 4.0), half: Vec2::new(1.0, 1.0), intensity: Vec3::splat(22.0) };
    let lighting = Lighting { lamps: vec![lamp], ambient: Vec3::splat(0.5), reach: 0.5 };
    let sweep = Sweep {
        eye: [[-0.5, 0.0, 2.0], [-0.2, 0.1, 2.0], [0.2, -0.1, 2.0], [0.5, 0.0, 2.0]],
        target: [[-0.5, 0.0, 0.0], [-0.2, 0.1, 0.0], [0.2, -0.1, 0.0], [0.5, 0.0, 0.0]],
    };
    Blueprint { solids: furniture.solids, lighting, sweep, typical_depth: 2.0 }
}
