//! Brickwork, natural stone, tiles and ceiling panels.

use glam::{Vec2, Vec3};

use crate::synth::noise::{cell, fractal2, fractal3, random2, smoothstep};

/// One stone of a wall laid in courses.
struct Stone {
    /// Column and course, shifted courses included.
    index: (i32, i32),
    /// Distance from the nearest joint's centre, metres.
    edge: f32,
}

/// Running bond: every second course is shifted by half a stone.
fn course(uv: Vec2, stone: Vec2) -> Stone {
    let (row, y) = cell(uv.y / stone.y);
    let (column, x) = cell(uv.x / stone.x + 0.5 * (row & 1) as f32);
    let edge = (x.min(1.0 - x) * stone.x).min(y.min(1.0 - y) * stone.y);
    Stone { index: (column, row), edge }
}

pub(super) fn bricks(uv: Vec2, seed: u32) -> Vec3 {
    let wobble = 0.004
        * Vec2::new(fractal2(uv.x * 25.0, uv.y * 25.0, 2, seed), fractal2(uv.y * 25.0, uv.x * 25.0, 2, seed));
    let Stone { index: (i, j), edge } = course(uv + wobble, Vec2::new(0.24, 0.08));
    let grain = fractal2(uv.x * 90.0, uv.y * 90.0, 3, seed ^ 0xb1);
    let stain = fractal2(uv.x * 1.1, uv.y * 1.1, 4, seed ^ 0xb2);
    let (tone, hue) = (random2(i, j, seed), random2(i, j, seed ^ 0xb3));
    let clay = Vec3::new(0.42, 0.15, 0.09).lerp(Vec3::new(0.52, 0.30, 0.17), hue) * (0.45 + 0.9 * tone);
    let mortar = Vec3::new(0.46, 0.43, 0.39) * (0.6 + 0.6 * grain);
    let brick = clay * (0.55 + 0.9 * grain);
    mortar.lerp(brick, smoothstep(0.004, 0.0075, edge)) * (0.65 + 0.6 * stain)
}

pub(super) fn ashlar(uv: Vec2, seed: u32) -> Vec3 {
    let wobble = 0.012
        * Vec2::new(fractal2(uv.x * 9.0, uv.y * 9.0, 3, seed), fractal2(uv.y * 9.0, uv.x * 9.0, 3, seed));
    let Stone { index: (i, j), edge } = course(uv + wobble, Vec2::new(0.62, 0.31));
    let grain = fractal2(uv.x * 28.0, uv.y * 28.0, 5, seed ^ 0xa1);
    let pits = smoothstep(0.62, 0.7, fractal2(uv.x * 45.0, uv.y * 45.0, 3, seed ^ 0xa2));
    let warm = random2(i, j, seed ^ 0xa3);
    let stone = Vec3::new(0.44, 0.40, 0.33).lerp(Vec3::new(0.58, 0.47, 0.32), warm)
        * (0.6 + 0.5 * random2(i, j, seed));
    let face = stone * (0.5 + 0.85 * grain) * (1.0 - 0.5 * pits);
    Vec3::new(0.16, 0.14, 0.12).lerp(face, smoothstep(0.006, 0.016, edge))
}

pub(super) fn tiles(uv: Vec2, side: f32, seed: u32) -> Vec3 {
    let ((i, x), (j, y)) = (cell(uv.x / side), cell(uv.y / side));
    let edge = x.min(1.0 - x).min(y.min(1.0 - y)) * side;
    let dark = (i + j) & 1 == 0;
    let base = if dark { Vec3::new(0.17, 0.13, 0.12) } else { Vec3::new(0.62, 0.57, 0.48) };
    let at = Vec3::new(uv.x, uv.y, 9.0 * random2(i, j, seed));
    let tile = marble(at, base * (0.75 + 0.4 * random2(i, j, seed ^ 0x7)), seed);
    Vec3::splat(0.10).lerp(tile, smoothstep(0.002, 0.005, edge))
}

pub(super) fn marble(p: Vec3, colour: Vec3, seed: u32) -> Vec3 {
    let warp = fractal3(p * 3.0, 4, seed);
    let vein = (fractal3(p * 5.0 + Vec3::splat(2.5 * warp), 5, seed ^ 0x3a) - 0.5).abs();
    let fine = fractal3(p * 70.0, 2, seed ^ 0x3b);
    let veined = colour.lerp(colour * 0.25, 1.0 - smoothstep(0.0, 0.05, vein));
    veined * (0.6 + 0.45 * warp) * (0.75 + 0.5 * fine)
}

pub(super) fn panels(uv: Vec2, seed: u32) -> Vec3 {
    let ((i, x), (j, y)) = (cell(uv.x / 0.6), cell(uv.y / 0.6));
    let edge = x.min(1.0 - x).min(y.min(1.0 - y)) * 0.6;
    let hole = Vec2::new(cell(uv.x / 0.03).1 - 0.5, cell(uv.y / 0.03).1 - 0.5) * 0.03;
    let (hi, hj) = (cell(uv.x / 0.03).0, cell(uv.y / 0.03).0);
    let radius = 0.004 + 0.006 * random2(hi, hj, seed);
    let white = Vec3::new(0.66, 0.65, 0.62) * (0.75 + 0.25 * random2(i, j, seed));
    let board = white.lerp(white * 0.35, 1.0 - smoothstep(radius - 0.002, radius, hole.length()));
    let stain = smoothstep(0.55, 0.75, fractal2(uv.x * 1.7, uv.y * 1.7, 4, seed ^ 0x8));
    Vec3::splat(0.12).lerp(board, smoothstep(0.006, 0.009, edge)) * (1.0 - 0.35 * stain)
}
