//! The furniture of the room, each piece as a list of solids.

use glam::{IVec2, Vec2};

use super::material::Material;
use super::pattern::{colour, random};
use super::world::Thing;

/// A table top with four legs; `size` is width, height, depth.
fn table(x: f32, z: f32, size: [f32; 3], look: Material) -> Vec<Thing> {
    let [width, height, depth] = size;
    let mut things = vec![Thing::cuboid(x, height - 0.04, z, [width, 0.04, depth], 0.0, look)];
    for (side, end) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
        let (leg_x, leg_z) = (x + side * (0.5 * width - 0.05), z + end * (0.5 * depth - 0.05));
        things.push(Thing::cuboid(leg_x, 0.0, leg_z, [0.05, height - 0.04, 0.05], 0.0, look));
    }
    things
}

/// Desk at the brick wall: screen with text, books, mug, globe, drawers.
pub(super) fn desk() -> Vec<Thing> {
    let oak = Material::Wood { colour: colour(0xa8784a), plank: 0.12 };
    let dark = Material::Plaster { colour: colour(0x2b2e34), stain: 0.15 };
    let screen = Material::Page { paper: colour(0x1d2b3a), ink: colour(0xd6ecd9), letter: 0.017 };
    let paper = Material::Page { paper: colour(0xf1ede2), ink: colour(0x26262c), letter: 0.012 };
    let cup = Material::Rings { a: colour(0xe8e4da), b: colour(0xb8433a), width: 0.025 };
    let globe = Material::Marble { base: colour(0x4f86b0), vein: colour(0xd9c98a) };
    let mut things = table(0.75, 2.5, [1.9, 0.74, 0.8], oak);
    things.extend([
        // Screen on its foot, two sheets, mug, globe, drawers.
        Thing::cuboid(0.8, 0.82, 2.62, [0.66, 0.42, 0.04], -8.0, dark),
        Thing::cuboid(0.797, 0.84, 2.598, [0.62, 0.38, 0.006], -8.0, screen),
        Thing::cuboid(0.8, 0.74, 2.64, [0.08, 0.1, 0.05], -8.0, dark),
        Thing::cuboid(0.8, 0.74, 2.62, [0.26, 0.015, 0.2], -8.0, dark),
        Thing::cuboid(0.25, 0.74, 2.4, [0.21, 0.012, 0.297], 24.0, paper),
        Thing::cuboid(0.55, 0.74, 2.33, [0.21, 0.008, 0.297], -15.0, paper),
        Thing::column(1.25, 0.74, 2.35, 0.045, 0.1, cup),
        Thing::sphere(1.45, 0.94, 2.5, 0.15, globe),
        Thing::column(1.45, 0.74, 2.5, 0.08, 0.06, dark),
        Thing::cuboid(1.35, 0.02, 2.5, [0.45, 0.6, 0.6], 0.0, oak),
    ]);
    // Three books, turned against each other.
    let cloth = [0x8c2f39, 0x35607a, 0xc7a03c];
    things.extend(cloth.into_iter().zip(0_u32..).map(|(cloth, level)| {
        let half = Vec2::new(0.13, 0.022);
        let look = Material::Spine { colour: colour(cloth), half, seed: 200 + level };
        Thing::cuboid(0.0, 0.74 + 0.044 * level as f32, 2.6, [0.26, 0.044, 0.19], 12.0 * level as f32, look)
    }));
    things
}

/// Shelf with rows of books in the corner between bricks and panels.
pub(super) fn bookshelf() -> Vec<Thing> {
    const X: f32 = -1.75;
    const Z: f32 = 2.8;
    const WIDTH: f32 = 1.3;
    let wood = Material::Wood { colour: colour(0x6f4a2f), plank: 0.14 };
    let side = |x: f32| Thing::cuboid(x, 0.0, Z, [0.03, 2.05, 0.32], 0.0, wood);
    let mut things = vec![
        // Sides and back, then the boards with a row of books on each but the last.
        side(X - 0.5 * WIDTH),
        side(X + 0.5 * WIDTH),
        Thing::cuboid(X, 0.0, Z + 0.15, [WIDTH, 2.05, 0.02], 0.0, wood),
    ];
    for board in 0..6_u32 {
        let height = 0.06 + 0.39 * board as f32;
        things.push(Thing::cuboid(X, height, Z, [WIDTH, 0.03, 0.32], 0.0, wood));
        if board < 5 {
            things.extend(row_of_books(X - 0.47 * WIDTH, X + 0.47 * WIDTH, height + 0.03, Z, board));
        }
    }
    things
}

fn row_of_books(from: f32, to: f32, height: f32, z: f32, row: u32) -> Vec<Thing> {
    const CLOTH: [u32; 9] =
        [0x7a2e2e, 0x2f4f6f, 0xd8c690, 0x3f6b4a, 0xb5762f, 0x54406b, 0xc9d2d6, 0x20242c, 0xa83f56];
    let chance = |index: i32, purpose: u32| random(IVec2::new(index, row as i32), purpose);
    let (mut things, mut x) = (Vec::new(), from);
    for index in 0.. {
        let width = 0.035 + 0.05 * chance(index, 1);
        if x + width > to {
            break;
        }
        // Every eighth place is empty.
        if chance(index, 2) > 0.12 {
            let size = [width - 0.003, 0.22 + 0.11 * chance(index, 3), 0.17 + 0.08 * chance(index, 4)];
            let cloth = CLOTH[(9.0 * chance(index, 5)) as usize % CLOTH.len()];
            let half = Vec2::new(0.5 * size[0], 0.5 * size[1]);
            let look = Material::Spine { colour: colour(cloth), half, seed: 300 + 40 * row + index as u32 };
            let lean = if chance(index, 6) > 0.85 { 4.0 } else { 0.0 };
            things.push(Thing::cuboid(x + 0.5 * width, height, z - 0.01, size, lean, look));
        }
        x += width;
    }
    things
}

/// Round table close to the camera with fruit, a crate, a newspaper and a vase.
pub(super) fn round_table() -> Vec<Thing> {
    let top = Material::Marble { base: colour(0xd9d3c7), vein: colour(0x5b5a60) };
    let leg = Material::Rings { a: colour(0x4a3524), b: colour(0x8c6a46), width: 0.06 };
    let crate_wood = Material::Wood { colour: colour(0xb07f45), plank: 0.055 };
    let news = Material::Page { paper: colour(0xe6e1d3), ink: colour(0x2a2a2a), letter: 0.014 };
    let vase = Material::Tiles { a: colour(0x2f5d8a), b: colour(0xe6e2d6), size: 0.035 };
    let orange = Material::Plaster { colour: colour(0xe08a2c), stain: 0.22 };
    let apple = Material::Marble { base: colour(0xb23a34), vein: colour(0xd9b04c) };
    vec![
        // Table, crate, newspaper, vase with a plant, fruit.
        Thing::column(0.35, 0.69, 0.45, 0.55, 0.03, top),
        Thing::column(0.35, 0.03, 0.45, 0.05, 0.66, leg),
        Thing::column(0.35, 0.0, 0.45, 0.25, 0.03, leg),
        Thing::cuboid(0.58, 0.72, 0.62, [0.3, 0.17, 0.22], 28.0, crate_wood),
        Thing::cuboid(0.36, 0.72, 0.2, [0.3, 0.006, 0.21], -20.0, news),
        Thing::column(0.1, 0.72, 0.6, 0.07, 0.24, vase),
        Thing::sphere(0.1, 1.06, 0.6, 0.12, Material::Foliage),
        Thing::sphere(0.53, 0.765, 0.32, 0.045, orange),
        Thing::sphere(0.62, 0.76, 0.38, 0.04, apple),
        Thing::sphere(0.56, 0.93, 0.63, 0.042, orange),
    ]
}

/// Cartons stacked below the panelled wall.
pub(super) fn cartons() -> Vec<Thing> {
    let carton = |x: f32, bottom: f32, z: f32, size: [f32; 3], degrees: f32, seed: u32| {
        Thing::cuboid(x, bottom, z, size, degrees, Material::Cardboard { half: 0.5 * size[0], seed })
    };
    vec![
        carton(-2.75, 0.0, 1.5, [0.6, 0.45, 0.5], 62.0, 1),
        carton(-2.7, 0.45, 1.52, [0.46, 0.36, 0.4], 80.0, 2),
        carton(-2.72, 0.81, 1.5, [0.34, 0.22, 0.3], 50.0, 3),
        carton(-2.2, 0.0, 0.85, [0.5, 0.36, 0.42], 35.0, 4),
        carton(-0.55, 0.0, 2.55, [0.42, 0.42, 0.42], 12.0, 5),
    ]
}

/// Armchair with cushions below the papered wall.
pub(super) fn armchair() -> Vec<Thing> {
    let cloth = Material::Carpet { base: colour(0x3f6b6a), figure: colour(0xc9b98c) };
    let cushion = Material::Tiles { a: colour(0xd9713c), b: colour(0xf0d9a8), size: 0.07 };
    vec![
        Thing::cuboid(2.3, 0.12, 1.55, [0.75, 0.3, 0.75], -35.0, cloth),
        Thing::cuboid(2.52, 0.12, 1.86, [0.75, 0.85, 0.16], -35.0, cloth),
        Thing::cuboid(2.6, 0.12, 1.3, [0.15, 0.5, 0.75], -35.0, cloth),
        Thing::cuboid(1.98, 0.12, 1.74, [0.15, 0.5, 0.75], -35.0, cloth),
        Thing::cuboid(2.36, 0.44, 1.66, [0.42, 0.38, 0.14], -28.0, cushion),
    ]
}
