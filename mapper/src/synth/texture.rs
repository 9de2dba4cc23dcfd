//! Radiance baked onto a flat chart, with coarser levels for distant views.

use glam::{Vec2, Vec3};
use mba_tracker::math::floor_to_i32;

/// Radiance of one chart at a falling number of texels; level `k` has texels of `2^k` times the size of level 0.
pub(super) struct Texture {
    levels: Vec<Level>,
    texels_per_metre: f32,
}

/// Rows of texels; red, green, blue in linear light.
struct Level {
    columns: usize,
    rows: usize,
    texels: Vec<[u16; 4]>,
    /// Texels per metre along u and v.
    density: Vec2,
}

/// Radiance 1 in a stored texel; leaves room for radiances up to 2.
const UNIT: f32 = 32_767.0;

/// Texels in the last level, along the longer side.
const COARSEST: usize = 4;

impl Texture {
    /// Bakes a chart of `size` metres with about `texels_per_metre`; `radiance` gives the light leaving a chart
    /// position.
    pub(super) fn bake(size: Vec2, texels_per_metre: f32, radiance: impl Fn(Vec2) -> Vec3) -> Self {
        let columns = ((size.x * texels_per_metre).ceil() as usize).max(2);
        let rows = ((size.y * texels_per_metre).ceil() as usize).max(2);
        let texel = size / Vec2::new(columns as f32, rows as f32);
        // Four samples per texel on a rotated grid keep sharp edges of patterns from turning into stairs.
        const SAMPLES: [Vec2; 4] = [
            Vec2::new(0.125, 0.375),
            Vec2::new(0.625, 0.125),
            Vec2::new(0.375, 0.875),
            Vec2::new(0.875, 0.625),
        ];
        let texels = (0..rows * columns)
            .map(|index| {
                let corner = Vec2::new((index % columns) as f32, (index / columns) as f32);
                let sum: Vec3 = SAMPLES.iter().map(|offset| radiance((corner + *offset) * texel)).sum();
                encode(sum * 0.25)
            })
            .collect();
        let mut levels = vec![Level { columns, rows, texels, density: texel.recip() }];
        while let Some(coarser) = levels.last().and_then(Level::halved) {
            levels.push(coarser);
        }
        Self { levels, texels_per_metre }
    }

    /// Radiance at a chart position (metres), smoothed to about `footprint` metres. `dither` in `[0, 1)` decides
    /// between the two nearest levels; averaged over many samples this interpolates between them.
    #[inline]
    pub(super) fn sample(&self, uv: Vec2, footprint: f32, dither: f32) -> Vec3 {
        let level = floor_to_i32(approximate_log2(footprint * self.texels_per_metre) + dither);
        let level = level.clamp(0, self.levels.len() as i32 - 1) as usize;
        self.levels[level].sample(uv)
    }
}

impl Level {
    /// Bilinear interpolation, constant beyond the centres of the outermost texels.
    #[inline]
    fn sample(&self, uv: Vec2) -> Vec3 {
        let last = Vec2::new((self.columns - 1) as f32, (self.rows - 1) as f32);
        let at = (uv * self.density - 0.5).clamp(Vec2::ZERO, last);
        let (x, y) = ((at.x as usize).min(self.columns - 2), (at.y as usize).min(self.rows - 2));
        let (sx, sy) = (at.x - x as f32, at.y - y as f32);
        let first = y * self.columns + x;
        let top = decode(self.texels[first]) * (1.0 - sx) + decode(self.texels[first + 1]) * sx;
        let second = first + self.columns;
        let bottom = decode(self.texels[second]) * (1.0 - sx) + decode(self.texels[second + 1]) * sx;
        (top * (1.0 - sy) + bottom * sy) / UNIT
    }

    /// The next coarser level: means of 2x2 texels; `None` when this one is coarse enough.
    fn halved(&self) -> Option<Self> {
        if self.columns.max(self.rows) <= COARSEST {
            return None;
        }
        let (columns, rows) = ((self.columns / 2).max(2), (self.rows / 2).max(2));
        let texels =
            (0..rows * columns).map(|index| self.mean_of_four(index % columns, index / columns)).collect();
        // An odd last column or row is dropped, a side of two or three texels is not halved.
        let density = self.density
            * Vec2::new(if self.columns > 3 { 0.5 } else { 1.0 }, if self.rows > 3 { 0.5 } else { 1.0 });
        Some(Self { columns, rows, texels, density })
    }

    fn mean_of_four(&self, x: usize, y: usize) -> [u16; 4] {
        let column = |dx: usize| if self.columns > 3 { 2 * x + dx } else { x };
        let row = |dy: usize| if self.rows > 3 { 2 * y + dy } else { y };
        let mut mean = [2_u32; 4];
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let texel = self.texels[row(dy) * self.columns + column(dx)];
            mean.iter_mut().zip(texel).for_each(|(sum, value)| *sum += u32::from(value));
        }
        mean.map(|sum| (sum / 4) as u16)
    }
}

fn encode(radiance: Vec3) -> [u16; 4] {
    let scaled = (radiance * UNIT + 0.5).clamp(Vec3::ZERO, Vec3::splat(65_535.0));
    [scaled.x as u16, scaled.y as u16, scaled.z as u16, 0]
}

#[inline]
fn decode(texel: [u16; 4]) -> Vec3 {
    Vec3::new(f32::from(texel[0]), f32::from(texel[1]), f32::from(texel[2]))
}

/// The binary logarithm of a positive number within 0.09, from the bits of the number.
#[inline]
fn approximate_log2(x: f32) -> f32 {
    x.max(1e-9).to_bits() as f32 * (1.0 / 8_388_608.0) - 126.95
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithm_is_within_its_bound() {
        for k in 1..200 {
            let x = 0.07 * k as f32;
            assert!((approximate_log2(x) - x.log2()).abs() < 0.09, "{x}");
        }
    }

    #[test]
    fn a_linear_ramp_is_reproduced_at_every_level() {
        let size = Vec2::new(1.6, 0.8);
        let ramp = |uv: Vec2| Vec3::new(0.5 * uv.x, 0.9 * uv.y, 0.3);
        let texture = Texture::bake(size, 40.0, ramp);
        for footprint in [0.001, 0.03, 0.06, 0.12] {
            for uv in [Vec2::new(0.5, 0.4), Vec2::new(1.1, 0.3)] {
                let error = texture.sample(uv, footprint, 0.5) - ramp(uv);
                assert!(error.abs().max_element() < 3e-4, "{footprint} {uv} {error}");
            }
        }
    }

    #[test]
    fn coarse_levels_average_what_fine_ones_resolve() {
        let stripes = |uv: Vec2| Vec3::splat(if (uv.x * 100.0) as i32 % 2 == 0 { 0.8 } else { 0.2 });
        let texture = Texture::bake(Vec2::splat(0.64), 400.0, stripes);
        assert!((texture.sample(Vec2::new(0.205, 0.3), 0.001, 0.0).x - 0.8).abs() < 1e-3);
        assert!((texture.sample(Vec2::new(0.205, 0.3), 0.08, 0.5).x - 0.5).abs() < 0.06);
    }

    #[test]
    fn narrow_charts_have_levels_too() {
        let texture = Texture::bake(Vec2::new(0.5, 0.004), 100.0, |uv| Vec3::splat(uv.x));
        assert!((texture.sample(Vec2::new(0.25, 0.002), 0.04, 0.5).x - 0.25).abs() < 0.02);
    }
}
