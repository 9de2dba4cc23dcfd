//! The furniture of the room's near half, behind a camera that films the far one.

use glam::Vec2;

use super::material::Material;
use super::pattern::colour;
use super::world::Thing;

/// Along the near wall and the near ends of the walls beside it.
pub(super) fn furniture() -> Vec<Thing> {
    let mut things = sideboard();
    things.extend(parcels());
    things.extend(right_side());
    things.extend(left_side());
    things
}

/// A sideboard below a picture, with books, a globe and a vase.
fn sideboard() -> Vec<Thing> {
    let oak = Material::Wood { colour: colour(0x8f6236), plank: 0.15 };
    let vase = Material::Tiles { a: colour(0x8a3b2f), b: colour(0xe3d9c2), size: 0.04 };
    let globe = Material::Marble { base: colour(0x6b8f5a), vein: colour(0xe0d3a0) };
    let page = Material::Page { paper: colour(0xefe9da), ink: colour(0x2d2a33), letter: 0.02 };
    let mut things = vec![
        Thing::cuboid(-1.3, 0.0, -2.7, [1.5, 0.78, 0.5], 0.0, oak),
        Thing::column(-1.85, 0.78, -2.62, 0.08, 0.3, vase),
        Thing::sphere(-1.85, 1.2, -2.62, 0.16, Material::Foliage),
        Thing::sphere(-1.0, 0.95, -2.68, 0.17, globe),
        Thing::cuboid(-0.75, 0.78, -2.75, [0.3, 0.4, 0.03], 12.0, page),
    ];
    let cloth = [0x9a4a2f, 0x2f5a7a, 0xc2a24a, 0x4a6b3f];
    things.extend(cloth.into_iter().zip(0_u32..).map(|(cloth, place)| {
        let height = 0.26 + 0.03 * (place % 3) as f32;
        let look =
            Material::Spine { colour: colour(cloth), half: Vec2::new(0.03, 0.5 * height), seed: 700 + place };
        let x = -1.55 + 0.065 * place as f32;
        Thing::cuboid(x, 0.78, -2.7, [0.06, height, 0.2], 0.0, look)
    }));
    things
}

/// Cartons and a roll of cloth at the near wall.
fn parcels() -> Vec<Thing> {
    let carton = |x: f32, bottom: f32, z: f32, size: [f32; 3], degrees: f32, seed: u32| {
        Thing::cuboid(x, bottom, z, size, degrees, Material::Cardboard { half: 0.5 * size[0], seed })
    };
    let stripes = Material::Rings { a: colour(0xcfd6dc), b: colour(0x7a3d5a), width: 0.09 };
    let poster = Material::Poster { half: Vec2::new(0.5, 0.35), seed: 91 };
    vec![
        carton(1.55, 0.0, -2.5, [0.7, 0.5, 0.55], 10.0, 11),
        carton(1.5, 0.5, -2.52, [0.5, 0.42, 0.42], -14.0, 12),
        carton(1.55, 0.92, -2.55, [0.34, 0.26, 0.3], 30.0, 13),
        carton(2.3, 0.0, -2.35, [0.5, 0.4, 0.45], 40.0, 14),
        Thing::column(0.35, 0.0, -2.6, 0.09, 2.1, stripes),
        Thing::cuboid(1.9, 1.35, -2.985, [1.0, 0.7, 0.03], 0.0, poster),
    ]
}

/// A cupboard with a radio at the papered wall.
fn right_side() -> Vec<Thing> {
    let painted = Material::Marble { base: colour(0x4f6f78), vein: colour(0xd8cfa8) };
    let radio = Material::Carpet { base: colour(0x5a3a2a), figure: colour(0xd9b36c) };
    let ball = Material::Tiles { a: colour(0xd9713c), b: colour(0xf2ead2), size: 0.08 };
    vec![
        Thing::cuboid(3.2, 0.0, -1.3, [0.5, 1.0, 1.1], 0.0, painted),
        Thing::cuboid(3.2, 1.0, -1.45, [0.22, 0.26, 0.45], 8.0, radio),
        Thing::sphere(3.15, 1.13, -0.98, 0.13, ball),
        Thing::sphere(2.7, 0.18, -0.35, 0.18, ball),
    ]
}

/// A bench with cushions and a plant at the panelled wall.
fn left_side() -> Vec<Thing> {
    let bench = Material::Wood { colour: colour(0x5f4630), plank: 0.08 };
    let cushion = Material::Tiles { a: colour(0x35607a), b: colour(0xe8dcc0), size: 0.09 };
    let clay = Material::Rings { a: colour(0x9c4f36), b: colour(0xd09a6a), width: 0.05 };
    let leaves = [(-3.0, 0.75, -2.4, 0.26), (-2.85, 1.0, -2.3, 0.18), (-3.1, 1.2, -2.45, 0.2)];
    let mut things = vec![
        Thing::cuboid(-3.15, 0.0, -0.9, [0.5, 0.45, 1.5], 0.0, bench),
        Thing::cuboid(-3.3, 0.45, -0.55, [0.14, 0.42, 0.45], 12.0, cushion),
        Thing::cuboid(-3.25, 0.45, -1.2, [0.14, 0.4, 0.42], -16.0, cushion),
        Thing::column(-3.0, 0.0, -2.4, 0.2, 0.5, clay),
    ];
    things.extend(leaves.map(|(x, y, z, radius)| Thing::sphere(x, y, z, radius, Material::Foliage)));
    things
}
