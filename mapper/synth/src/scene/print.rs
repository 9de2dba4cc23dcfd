//! Printed matter: posters, cartons, books.

use glam::{IVec2, Vec2, Vec3};

use super::pattern::{colour, edge, layered_noise, noise, random, split, stripe, text};

const INKS: [u32; 8] = [0xd9412f, 0x2f6fb0, 0xf0b429, 0x2f8f5b, 0x7b4a9e, 0xe88fa0, 0x26323f, 0xf3efe2];

fn ink(index: usize, seed: u32) -> Vec3 {
    let choice = random(IVec2::new(index as i32, 17), seed);
    colour(INKS[(choice * INKS.len() as f32) as usize % INKS.len()])
}

fn number(index: i32, seed: u32) -> f32 {
    random(IVec2::new(index, 29), seed)
}

/// A picture of discs and beams above a caption, in a white margin; `half` is its half size.
pub(super) fn poster(uv: Vec2, half: Vec2, pixel: f32, seed: u32) -> Vec3 {
    let picture_floor = -0.55 * half.y;
    let paper = colour(0xf4f0e6);
    if uv.y < picture_floor {
        let letter = 0.055 * half.y;
        let inside = edge(half.x * 0.86 - uv.x.abs(), 0.0, pixel) * edge(uv.y + 0.93 * half.y, 0.0, pixel);
        let printed = text(uv + Vec2::new(half.x, half.y), letter, pixel, seed) * inside;
        return paper.lerp(colour(0x20242c), printed);
    }
    let picture = picture(uv, half, pixel, seed);
    let frame = (half * Vec2::new(0.9, 0.95) - uv.abs()).min_element().min(uv.y - picture_floor);
    paper.lerp(picture, edge(frame, 0.0, pixel)) * (1.0 + 0.05 * layered_noise(uv, 0.04, 4, pixel, seed))
}

fn picture(uv: Vec2, half: Vec2, pixel: f32, seed: u32) -> Vec3 {
    let height = 0.5 + 0.5 * uv.y / half.y;
    let mut shade = ink(0, seed).lerp(ink(1, seed), height);
    // Beams across a gradient of two inks.
    let tilt = 3.0 * number(1, seed) - 1.5;
    let across = (uv.x + tilt * uv.y) / (0.16 * half.x);
    let (beam, f) = split(Vec2::new(across, 0.0));
    if beam.x & 1 == 0 {
        let share = edge(f.x.min(1.0 - f.x) * 0.16 * half.x, 0.0, pixel);
        shade = shade.lerp(ink(2, seed), 0.55 * share);
    }
    for disc in 0..6 {
        // Six discs with a ring each.
        let place = Vec2::new(number(10 + disc, seed), number(20 + disc, seed)) * 1.7 - 0.85;
        let radius = (0.1 + 0.28 * number(30 + disc, seed)) * half.x;
        let distance = (uv - place * half).length();
        shade = shade.lerp(ink(3 + disc as usize, seed), edge(radius, distance, pixel));
        shade =
            shade.lerp(ink(4 + disc as usize, seed), stripe(distance, 0.7 * radius, 0.06 * radius, pixel));
    }
    shade * (1.0 + 0.25 * layered_noise(uv, 0.2 * half.x, 5, pixel, seed ^ 0xabc))
}

/// Cardboard with a strip of tape and, on upright faces, a label.
pub(super) fn cardboard(uv: Vec2, axis: usize, half: f32, pixel: f32, seed: u32) -> Vec3 {
    let flutes = 0.05 * noise(uv * Vec2::new(160.0, 3.0), seed) * super::pattern::visibility(0.006, pixel);
    let board = colour(0xb98a58) * (1.0 + flutes + 0.14 * layered_noise(uv, 0.12, 5, pixel, seed));
    let tape = stripe(uv.x, 0.05 * half, 0.13 * half, pixel);
    let board = board.lerp(colour(0xd8bd8a) * (1.0 + 0.1 * noise(uv * 40.0, 4)), 0.8 * tape);
    if axis == 1 {
        return board;
    }
    // A printed label in the upper left, a round stamp in the lower right.
    let label = Vec2::new(-0.42, 0.1) * half;
    let local = uv - label;
    let size = Vec2::new(0.4, 0.3) * half;
    let inside = (size - local.abs()).min_element();
    let printed = text(local + size, 0.1 * half, pixel, seed) * edge(inside, 0.04 * half, pixel);
    let paper = colour(0xf2efe8).lerp(colour(0x1c1c22), printed);
    let board = board.lerp(paper, edge(inside, 0.0, pixel));
    let stamp = (uv - Vec2::new(0.55, -0.55) * half).length();
    let ring = stripe(stamp, 0.22 * half, 0.03 * half, pixel).max(edge(0.1 * half, stamp, pixel));
    board.lerp(colour(0x8c2f27), 0.8 * ring)
}

/// The back of a book: bands and an upright title.
pub(super) fn spine(uv: Vec2, cloth: Vec3, half: Vec2, pixel: f32, seed: u32) -> Vec3 {
    let weave = cloth * (1.0 + 0.18 * layered_noise(uv, 0.015, 3, pixel, seed));
    let at = (0.45 + 0.4 * number(1, seed)) * half.y;
    let band = stripe(uv.y.abs(), at, 0.035 * half.y, pixel);
    let turned = Vec2::new(-uv.y, uv.x + 0.45 * half.x);
    let title_space = edge(0.42 * half.y, uv.y.abs(), pixel) * edge(0.5 * half.x, uv.x.abs(), pixel);
    let title = text(turned, 0.8 * half.x, pixel, seed) * title_space;
    let gold = if cloth.length() > 0.6 { colour(0x3a2a20) } else { colour(0xe8cf8a) };
    weave.lerp(gold, band.max(title))
}
