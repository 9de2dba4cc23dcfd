//! Framed pictures and the globe.

use glam::{Vec2, Vec3};

use super::{Picture, Spot, lettering, vivid, wood};
use crate::synth::noise::{cell, fractal2, fractal3, hash, noise2, random2, smoothstep};

pub(super) fn framed(spot: &Spot, motif: Picture, seed: u32) -> Vec3 {
    let near = spot.uv.min(spot.size - spot.uv).min_element();
    let frame = 0.045 * spot.size.min_element();
    if near < frame {
        let bevel = 0.6 + 0.8 * smoothstep(0.0, frame, near);
        return wood::piece(spot, Vec3::new(0.34, 0.20, 0.08) * bevel, seed);
    }
    if near < 1.8 * frame {
        return Vec3::new(0.70, 0.68, 0.60);
    }
    let inner = Spot { uv: spot.uv - 1.8 * frame, size: spot.size - 3.6 * frame, local: spot.local };
    let grain = 0.85 + 0.3 * noise2(spot.uv.x * 250.0, spot.uv.y * 250.0, seed ^ 0x77);
    let colour = match motif {
        Picture::Mountains => mountains(&inner, seed),
        Picture::Shapes => shapes(&inner, seed),
        Picture::EyeChart => eye_chart(&inner, seed),
        Picture::Map => map(&inner, seed),
        Picture::Rings => rings(&inner, seed),
    };
    colour * grain
}

fn mountains(spot: &Spot, seed: u32) -> Vec3 {
    let at = spot.uv / spot.size.y;
    let sky = Vec3::new(0.75, 0.42, 0.18).lerp(Vec3::new(0.10, 0.20, 0.48), 1.0 - at.y);
    let sun = (at - Vec2::new(0.75 * spot.size.x / spot.size.y, 0.3)).length();
    let mut colour = sky.lerp(Vec3::new(0.95, 0.80, 0.45), smoothstep(0.10, 0.09, sun));
    for ridge in 0..5_u32 {
        let base = 0.38 + 0.13 * ridge as f32;
        let scale = 2.0 + 1.5 * ridge as f32;
        let line = base - 0.3 * (fractal2(at.x * scale, 0.0, 5, seed.wrapping_add(ridge)) - 0.35);
        if at.y > line {
            let near = ridge as f32 / 4.0;
            let slope = fractal2(at.x * 25.0, at.y * 18.0, 4, seed ^ ridge);
            let rock = Vec3::new(0.24, 0.28, 0.42).lerp(Vec3::new(0.05, 0.11, 0.05), near);
            let snow = smoothstep(0.06, 0.0, at.y - line) * (1.0 - near);
            colour = (rock * (0.4 + 1.2 * slope)).lerp(Vec3::splat(0.8), 0.8 * snow);
        }
    }
    colour
}

fn shapes(spot: &Spot, seed: u32) -> Vec3 {
    let mut colour = Vec3::new(0.66, 0.60, 0.47);
    for k in 0..16 {
        let centre = Vec2::new(random2(k, 0, seed), random2(k, 1, seed)) * spot.size;
        let radius = (0.05 + 0.16 * random2(k, 2, seed)) * spot.size.min_element();
        let d = spot.uv - centre;
        let inside = match k % 3 {
            0 => d.length() < radius && d.length() > 0.35 * radius,
            1 => d.x.abs() < 2.4 * radius && d.y.abs() < 0.22 * radius,
            _ => (d.x + d.y).abs() < 0.8 * radius && (d.x - d.y).abs() < 0.8 * radius,
        };
        if inside {
            colour = vivid(hash(seed ^ (k as u32) << 8));
        }
    }
    colour
}

fn eye_chart(spot: &Spot, seed: u32) -> Vec3 {
    let (paper, ink) = (Vec3::new(0.74, 0.73, 0.68), Vec3::splat(0.02));
    let mut top = 0.05 * spot.size.y;
    for line in 0..9_usize {
        let dot = 0.020 * spot.size.y / (1.0 + 0.42 * line as f32);
        let count = (1 + line * 2).min((spot.size.x * 0.9 / (6.0 * dot)) as usize);
        let at = spot.uv - Vec2::new(0.5 * (spot.size.x - 6.0 * dot * count as f32), top);
        if at.y >= 0.0 && at.y < 7.0 * dot && at.x >= 0.0 {
            let letter = (at.x / (6.0 * dot)) as usize;
            let pick = lettering::TITLES[(seed as usize + line) % lettering::TITLES.len()].as_bytes();
            let glyph = [pick[letter % pick.len()]];
            let within = Vec2::new(at.x - 6.0 * dot * letter as f32, at.y);
            let text = core::str::from_utf8(&glyph).unwrap_or(" ");
            return if letter < count && lettering::is_ink(text, within, dot) { ink } else { paper };
        }
        top += 11.0 * dot;
    }
    paper
}

fn map(spot: &Spot, seed: u32) -> Vec3 {
    let at = spot.uv / spot.size.y * 2.6;
    let height = fractal2(at.x, at.y, 6, seed);
    let mut colour = terrain(height);
    let contour = cell(height * 34.0).1;
    if height > 0.5 && contour < 0.12 {
        colour *= 0.6;
    }
    let road = (fractal2(at.x * 1.4 + 9.0, at.y * 1.4, 3, seed ^ 0x5) - 0.5).abs();
    if height > 0.5 && road < 0.008 {
        colour = Vec3::new(0.6, 0.08, 0.04);
    }
    let ((i, gx), (j, gy)) = (cell(at.x * 2.2), cell(at.y * 2.2));
    if gx < 0.012 || gy < 0.012 {
        colour *= 0.5;
    }
    let name = lettering::TITLES[hash((i * 5 + j * 11) as u32 ^ seed) as usize % lettering::TITLES.len()];
    let label = Vec2::new(gx - 0.1, gy - 0.2 - 0.5 * random2(i, j, seed));
    if lettering::is_ink(name, label, 0.011) { Vec3::splat(0.03) } else { colour }
}

fn terrain(height: f32) -> Vec3 {
    if height < 0.5 {
        Vec3::new(0.05, 0.16, 0.34).lerp(Vec3::new(0.20, 0.42, 0.56), smoothstep(0.3, 0.5, height))
    } else {
        Vec3::new(0.20, 0.36, 0.12).lerp(Vec3::new(0.55, 0.40, 0.20), smoothstep(0.5, 0.65, height))
    }
}

fn rings(spot: &Spot, seed: u32) -> Vec3 {
    let ((i, x), (j, y)) = (cell(spot.uv.x / spot.size.x * 3.0), cell(spot.uv.y / spot.size.x * 3.0));
    let (ring, _) = cell((Vec2::new(x, y) - 0.5).length() * 11.0);
    vivid(hash(seed ^ (ring * 3 + i * 17 + j * 29) as u32))
}

pub(super) fn globe(p: Vec3, seed: u32) -> Vec3 {
    let direction = p.normalize_or_zero();
    let height = fractal3(direction * 1.9 + 4.0, 6, seed);
    let relief = fractal3(direction * 22.0, 3, seed ^ 0x6);
    let azimuth = mba_tracker::math::atan2(f64::from(p.x), f64::from(p.z)) as f32;
    let polar = mba_tracker::math::atan2(
        f64::from(direction.y),
        f64::from((1.0 - direction.y * direction.y).max(0.0).sqrt()),
    ) as f32;
    let step = std::f32::consts::PI / 12.0;
    let line = (cell(azimuth / step).1 - 0.5).abs() > 0.485 || (cell(polar / step).1 - 0.5).abs() > 0.47;
    terrain(height) * (0.6 + 0.8 * relief) * if line { 0.4 } else { 1.0 }
}
