//! A hall of 16 x 12 x 4.6 m with two rows of columns.

use glam::{Vec2, Vec3};
use nalgebra::Vector3;

use super::lighting::{Lamp, Lamps, Lighting};
use super::material::Material;
use super::pattern::colour;
use super::world::{Enclosure, Scene, Thing, shadows};
use crate::CameraMotion;
use crate::motion::Sweep;
use crate::round::Round;

pub(super) fn build(motion: CameraMotion) -> Scene {
    let mut things = Vec::new();
    // Two rows of five columns, 2.1 m apart.
    for row in [-2.6, 2.6] {
        for place in 0..5_u32 {
            things.extend(column(row, -3.0 + 2.1 * place as f32, place));
        }
    }
    things.extend(exhibits());
    if motion == CameraMotion::Loop {
        things.extend(exhibits_behind());
    }
    let lamp = |x: f32, z: f32| Lamp {
        position: Vec3::new(x, 4.2, z),
        colour: Vec3::new(0.75, 0.7, 0.6),
        reach: 3.2,
    };
    let lighting = Lighting {
        from_above: Vec3::new(0.3, 0.31, 0.34),
        from_below: Vec3::new(0.15, 0.14, 0.13),
        lamps: Lamps::new(&[lamp(0.0, -2.0), lamp(0.5, 2.5), lamp(-5.0, 3.0), lamp(5.0, 0.0)]),
        shadows: shadows(&things, &[0.9]),
    };
    Scene::assemble(walls(), things, lighting, sweep(), round())
}

fn walls() -> Enclosure {
    let stone = Material::Tiles { a: colour(0xcfc4ae), b: colour(0xb8ab92), size: 0.45 };
    Enclosure {
        low: Vec3::new(-8.0, 0.0, -5.0),
        high: Vec3::new(8.0, 4.6, 7.0),
        materials: [
            Material::Bricks { brick: colour(0xa86a4e), mortar: colour(0xc3b9a8) },
            stone,
            Material::Tiles { a: colour(0x3f4a52), b: colour(0xd9d2c3), size: 0.5 },
            Material::Wood { colour: colour(0x8a6540), plank: 0.25 },
            Material::Plaster { colour: colour(0xcbb892), stain: 0.2 },
            Material::Wallpaper { base: colour(0x8d3b3b), figure: colour(0xd6b36a) },
        ],
    }
}

/// A column on a plinth under a capital.
fn column(x: f32, z: f32, place: u32) -> [Thing; 3] {
    let shaft = if place.is_multiple_of(2) {
        Material::Marble { base: colour(0xd5cdbd), vein: colour(0x6d5a4c) }
    } else {
        Material::Rings { a: colour(0x9c5a42), b: colour(0xd9c3a0), width: 0.16 }
    };
    let stone = Material::Plaster { colour: colour(0xb5ab98), stain: 0.25 };
    [
        Thing::column(x, 0.3, z, 0.26, 4.0, shaft),
        Thing::cuboid(x, 0.0, z, [0.75, 0.3, 0.75], 0.0, stone),
        Thing::cuboid(x, 4.3, z, [0.8, 0.3, 0.8], 0.0, stone),
    ]
}

/// Pictures on the far wall and pedestals between the columns.
fn exhibits() -> Vec<Thing> {
    let stone = Material::Bricks { brick: colour(0x8f8b84), mortar: colour(0x4a4844) };
    let mut things = Vec::new();
    for (index, x) in (0_u32..).zip([-5.6, -3.4, -1.0, 1.3, 3.9, 6.0]) {
        let size = [1.1 + 0.3 * (index % 3) as f32, 1.6, 0.05];
        let look = Material::Poster { half: Vec2::new(0.5 * size[0], 0.8), seed: 100 + index };
        things.push(Thing::cuboid(x, 1.1, 6.975, size, 0.0, look));
    }
    let pedestals = [(-0.9, 1.2, 20.0), (1.2, 3.0, 40.0), (-4.6, 1.0, 5.0), (4.7, 2.4, 65.0)];
    for (index, (x, z, degrees)) in (0_u32..).zip(pedestals) {
        things.push(Thing::cuboid(x, 0.0, z, [0.6, 0.9, 0.6], degrees, stone));
        let globe = Material::Marble { base: colour(0x52779a), vein: colour(0xe0c27a) };
        // Globes and plants by turns.
        things.push(match index % 2 {
            0 => Thing::sphere(x, 1.2, z, 0.3, globe),
            _ => Thing::column(x, 0.9, z, 0.2, 0.6, Material::Foliage),
        });
    }
    things.push(Thing::cuboid(
        0.0,
        0.0,
        1.5,
        [2.2, 0.012, 8.0],
        0.0,
        Material::Carpet { base: colour(0x274a6b), figure: colour(0xd0b070) },
    ));
    things
}

/// Round between the rows of columns.
fn round() -> Round {
    Round {
        centre: Vector3::new(0.15, 1.6, -0.6),
        radii: Vector3::new(1.3, 0.1, 0.7),
        start: 0.0,
        turn: 1.0,
        pitch: -0.06,
        pitch_sway: 0.05,
    }
}

/// Pictures and pedestals at the near wall.
fn exhibits_behind() -> Vec<Thing> {
    let stone = Material::Bricks { brick: colour(0x8f8b84), mortar: colour(0x4a4844) };
    let rings = Material::Rings { a: colour(0x2f5d5a), b: colour(0xd9cfa8), width: 0.12 };
    let globe = Material::Marble { base: colour(0x8a5a6b), vein: colour(0xe6d9b0) };
    let mut things = Vec::new();
    for (index, x) in (0_u32..).zip([-6.2, -4.4, -2.5, -0.6, 1.3, 3.2, 5.0, 6.6]) {
        let size = [1.2 + 0.2 * (index % 3) as f32, 1.7, 0.05];
        let look = Material::Poster { half: Vec2::new(0.5 * size[0], 0.85), seed: 130 + index };
        things.push(Thing::cuboid(x, 1.0, -4.975, size, 0.0, look));
    }
    for (x, z, degrees) in [(-1.8, -4.1, 12.0), (2.2, -4.2, 50.0), (-5.2, -3.4, 33.0), (6.2, -3.0, 71.0)] {
        things.push(Thing::cuboid(x, 0.0, z, [0.6, 0.9, 0.6], degrees, stone));
        things.push(Thing::sphere(x, 1.2, z, 0.3, globe));
    }
    things.push(Thing::column(0.2, 0.0, -4.3, 0.16, 2.2, rings));
    things
}

/// Along the nave with a look at both sides.
fn sweep() -> Sweep {
    Sweep {
        centre: Vector3::new(0.2, 1.6, -2.6),
        sway: Vector3::new(0.9, 0.15, 0.8),
        yaw: 0.0,
        yaw_sway: 0.6,
        pitch: -0.06,
        pitch_sway: 0.08,
        period: 10.0,
    }
}
