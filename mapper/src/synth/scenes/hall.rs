//! A stone hall, 11 x 18 m, with two rows of columns.

use glam::{Vec2, Vec3};

use super::build::Furniture;
use crate::synth::illumination::{Lamp, Lighting};
use crate::synth::pattern::{Material, Picture};
use crate::synth::scene::Blueprint;
use crate::synth::trajectory::Sweep;

const SANDSTONE: Material = Material::Marble(Vec3::new(0.55, 0.46, 0.33));
const GRANITE: Material = Material::Marble(Vec3::new(0.36, 0.34, 0.34));

pub(super) fn blueprint() -> Blueprint {
    let mut furniture = Furniture::room(
        Vec3::new(11.0, 6.0, 18.0),
        [
            Material::Ashlar,
            Material::Ashlar,
            Material::Boards(Vec3::new(0.30, 0.18, 0.09)),
            Material::Tiles(0.8),
            Material::Ashlar,
            Material::Ashlar,
        ],
    );
    for row in 0..5 {
        let z = 3.6 - 2.8 * row as f32;
        for side in [-1.0, 1.0] {
            column(&mut furniture, Vec3::new(2.9 * side, 0.0, z));
        }
    }
    decorate(&mut furniture);
    Blueprint { solids: furniture.solids, lighting: lighting(), sweep: SWEEP, typical_depth: 5.0 }
}

/// Down the nave in a shallow curve, past the columns on the left.
const SWEEP: Sweep = Sweep {
    eye: [[-0.6, 1.6, 6.5], [0.7, 1.7, 5.6], [1.2, 1.5, 4.4], [0.2, 1.6, 3.4]],
    target: [[-0.6, 1.3, -2.0], [-1.2, 1.4, -2.5], [-2.0, 1.3, -3.0], [-2.6, 1.3, -3.5]],
};

fn lighting() -> Lighting {
    let lamp = |z: f32| Lamp {
        centre: Vec3::new(0.0, 5.9, z),
        half: Vec2::new(1.6, 0.9),
        intensity: Vec3::new(10.0, 9.2, 8.0),
    };
    Lighting {
        lamps: vec![lamp(4.5), lamp(-1.0), lamp(-6.5)],
        ambient: Vec3::new(0.26, 0.29, 0.34),
        reach: 1.6,
    }
}

fn column(furniture: &mut Furniture, foot: Vec3) {
    furniture.block(foot, Vec3::new(0.95, 0.28, 0.95), 0.0, GRANITE);
    furniture.drum(foot + Vec3::Y * 0.28, 0.42, 0.14, SANDSTONE, SANDSTONE);
    furniture.drum(foot + Vec3::Y * 0.42, 0.33, 4.6, SANDSTONE, SANDSTONE);
    furniture.drum(foot + Vec3::Y * 5.02, 0.46, 0.2, GRANITE, GRANITE);
    furniture.block(foot + Vec3::Y * 5.22, Vec3::new(1.05, 0.78, 1.05), 0.0, SANDSTONE);
}

fn decorate(furniture: &mut Furniture) {
    let at = Vec3::new;
    let quarter = std::f32::consts::FRAC_PI_2;
    furniture.block(at(0.0, 0.0, -2.0), at(1.9, 0.015, 11.0), 0.0, Material::Rug);
    furniture.picture(at(0.0, 2.9, -8.97), 3.4, 2.3, 0.0, Material::Picture(Picture::Mountains));
    for (row, motif) in
        [Picture::Map, Picture::Shapes, Picture::Rings, Picture::EyeChart].into_iter().enumerate()
    {
        let z = 2.2 - 2.8 * row as f32;
        furniture.picture(at(-5.47, 2.1, z), 1.7, 2.1, quarter, Material::Picture(motif));
        furniture.picture(at(5.47, 2.1, z), 1.7, 2.1, -quarter, Material::Picture(motif));
    }
    for (x, z, turn) in [(-3.9, 2.0, 0.3), (-4.3, -0.7, 0.9), (3.9, 1.2, -0.5), (1.7, -3.4, 0.6)] {
        furniture.block(at(x, 0.0, z), at(0.8, 0.8, 0.8), turn, Material::Crate);
        furniture.ball(at(x, 0.8, z), 0.26, turn, Material::Bands);
    }
    furniture.block(at(-1.6, 0.0, -4.4), at(0.7, 1.0, 0.7), 0.4, GRANITE);
    furniture.ball(at(-1.6, 1.0, -4.4), 0.42, 1.0, Material::Globe);
    furniture.table(at(0.2, 0.0, -6.6), at(2.6, 0.9, 0.9), SANDSTONE, GRANITE);
    furniture.pile(at(-0.5, 0.9, -6.6), 6, 3);
    furniture.drum(at(0.9, 0.9, -6.6), 0.13, 0.5, Material::Bands, GRANITE);
}
