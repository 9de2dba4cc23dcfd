//! A row of furnished rooms along x, with doors between them.

use glam::Vec3;

use super::material::Material;
use super::pattern::colour;
use super::world::{Enclosure, Scene, Thing};
use super::{room, room_behind};

/// Distance between the centres of two rooms, metres.
const ROOM: f32 = crate::walk::ROOM as f32;

/// The door in a wall: from and to along z, and height, metres.
const DOOR: ([f32; 2], f32) = ([-1.2, 0.2], 2.1);

/// Thickness of a wall, metres.
const WALL: f32 = 0.12;

/// What stands further than this from the middle of its room along x, and in this range of z, would be in the way.
const IN_THE_WAY: (f32, [f32; 2]) = (2.4, [-1.8, 0.95]);

pub(super) fn build(count: usize) -> Scene {
    let all = room::furniture().into_iter().chain(room_behind::furniture());
    let furniture: Vec<Thing> = all.filter(|thing| !is_in_the_way(thing)).collect();
    let lighting = room::lighting(&furniture);
    let mut things = Vec::new();
    for (number, middle) in (0..count as u32).map(|number| (number, ROOM * number as f32)) {
        things.extend(furniture.iter().map(|thing| thing.elsewhere(middle, number)));
        if number + 1 < count as u32 {
            things.extend(wall(middle + 0.5 * ROOM, number));
        }
    }
    let walls = room::walls();
    let high = walls.high + Vec3::new(ROOM * (count.max(1) - 1) as f32, 0.0, 0.0);
    Scene::assemble(Enclosure { high, ..walls }, things, lighting, room::sweep(), room::round())
        .repeating(ROOM)
}

fn is_in_the_way(thing: &Thing) -> bool {
    let (away, [from, to]) = IN_THE_WAY;
    let centre = thing.centre();
    centre.x.abs() > away && (from..to).contains(&centre.z)
}

/// A wall across the row at `x`, with a door and two pictures.
fn wall(x: f32, number: u32) -> Vec<Thing> {
    let paper = Material::Wallpaper { base: colour(0xcdd8cf), figure: colour(0x5f8f86) }.varied(number + 1);
    let ([from, to], height) = DOOR;
    // Beside the door on both sides, and above it. Pictures of 24 mm lie on the wall.
    let part = |low: f32, high: f32, bottom: f32, top: f32| {
        Thing::cuboid(x, bottom, 0.5 * (low + high), [WALL, top - bottom, high - low], 0.0, paper)
    };
    let picture = |side: f32, seed: u32| {
        let half = glam::Vec2::new(0.45, 0.35);
        let look = Material::Poster { half, seed: seed + 1000 * number };
        Thing::cuboid(x + side * (0.5 * WALL + 0.012), 1.25, 1.9, [0.9, 0.7, 0.024], 90.0, look)
    };
    vec![
        part(-3.0, from, 0.0, 2.7),
        part(to, 3.0, 0.0, 2.7),
        part(from, to, height, 2.7),
        picture(-1.0, 301),
        picture(1.0, 302),
    ]
}
