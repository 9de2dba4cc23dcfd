//! Printed, woven and written surfaces.

use glam::{Vec2, Vec3};

use super::{Spot, lettering, vivid, wood};
use crate::synth::noise::{cell, fractal2, hash, noise2, random2, smoothstep};

pub(super) fn wallpaper(spot: &Spot, seed: u32) -> Vec3 {
    let from_floor = spot.size.y - spot.uv.y;
    if from_floor < 0.85 {
        return panelling(spot.uv, from_floor, seed);
    }
    let ((i, x), (j, y)) = (cell(spot.uv.x / 0.36), cell(spot.uv.y / 0.36));
    let at = Vec2::new(x - 0.5, y - 0.5);
    let angle = mba_tracker::math::atan2(f64::from(at.y), f64::from(at.x));
    let petals =
        0.27 + 0.11 * mba_tracker::math::cos(angle * f64::from(3 + hash((i * 31 + j) as u32) % 4)) as f32;
    let flower = smoothstep(petals + 0.015, petals - 0.015, at.length());
    let heart = smoothstep(0.10, 0.08, at.length());
    let grain = 0.75 + 0.5 * fractal2(spot.uv.x * 70.0, spot.uv.y * 70.0, 3, seed);
    let fade = 0.7 + 0.5 * fractal2(spot.uv.x * 0.9, spot.uv.y * 0.9, 4, seed ^ 0x4);
    let stripe = if i & 1 == 0 { 1.0 } else { 0.8 };
    let ground = Vec3::new(0.36, 0.46, 0.40) * stripe;
    let leaf = Vec3::new(0.60, 0.52, 0.30) * (0.7 + 0.5 * random2(i, j, seed));
    ground.lerp(leaf, flower).lerp(vivid(hash((i * 7 + j * 13) as u32)), heart) * grain * fade
}

fn panelling(uv: Vec2, from_floor: f32, seed: u32) -> Vec3 {
    let brown = Vec3::new(0.30, 0.16, 0.08);
    let (i, x) = cell(uv.x / 0.45);
    let inset = (x.min(1.0 - x) * 0.45).min((from_floor - 0.12).min(0.76 - from_floor));
    let at = Spot {
        uv: Vec2::new(uv.x + 0.3 * i as f32, from_floor),
        size: Vec2::new(0.4, 0.9),
        local: Vec3::ZERO,
    };
    let groove = 1.0 - 0.75 * smoothstep(0.012, 0.004, (inset - 0.05).abs());
    wood::piece(&at, brown * if inset > 0.05 { 1.25 } else { 0.9 }, seed) * groove
}

pub(super) fn rug(spot: &Spot, seed: u32) -> Vec3 {
    let (red, blue, cream) =
        (Vec3::new(0.36, 0.04, 0.03), Vec3::new(0.03, 0.06, 0.20), Vec3::new(0.62, 0.52, 0.36));
    let near = spot.uv.min(spot.size - spot.uv).min_element();
    let ((i, x), (j, y)) = (cell(spot.uv.x / 0.19), cell(spot.uv.y / 0.19));
    let diamond = (x - 0.5).abs() + (y - 0.5).abs();
    let own = random2(i, j, seed);
    let field = if diamond < 0.16 + 0.12 * own {
        if own > 0.5 { cream } else { Vec3::new(0.55, 0.30, 0.05) }
    } else if diamond < 0.42 {
        if own > 0.3 { blue } else { Vec3::new(0.04, 0.17, 0.10) }
    } else {
        red
    };
    let teeth = 0.03 * (cell((spot.uv.x + spot.uv.y) / 0.07).1 - 0.5).abs();
    let colour = match near {
        n if n < 0.04 => cream,
        n if n < 0.10 + teeth => blue,
        n if n < 0.13 + teeth => cream,
        n if n < 0.22 - teeth => red * 0.7,
        _ => field,
    };
    let knots = noise2(spot.uv.x * 220.0, spot.uv.y * 150.0, seed ^ 0x61);
    let wear = fractal2(spot.uv.x * 4.0, spot.uv.y * 4.0, 4, seed ^ 0x62);
    colour * (0.55 + 0.8 * knots) * (0.6 + 0.8 * wear)
}

pub(super) fn book(spot: &Spot, seed: u32) -> Vec3 {
    let colour = vivid(seed);
    // Spines are tall and narrow; their title runs from top to bottom.
    let spine = Vec2::new(spot.uv.y, spot.size.x - spot.uv.x);
    let dot = (spot.size.x / 11.0).min(0.005);
    let title = lettering::TITLES[hash(seed) as usize % lettering::TITLES.len()];
    let start = Vec2::new(0.18 * spot.size.y, 0.5 * spot.size.x - 3.5 * dot);
    let bands = [0.06, 0.11, 0.88, 0.94].iter().any(|at| (spot.uv.y / spot.size.y - at).abs() < 0.012);
    let cloth = 0.7 + 0.6 * noise2(spot.uv.x * 300.0, spot.uv.y * 300.0, seed);
    if lettering::is_ink(title, spine - start, dot) || bands {
        if colour.max_element() > 0.5 { Vec3::splat(0.05) } else { Vec3::new(0.72, 0.60, 0.30) }
    } else {
        colour * cloth
    }
}

pub(super) fn blackboard(spot: &Spot, seed: u32) -> Vec3 {
    let near = spot.uv.min(spot.size - spot.uv).min_element();
    if near < 0.04 {
        return wood::piece(spot, Vec3::new(0.45, 0.30, 0.15), seed);
    }
    let dust = fractal2(spot.uv.x * 2.2, spot.uv.y * 6.0, 5, seed);
    let board = Vec3::new(0.035, 0.06, 0.05) + Vec3::splat(0.10 * dust * dust);
    let inside = spot.uv - 0.12;
    let (line, _) = cell(inside.y / 0.15);
    let written = inside.x > 0.0 && inside.x < (spot.size.x - 0.24) * (0.35 + 0.65 * random2(line, 1, seed));
    let curve = chalk_curve(spot, seed);
    let chalk = written
        && near > 0.1
        && lettering::is_body_text(inside, 0.0125 + 0.004 * random2(line, 2, seed), seed);
    let rough = smoothstep(0.25, 0.6, fractal2(spot.uv.x * 220.0, spot.uv.y * 220.0, 2, seed ^ 0x9));
    if chalk || curve { board.lerp(Vec3::new(0.75, 0.75, 0.68), rough) } else { board }
}

/// A plotted wave with its axes, in the right third of a blackboard.
fn chalk_curve(spot: &Spot, seed: u32) -> bool {
    let at = (spot.uv - spot.size * Vec2::new(0.68, 0.55)) / spot.size.y;
    let wave = 0.18 * mba_tracker::math::sin(f64::from(at.x * 14.0 + random2(0, 0, seed))) as f32;
    let inside = at.x > 0.0 && at.x < 0.45 && at.y.abs() < 0.3;
    inside && ((at.y - wave).abs() < 0.012 || at.x < 0.01 || at.y.abs() < 0.006)
}

pub(super) fn bands(spot: &Spot, seed: u32) -> Vec3 {
    let (i, y) = cell(spot.uv.y / 0.045);
    let (j, x) = cell(spot.uv.x / 0.06 + 0.5 * (i & 1) as f32);
    let colour = vivid(hash(seed ^ (i as u32).wrapping_mul(97)));
    let dot = (Vec2::new(x, y) - 0.5).length() < 0.22 + 0.15 * random2(i, j, seed);
    let shade = 0.75 + 0.5 * fractal2(spot.uv.x * 40.0, spot.uv.y * 40.0, 3, seed);
    if dot { Vec3::new(0.7, 0.68, 0.6) * shade } else { colour * shade }
}

pub(super) fn keys(spot: &Spot, seed: u32) -> Vec3 {
    let pitch = spot.size / Vec2::new(15.0, 6.0);
    let ((i, x), (j, y)) = (cell(spot.uv.x / pitch.x), cell(spot.uv.y / pitch.y));
    let inside = x > 0.08 && x < 0.92 && y > 0.08 && y < 0.92;
    let letter = [b'A' + (random2(i, j, seed) * 25.99) as u8];
    let label = core::str::from_utf8(&letter).unwrap_or(" ");
    let at = (Vec2::new(x, y) - Vec2::new(0.2, 0.2)) * pitch;
    if inside && lettering::is_ink(label, at, 0.05 * pitch.x) {
        Vec3::splat(0.7)
    } else if inside {
        Vec3::splat(0.06 + 0.06 * random2(i, j, seed ^ 0x3))
    } else {
        Vec3::splat(0.015)
    }
}
