//! Wood: boards, single pieces, crates.

use glam::{Vec2, Vec3};

use super::{Spot, lettering};
use crate::synth::noise::{cell, fractal2, noise2, random2, smoothstep};

/// Grain along x.
fn grain(at: Vec2, colour: Vec3, seed: u32) -> Vec3 {
    let warp = fractal2(at.x * 1.6, at.y * 7.0, 3, seed);
    let rings = cell(at.y * 22.0 + 7.0 * warp).1;
    let fibre = fractal2(at.x * 9.0, at.y * 190.0, 3, seed ^ 0x91);
    let knot = smoothstep(0.80, 0.92, noise2(at.x * 2.3, at.y * 9.0, seed ^ 0x92));
    let late = smoothstep(0.25, 0.95, rings) * (1.0 - smoothstep(0.95, 1.0, rings));
    colour * (1.15 - 0.55 * late) * (0.62 + 0.72 * fibre) * (1.0 - 0.7 * knot)
}

pub(super) fn boards(uv: Vec2, colour: Vec3, seed: u32) -> Vec3 {
    const WIDTH: f32 = 0.14;
    const LENGTH: f32 = 1.3;
    let (row, y) = cell(uv.y / WIDTH);
    let shift = random2(row, 0, seed);
    let (piece, x) = cell(uv.x / LENGTH + shift);
    let edge = (y.min(1.0 - y) * WIDTH).min(x.min(1.0 - x) * LENGTH);
    let tone = 0.55 + 0.75 * random2(piece, row, seed ^ 0x41);
    let at = Vec2::new(uv.x + 3.7 * piece as f32, uv.y + 1.3 * random2(piece, row, seed ^ 0x42));
    let nails = nail(x.min(1.0 - x) * LENGTH, y * WIDTH, WIDTH);
    let board = grain(at, colour * tone, seed) * (1.0 - 0.8 * nails);
    Vec3::splat(0.02).lerp(board, smoothstep(0.001, 0.003, edge))
}

/// Two nails near each end of a board; `from_end` and `y` in metres.
fn nail(from_end: f32, y: f32, width: f32) -> f32 {
    let centre = Vec2::new(0.03, if y < 0.5 * width { 0.03 } else { width - 0.03 });
    1.0 - smoothstep(0.004, 0.006, (Vec2::new(from_end, y) - centre).length())
}

pub(super) fn piece(spot: &Spot, colour: Vec3, seed: u32) -> Vec3 {
    let along = if spot.size.x >= spot.size.y { spot.uv } else { Vec2::new(spot.uv.y, spot.uv.x) };
    let near_edge = spot.uv.min(spot.size - spot.uv).min_element();
    let worn = 1.0 + 0.5 * (1.0 - smoothstep(0.0, 0.006, near_edge));
    grain(along, colour, seed) * worn
}

pub(super) fn crate_side(spot: &Spot, seed: u32) -> Vec3 {
    let colour = Vec3::new(0.42, 0.25, 0.11);
    let near = spot.uv.min(spot.size - spot.uv);
    let frame = 0.11 * spot.size.min_element();
    let diagonal = (spot.uv.x / spot.size.x - spot.uv.y / spot.size.y).abs() * spot.size.min_element();
    let title = lettering::TITLES[seed as usize % 4];
    let dot = 0.62 * spot.size.x / lettering::width(title, 1.0);
    let corner = Vec2::new(0.19 * spot.size.x, 0.62 * spot.size.y);
    let board = if near.x < frame {
        grain(Vec2::new(spot.uv.y, spot.uv.x), colour * 0.75, seed ^ 0x21)
    } else if near.y < frame {
        grain(spot.uv, colour * 0.8, seed ^ 0x22)
    } else if lettering::is_ink(title, spot.uv - corner, dot) {
        Vec3::splat(0.03)
    } else if diagonal < 0.5 * frame {
        grain(spot.uv * 1.2, colour * 0.65, seed ^ 0x23)
    } else {
        boards(spot.uv * 1.5, colour * 1.25, seed)
    };
    let groove = (near.min_element() - frame).abs().min((diagonal - 0.5 * frame).abs());
    let screws = (near - 0.5 * frame).length();
    board * smoothstep(0.0, 0.006, groove).max(0.25) * smoothstep(0.004, 0.008, screws).max(0.2)
}
