//! A furnished room, 7 x 6 x 2.7 m, filmed from its near half.

use glam::{Vec2, Vec3};
use nalgebra::Vector3;

use super::lighting::{Lamp, Lamps, Lighting};
use super::material::Material;
use super::pattern::colour;
use super::room_behind;
use super::room_furniture::{armchair, bookshelf, cartons, desk, round_table};
use super::world::{Enclosure, Scene, Thing, shadows};
use crate::CameraMotion;
use crate::motion::Sweep;
use crate::round::Round;

pub(super) fn build(motion: CameraMotion) -> Scene {
    let mut things = furniture();
    if motion == CameraMotion::Loop {
        things.extend(room_behind::furniture());
    }
    let lighting = lighting(&things);
    Scene::assemble(walls(), things, lighting, sweep(), round())
}

/// What stands in the far half and hangs on all walls.
pub(super) fn furniture() -> Vec<Thing> {
    let mut things = pictures();
    things.extend(desk());
    things.extend(bookshelf());
    things.extend(round_table());
    things.extend(cartons());
    things.extend(armchair());
    things.extend(standing());
    things
}

/// The lamps of the room, and the shadows of what stands in it.
pub(super) fn lighting(things: &[Thing]) -> Lighting {
    Lighting {
        // Light of the sky from above, of the floor from below; a lamp at the ceiling, a window, a floor lamp.
        from_above: Vec3::new(0.30, 0.31, 0.33),
        from_below: Vec3::new(0.17, 0.15, 0.13),
        lamps: Lamps::new(&[
            Lamp { position: Vec3::new(0.4, 2.5, 0.6), colour: Vec3::new(0.95, 0.86, 0.72), reach: 2.4 },
            Lamp { position: Vec3::new(3.2, 1.9, -1.2), colour: Vec3::new(0.42, 0.5, 0.62), reach: 3.0 },
            Lamp { position: Vec3::new(-2.9, 1.7, 2.3), colour: Vec3::new(0.5, 0.36, 0.2), reach: 1.2 },
        ]),
        shadows: shadows(things, &[0.74, 0.72]),
    }
}

pub(super) fn walls() -> Enclosure {
    let bricks = Material::Bricks { brick: colour(0xb5634a), mortar: colour(0xb9b0a2) };
    let paper = Material::Wallpaper { base: colour(0xcdd8cf), figure: colour(0x5f8f86) };
    let panels = Material::Wood { colour: colour(0xb98e62), plank: 0.16 };
    Enclosure {
        low: Vec3::new(-3.5, 0.0, -3.0),
        high: Vec3::new(3.5, 2.7, 3.0),
        materials: [
            panels,
            paper,
            Material::Wood { colour: colour(0xc79c6b), plank: 0.11 },
            Material::Tiles { a: colour(0xe9e6df), b: colour(0xdedbd2), size: 0.6 },
            Material::Plaster { colour: colour(0xc9b795), stain: 0.16 },
            bricks,
        ],
    }
}

/// Posters on the walls and the carpet.
fn pictures() -> Vec<Thing> {
    let poster = |x: f32, y: f32, z: f32, width: f32, height: f32, degrees: f32, seed: u32| {
        let half = 0.5 * Vec2::new(width, height);
        let look = Material::Poster { half, seed };
        Thing::cuboid(x, y - half.y, z, [width, height, 0.03], degrees, look)
    };
    vec![
        // Far wall, right, left and near wall, then the carpet.
        poster(0.75, 1.62, 2.985, 0.8, 1.05, 0.0, 3),
        poster(-0.35, 1.75, 2.985, 0.62, 0.62, 0.0, 14),
        poster(2.0, 1.65, 2.985, 0.66, 0.9, 0.0, 21),
        poster(3.485, 1.6, 1.6, 0.9, 0.7, 90.0, 8),
        poster(3.485, 1.55, -0.2, 0.7, 0.95, 90.0, 30),
        poster(-3.485, 1.6, 0.6, 1.0, 0.75, 90.0, 41),
        poster(-3.485, 1.5, -1.2, 0.6, 0.8, 90.0, 5),
        poster(0.6, 1.6, -2.985, 1.2, 0.9, 0.0, 52),
        poster(-1.6, 1.6, -2.985, 0.7, 1.0, 0.0, 66),
        Thing::cuboid(
            0.3,
            0.0,
            0.7,
            [3.0, 0.012, 2.2],
            8.0,
            Material::Carpet { base: colour(0x8c2f35), figure: colour(0xd9b36c) },
        ),
    ]
}

/// A pipe in front, a floor lamp, a plant, a beam below the ceiling.
fn standing() -> Vec<Thing> {
    let brass = Material::Rings { a: colour(0x9a7b3e), b: colour(0xd8c79a), width: 0.05 };
    let stripes = Material::Rings { a: colour(0xd8d4ca), b: colour(0x3d5a80), width: 0.11 };
    let clay = Material::Rings { a: colour(0xa8573a), b: colour(0xc98a5e), width: 0.04 };
    let shade = Material::Wallpaper { base: colour(0xf0dcae), figure: colour(0xc98b4a) };
    let mut things = vec![
        // A striped pipe near the camera, a lamp with its shade, a pot, and a beam across the room.
        Thing::column(-1.55, 0.0, 0.75, 0.1, 2.7, stripes),
        Thing::column(2.75, 0.0, 0.9, 0.02, 1.45, brass),
        Thing::column(2.75, 1.4, 0.9, 0.2, 0.32, shade),
        Thing::column(2.75, 0.0, 0.9, 0.16, 0.03, brass),
        Thing::column(2.85, 0.0, 2.35, 0.2, 0.36, clay),
        Thing::cuboid(
            0.0,
            2.52,
            1.5,
            [7.0, 0.18, 0.2],
            0.0,
            Material::Wood { colour: colour(0x7a5536), plank: 0.09 },
        ),
    ];
    // A plant: balls of leaves on the pot.
    let leaves = [
        (2.85, 0.62, 2.35, 0.26),
        (2.66, 0.85, 2.25, 0.18),
        (3.02, 0.9, 2.4, 0.2),
        (2.84, 1.08, 2.3, 0.17),
        (2.7, 1.2, 2.5, 0.12),
    ];
    things.extend(leaves.map(|(x, y, z, radius)| Thing::sphere(x, y, z, radius, Material::Foliage)));
    things
}

/// Round the middle of the near half, looking at each wall in turn.
pub(super) fn round() -> Round {
    Round {
        centre: Vector3::new(0.1, 1.42, -0.9),
        radii: Vector3::new(1.0, 0.08, 0.6),
        start: 0.0,
        turn: 1.0,
        pitch: -0.17,
        pitch_sway: 0.05,
    }
}

/// To and fro over the far half of the room from its near half.
pub(super) fn sweep() -> Sweep {
    Sweep {
        centre: Vector3::new(0.0, 1.42, -1.25),
        sway: Vector3::new(0.62, 0.12, 0.38),
        yaw: -0.03,
        yaw_sway: 0.62,
        pitch: -0.17,
        pitch_sway: 0.08,
        period: 9.0,
    }
}
