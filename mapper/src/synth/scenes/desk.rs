//! A crowded desk from nearby.

use glam::{Vec2, Vec3};

use super::build::Furniture;
use crate::synth::illumination::{Lamp, Lighting};
use crate::synth::pattern::{Material, Picture};
use crate::synth::scene::Blueprint;
use crate::synth::trajectory::Sweep;

const TOP: f32 = 0.74;

pub(super) fn blueprint() -> Blueprint {
    let mut furniture = Furniture::room(
        Vec3::new(3.6, 2.6, 3.2),
        [
            Material::Plaster(Vec3::new(0.55, 0.48, 0.36)),
            Material::Plaster(Vec3::new(0.50, 0.52, 0.44)),
            Material::Panels,
            Material::Boards(Vec3::new(0.36, 0.22, 0.11)),
            Material::Bricks,
            Material::Wallpaper,
        ],
    );
    let oak = Material::Wood(Vec3::new(0.50, 0.31, 0.15));
    furniture.table(Vec3::new(0.0, 0.0, -1.15), Vec3::new(2.2, TOP, 0.86), oak, oak);
    furniture.picture(Vec3::new(-0.55, 1.45, -1.58), 0.62, 0.44, 0.0, Material::Picture(Picture::Map));
    furniture.picture(Vec3::new(0.35, 1.50, -1.58), 0.50, 0.60, 0.0, Material::Picture(Picture::Shapes));
    furniture.picture(Vec3::new(1.05, 1.40, -1.58), 0.40, 0.50, 0.0, Material::Picture(Picture::EyeChart));
    screen_and_papers(&mut furniture);
    things(&mut furniture);
    Blueprint { solids: furniture.solids, lighting: lighting(), sweep: SWEEP, typical_depth: 0.9 }
}

/// Along the front edge of the desk and a little upwards.
const SWEEP: Sweep = Sweep {
    eye: [[-0.55, 1.20, -0.25], [-0.2, 1.30, -0.15], [0.3, 1.25, -0.2], [0.55, 1.35, -0.25]],
    target: [[-0.35, 0.85, -1.2], [-0.1, 0.85, -1.2], [0.2, 0.85, -1.25], [0.45, 0.88, -1.25]],
};

fn lighting() -> Lighting {
    let lamp = Lamp {
        centre: Vec3::new(-0.3, 2.5, -0.4),
        half: Vec2::new(0.5, 0.4),
        intensity: Vec3::new(2.6, 2.5, 2.3),
    };
    Lighting { lamps: vec![lamp], ambient: Vec3::new(0.28, 0.30, 0.33), reach: 0.35 }
}

fn screen_and_papers(furniture: &mut Furniture) {
    let at = Vec3::new;
    let black = Material::Plain(Vec3::splat(0.05));
    furniture.block(at(0.05, TOP, -1.38), at(0.24, 0.015, 0.18), 0.0, black);
    furniture.block(at(0.05, TOP + 0.015, -1.42), at(0.05, 0.12, 0.03), 0.0, black);
    let screen = [black, black, black, black, Material::Page(0.0024), black];
    furniture.block_with(at(0.05, TOP + 0.10, -1.39), at(0.56, 0.36, 0.025), 0.0, screen);
    furniture.block(at(0.05, TOP, -1.02), at(0.44, 0.018, 0.15), 0.04, Material::Keys);
    for (x, z, turn) in [(-0.52, -0.98, 0.3), (-0.42, -0.90, -0.1), (0.56, -0.92, -0.35)] {
        furniture.block(at(x, TOP, z), at(0.21, 0.003, 0.297), turn, Material::Page(0.0016));
    }
}

fn things(furniture: &mut Furniture) {
    let at = Vec3::new;
    let grey = Material::Plain(at(0.35, 0.34, 0.33));
    furniture.pile(at(-0.72, TOP, -1.30), 5, 21);
    furniture.books(at(0.48, TOP, -1.52), 0.52, 33);
    furniture.ball(at(-0.40, TOP, -1.30), 0.10, 0.4, Material::Globe);
    furniture.drum(at(0.40, TOP, -1.08), 0.04, 0.10, Material::Bands, grey);
    furniture.drum(at(-0.22, TOP, -1.18), 0.035, 0.13, Material::Marble(at(0.5, 0.3, 0.2)), grey);
    furniture.ball(at(0.36, TOP, -0.88), 0.045, 0.0, Material::Bands);
    furniture.block(at(0.74, TOP, -1.16), at(0.16, 0.10, 0.12), 0.6, Material::Crate);
    furniture.block(
        at(0.76, TOP + 0.10, -1.16),
        at(0.09, 0.09, 0.09),
        0.2,
        Material::Picture(Picture::Rings),
    );
    furniture.drum(at(-0.88, TOP, -1.02), 0.05, 0.22, Material::Cloth(at(0.30, 0.32, 0.12)), grey);
}
