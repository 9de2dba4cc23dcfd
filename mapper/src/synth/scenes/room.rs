//! A furnished room, 6.4 x 5.4 m.

use glam::{Vec2, Vec3};

use super::build::Furniture;
use crate::synth::illumination::{Lamp, Lighting};
use crate::synth::pattern::{Material, Picture};
use crate::synth::scene::Blueprint;
use crate::synth::trajectory::Sweep;

const OAK: Material = Material::Wood(Vec3::new(0.46, 0.28, 0.13));
const WALNUT: Material = Material::Wood(Vec3::new(0.24, 0.13, 0.07));
const PINE: Material = Material::Wood(Vec3::new(0.58, 0.42, 0.22));
const STEEL: Material = Material::Plain(Vec3::new(0.30, 0.31, 0.33));

pub(super) fn blueprint() -> Blueprint {
    let mut furniture = Furniture::room(
        Vec3::new(6.4, 2.8, 5.4),
        [
            Material::Wallpaper,
            Material::Plaster(Vec3::new(0.60, 0.50, 0.34)),
            Material::Panels,
            Material::Boards(Vec3::new(0.40, 0.23, 0.11)),
            Material::Plaster(Vec3::new(0.42, 0.48, 0.50)),
            Material::Bricks,
        ],
    );
    decorate_walls(&mut furniture);
    furnish(&mut furniture);
    lay_table(&mut furniture);
    Blueprint { solids: furniture.solids, lighting: lighting(), sweep: SWEEP, typical_depth: 2.6 }
}

/// From the left of the room to the right, looking at the brick wall, then around to the right-hand wall.
const SWEEP: Sweep = Sweep {
    eye: [[-1.7, 1.45, 1.6], [-0.7, 1.65, 1.0], [0.5, 1.35, 1.5], [0.9, 1.55, 1.0]],
    target: [[-0.9, 0.95, -2.0], [-0.2, 1.0, -2.3], [0.9, 0.9, -2.2], [2.3, 0.95, -1.6]],
};

fn lighting() -> Lighting {
    let lamp = |x: f32, z: f32, intensity: Vec3| Lamp {
        centre: Vec3::new(x, 2.75, z),
        half: Vec2::new(0.5, 0.35),
        intensity,
    };
    Lighting {
        lamps: vec![lamp(-1.3, 0.2, Vec3::new(2.5, 2.3, 2.0)), lamp(1.5, -0.6, Vec3::new(2.1, 2.0, 1.9))],
        ambient: Vec3::new(0.30, 0.32, 0.36),
        reach: 0.9,
    }
}

fn decorate_walls(furniture: &mut Furniture) {
    let picture = |motif| Material::Picture(motif);
    let quarter = std::f32::consts::FRAC_PI_2;
    furniture.picture(Vec3::new(-2.35, 1.75, -2.68), 0.95, 0.70, 0.0, picture(Picture::Mountains));
    furniture.picture(Vec3::new(-1.25, 1.80, -2.68), 0.55, 0.80, 0.0, picture(Picture::EyeChart));
    furniture.picture(Vec3::new(-0.35, 1.95, -2.68), 0.80, 0.60, 0.0, picture(Picture::Shapes));
    furniture.picture(Vec3::new(-0.40, 1.28, -2.68), 0.62, 0.46, 0.0, Material::Page(0.0035));
    // The right-hand wall looks along -x, the left-hand one along +x, the one behind along -z.
    furniture.picture(Vec3::new(3.18, 1.60, -1.30), 1.25, 0.90, -quarter, picture(Picture::Map));
    furniture.picture(Vec3::new(3.18, 1.70, 0.20), 0.70, 0.70, -quarter, picture(Picture::Rings));
    furniture.picture(Vec3::new(3.18, 1.65, 1.50), 0.90, 0.65, -quarter, picture(Picture::Shapes));
    furniture.picture(Vec3::new(-3.18, 1.50, -0.70), 1.90, 1.10, quarter, Material::Blackboard);
    furniture.picture(Vec3::new(-3.18, 1.60, 1.30), 0.80, 1.00, quarter, picture(Picture::Rings));
    furniture.picture(Vec3::new(0.0, 1.60, 2.68), 1.60, 1.00, 2.0 * quarter, picture(Picture::Mountains));
}

fn furnish(furniture: &mut Furniture) {
    let at = Vec3::new;
    furniture.block(at(-0.3, 0.0, 0.1), at(3.0, 0.012, 2.2), 0.05, Material::Rug);
    furniture.shelf(at(1.05, 0.0, -2.70), at(1.10, 2.0, 0.27), 6, OAK);
    furniture.drum(at(2.2, 0.0, -1.9), 0.17, 2.8, Material::Marble(at(0.58, 0.54, 0.48)), STEEL);
    furniture.block(at(2.2, 0.0, -1.9), at(0.46, 0.16, 0.46), 0.0, Material::Marble(at(0.40, 0.38, 0.35)));
    furniture.block(at(2.70, 0.0, -0.35), at(0.62, 0.62, 0.62), 0.35, Material::Crate);
    furniture.block(at(2.66, 0.62, -0.33), at(0.42, 0.42, 0.42), -0.2, Material::Crate);
    furniture.block(at(1.95, 0.0, -0.75), at(0.46, 0.46, 0.46), 0.8, Material::Crate);
    furniture.ball(at(1.95, 0.46, -0.75), 0.15, 0.6, Material::Bands);
    furniture.block(at(-2.75, 0.0, -2.35), at(0.80, 0.95, 0.50), 0.0, WALNUT);
    furniture.ball(at(-2.60, 0.95, -2.35), 0.17, 0.3, Material::Globe);
    furniture.pile(at(-2.95, 0.95, -2.35), 4, 5);
    furniture.chair(at(-1.45, 0.012, -1.35), PINE, Material::Cloth(at(0.10, 0.24, 0.40)));
    furniture.chair(at(0.35, 0.012, -1.75), PINE, Material::Cloth(at(0.45, 0.10, 0.08)));
    furniture.drum(
        at(-2.3, 0.0, 0.3),
        0.24,
        0.42,
        Material::Cloth(at(0.36, 0.26, 0.12)),
        Material::Cloth(at(0.2, 0.3, 0.15)),
    );
}

fn lay_table(furniture: &mut Furniture) {
    let at = Vec3::new;
    let top = 0.012 + 0.76;
    furniture.table(at(-0.55, 0.012, -0.75), at(1.7, 0.76, 0.85), OAK, WALNUT);
    furniture.pile(at(-1.12, top, -0.80), 5, 11);
    furniture.ball(at(-0.62, top, -0.86), 0.13, 0.9, Material::Globe);
    furniture.drum(at(-0.24, top, -0.58), 0.045, 0.11, Material::Bands, Material::Plain(at(0.3, 0.2, 0.1)));
    furniture.drum(at(0.10, top, -0.95), 0.07, 0.30, Material::Marble(at(0.20, 0.32, 0.40)), STEEL);
    let page = Material::Page(0.0016);
    furniture.block_with(at(-0.85, top, -0.50), at(0.21, 0.003, 0.297), 0.3, [page; 6]);
    furniture.block_with(at(-0.48, top, -0.52), at(0.21, 0.003, 0.297), -0.15, [page; 6]);
    furniture.block(at(0.13, top, -0.56), at(0.20, 0.14, 0.15), 0.5, Material::Picture(Picture::Rings));
}
