//! Block means of a raw depth map.

use fearless_simd::{Level, dispatch, f32x8, f64x4, i32x8, mask32x8, prelude::*};

use crate::geometry::PinholeCamera;
use crate::image::DepthView;
use crate::workspace::{Arena, WorkspaceError};

/// Blocks that are averaged at the same time.
const LANES: usize = 8;

/// Inverse depth in 1/m on a pyramid level; 0 is missing.
#[derive(Debug)]
pub struct InverseDepthMap<'m> {
    /// `width * height` values, row-major.
    pub values: &'m mut [f32],
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Pyramid level: a value is the mean over `2^level x 2^level` raw pixels.
    pub level: usize,
}

/// Largest difference of inverse depth, 1/m, within a neighbourhood that counts as one surface around `rho`:
/// several times the noise of structured-light sensors plus the slope of a slanted surface.
#[inline]
#[must_use]
pub fn spread_limit(rho: f32) -> f32 {
    SPREAD_FLOOR + SPREAD_SLOPE * rho
}

/// See [`spread_limit`].
const SPREAD_FLOOR: f32 = 0.015;
const SPREAD_SLOPE: f32 = 0.04;

/// [`spread_limit`] around eight values.
#[inline(always)]
pub fn spread_limits<S: Simd>(rho: f32x8<S>) -> f32x8<S> {
    rho * SPREAD_SLOPE + SPREAD_FLOOR
}

impl<'m> InverseDepthMap<'m> {
    /// Takes the memory of a map on `level` of `camera`'s images; all values are missing.
    ///
    /// # Errors
    /// [`WorkspaceError`] when the arena is exhausted.
    pub fn carve(
        arena: &mut Arena<'m>,
        camera: &PinholeCamera,
        level: usize,
    ) -> Result<Self, WorkspaceError> {
        let (width, height) = (camera.width >> level, camera.height >> level);
        Ok(Self { values: arena.take(width * height)?, width, height, level })
    }

    /// Fills the map from the rows of a raw depth image (0 = missing).
    ///
    /// A block is missing when fewer than half of its pixels are measured or when they spread over more than one
    /// surface: a mean across a depth edge lies on neither side. Returns the share of blocks with a value.
    pub fn fill(&mut self, level: Level, raw: &DepthView, metres_per_unit: f32) -> f32 {
        dispatch!(level, simd => self.fill_rows(simd, raw, metres_per_unit));
        let measured = self.values.iter().filter(|rho| **rho > 0.0).count();
        measured as f32 / (self.width * self.height).max(1) as f32
    }

    #[inline(always)]
    fn fill_rows<S: Simd>(&mut self, simd: S, raw: &DepthView, metres_per_unit: f32) {
        let block = 1usize << self.level;
        for v in 0..self.height {
            let out = &mut self.values[v * self.width..][..self.width];
            let mut blocks = out.chunks_exact_mut(LANES);
            let mut u = 0;
            for values in &mut blocks {
                block_means(simd, raw, u * block, v * block, block, metres_per_unit).store_slice(values);
                u += LANES;
            }
            for value in blocks.into_remainder() {
                *value = block_mean(raw, u * block, v * block, block, metres_per_unit);
                u += 1;
            }
        }
    }

    /// Mean of the measured values, 1/m; `None` if there is none.
    #[must_use]
    #[inline]
    pub fn mean(&self) -> Option<f32> {
        let (sum, count) = self
            .values
            .iter()
            .filter(|&&rho| rho > 0.0)
            .fold((0.0f64, 0usize), |(s, n), &rho| (s + f64::from(rho), n + 1));
        (count > 0).then(|| (sum / count as f64) as f32)
    }

    /// Bilinear inverse depth at `(u, v)` of this level, or `None` where a neighbour is missing, outside, or on
    /// another surface.
    #[inline]
    #[must_use]
    pub fn sample(&self, u: f32, v: f32) -> Option<f32> {
        let limit_u = (self.width - 1) as f32;
        let limit_v = (self.height - 1) as f32;
        if !(u >= 0.0 && v >= 0.0 && u < limit_u && v < limit_v) {
            return None;
        }
        let (i, j) = (u as usize, v as usize);
        let (fu, fv) = (u - i as f32, v - j as f32);
        let top = &self.values[j * self.width + i..][..2];
        let bottom = &self.values[(j + 1) * self.width + i..][..2];
        // All four have to be measured and of one surface.
        let low = top[0].min(top[1]).min(bottom[0].min(bottom[1]));
        let high = top[0].max(top[1]).max(bottom[0].max(bottom[1]));
        if !(low > 0.0 && high - low < spread_limit(low)) {
            return None;
        }
        let t0 = top[0] + fu * (top[1] - top[0]);
        let t1 = bottom[0] + fu * (bottom[1] - bottom[0]);
        Some(t0 + fv * (t1 - t0))
    }

    /// [`Self::sample`] at eight places, of which only `lanes` count: those of them that have a value, and the values. Lanes
    /// without one hold some number.
    ///
    /// Per lane two loads of adjacent pairs.
    #[inline(always)]
    pub fn sample_lanes<S: Simd>(
        &self,
        simd: S,
        lanes: mask32x8<S>,
        u: f32x8<S>,
        v: f32x8<S>,
    ) -> (mask32x8<S>, f32x8<S>) {
        let limit = [(self.width - 1) as f32, (self.height - 1) as f32];
        let inside = lanes & u.simd_ge(0.0) & v.simd_ge(0.0) & u.simd_lt(limit[0]) & v.simd_lt(limit[1]);
        // Lanes outside look at the first pixel.
        let zero = f32x8::splat(simd, 0.0);
        let (u, v) = (inside.select(u, zero), inside.select(v, zero));
        let (i, j) = (u.to_int::<i32x8<S>>(), v.to_int::<i32x8<S>>());
        let (fu, fv) = (u - i.to_float::<f32x8<S>>(), v - j.to_float::<f32x8<S>>());
        let index = j * i32x8::splat(simd, self.width as i32) + i;
        // Equal lengths, so that one bounds check serves both.
        let cells = self.width * (self.height - 1);
        let (above, below) = (&self.values[..cells], &self.values[self.width..][..cells]);
        let (top, bottom) = (pairs(simd, above, &index), pairs(simd, below, &index));
        // All four have to be measured and of one surface.
        let low = top[0].min(top[1]).min(bottom[0].min(bottom[1]));
        let high = top[0].max(top[1]).max(bottom[0].max(bottom[1]));
        let seen = inside & low.simd_gt(0.0) & (high - low).simd_lt(spread_limits(low));
        let t0 = top[0] + fu * (top[1] - top[0]);
        let t1 = bottom[0] + fu * (bottom[1] - bottom[0]);
        (seen, t0 + fv * (t1 - t0))
    }
}

/// The values at `index` and those after them.
#[inline(always)]
fn pairs<S: Simd>(simd: S, values: &[f32], index: &i32x8<S>) -> [f32x8<S>; 2] {
    let mut pairs = [0.0; LANES];
    for (pair, &index) in pairs.iter_mut().zip(index.as_slice()) {
        let first = index as u32 as usize;
        let both = &values[first..first + 2];
        *pair = bytemuck::cast::<[f32; 2], f64>([both[0], both[1]]);
    }
    let low: f32x8<S> = f64x4::from_slice(simd, &pairs[..LANES / 2]).bitcast();
    let high: f32x8<S> = f64x4::from_slice(simd, &pairs[LANES / 2..]).bitcast();
    [low.unzip_low(high), low.unzip_high(high)]
}

/// [`block_mean`] of the eight blocks from `(u, v)` on.
///
/// A lane is a block: per pixel of the blocks one strided load, one division and about six operations. The sums are taken
/// in the same order as for one block.
#[inline(always)]
fn block_means<S: Simd>(
    simd: S,
    raw: &DepthView,
    u: usize,
    v: usize,
    block: usize,
    metres_per_unit: f32,
) -> f32x8<S> {
    let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
    let (mut nearest, mut farthest) = (f32x8::splat(simd, f32::from(u16::MAX)), zero);
    let (mut sum, mut count) = (zero, zero);
    for row in 0..block {
        let pixels = &raw.row(v + row)[u..][..LANES * block];
        for column in 0..block {
            let value = f32x8::from_fn(simd, |lane| f32::from(pixels[lane * block + column]));
            let measured = value.simd_gt(0.0);
            nearest = measured.select(nearest.min(value), nearest);
            farthest = farthest.max(value);
            sum += measured.select(one / value.max(1.0), zero);
            count += measured.select(one, zero);
        }
    }
    // The extremes in inverse metres: the nearest value has the largest.
    let per_metre = f32x8::splat(simd, 1.0 / metres_per_unit);
    let (high, low) = (per_metre / nearest, per_metre / farthest.max(1.0));
    let enough = count.simd_gt(0.0) & (count * 2.0).simd_ge((block * block) as f32);
    let kept = enough & (high - low).simd_le(spread_limits(low));
    kept.select(sum * per_metre / count.max(1.0), zero)
}

/// Mean inverse depth of the block of raw pixels from `(u, v)` on, 1/m; 0 where it is missing.
fn block_mean(raw: &DepthView, u: usize, v: usize, block: usize, metres_per_unit: f32) -> f32 {
    let (mut nearest, mut farthest) = (u16::MAX, 0u16);
    let (mut sum, mut count) = (0.0f32, 0usize);
    for row in 0..block {
        for &value in &raw.row(v + row)[u..][..block] {
            if value > 0 {
                nearest = nearest.min(value);
                farthest = farthest.max(value);
                sum += 1.0 / f32::from(value);
                count += 1;
            }
        }
    }
    // Half of the pixels, at least.
    if count == 0 || 2 * count < block * block {
        return 0.0;
    }
    let per_metre = 1.0 / metres_per_unit;
    let (high, low) = (per_metre / f32::from(nearest), per_metre / f32::from(farthest));
    if high - low > spread_limit(low) { 0.0 } else { sum * per_metre / count as f32 }
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::*;

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 32, height: 24, fx: 30.0, fy: 30.0, cx: 15.5, cy: 11.5 };

    /// The map on `level` of depth `metres(u, v)` in units of 0.1 mm.
    fn filled(level: usize, metres: impl Fn(usize, usize) -> f64) -> (Vec<f32>, f32) {
        let raw: Vec<u16> = (0..32 * 24).map(|k| (metres(k % 32, k / 32) * 1e4).round() as u16).collect();
        let mut memory = vec![0; 32 * 24 * 4 + 128];
        let mut map = InverseDepthMap::carve(&mut Arena::new(&mut memory), &CAMERA, level).expect("memory");
        let share = map.fill(Level::new(), &DepthView::new(&raw, 32, 24, 32).expect("a view"), 1e-4);
        (map.values.to_vec(), share)
    }

    #[test]
    fn blocks_of_a_plane_hold_its_inverse_depth_at_their_centre() {
        let plane = |u: f64, v: f64| 0.5 + 0.001 * u - 0.002 * v;
        let (values, share) = filled(2, |u, v| 1.0 / plane(u as f64, v as f64));
        assert_eq!(share, 1.0);
        for (k, rho) in values.iter().enumerate() {
            let expected = plane(4.0 * (k % 8) as f64 + 1.5, 4.0 * (k / 8) as f64 + 1.5);
            // Rounding to 0.1 mm at 2 m is 1e-5 1/m and averages out.
            assert!((f64::from(*rho) - expected).abs() < 1e-5, "block {k}: {rho} instead of {expected}");
        }
    }

    #[test]
    fn blocks_need_half_of_their_pixels() {
        let (half, share) = filled(1, |u, _| if u % 2 == 0 { 2.0 } else { 0.0 });
        assert!(half.iter().all(|rho| (rho - 0.5).abs() < 1e-6), "the mean is over measured pixels only");
        assert_eq!(share, 1.0);
        let (less, share) = filled(1, |u, v| if u % 2 == 0 && v % 2 == 0 { 2.0 } else { 0.0 });
        assert!(less.iter().all(|rho| *rho == 0.0));
        assert_eq!(share, 0.0);
    }

    #[test]
    fn blocks_across_a_depth_edge_are_missing() {
        // The edge at column 6 cuts the second block of every row of blocks.
        let (values, _) = filled(2, |u, _| if u < 6 { 1.0 } else { 2.0 });
        for row in values.chunks_exact(8) {
            assert!((row[0] - 1.0).abs() < 1e-6 && (row[2] - 0.5).abs() < 1e-6);
            assert_eq!(row[1], 0.0);
        }
    }

    #[test]
    fn sampling_is_linear_on_a_surface_and_refuses_edges_holes_and_the_outside() {
        let mut values: Vec<f32> =
            (0..48).map(|k| 0.5 + 0.002 * (k % 8) as f32 - 0.001 * (k / 8) as f32).collect();
        values[2 * 8 + 5] = 0.0;
        values[4 * 8 + 2] = 0.9;
        let map = InverseDepthMap { values: &mut values, width: 8, height: 6, level: 0 };
        let rho = map.sample(1.25, 0.5).expect("inside of the surface");
        assert!((rho - (0.5 + 0.002 * 1.25 - 0.0005)).abs() < 1e-7);
        assert_eq!(map.sample(4.5, 1.5), None, "hole");
        assert_eq!(map.sample(1.5, 3.5), None, "depth edge");
        for (u, v) in
            [(-0.01, 1.0), (1.0, -0.01), (7.0, 1.0), (1.0, 5.0), (f32::NAN, 1.0), (1.0, f32::INFINITY)]
        {
            assert_eq!(map.sample(u, v), None, "({u}, {v})");
        }
    }
    #[test]
    fn eight_samples_are_those_taken_one_by_one_at_every_instruction_set() {
        let mut values: Vec<f32> =
            (0..48).map(|k| 0.5 + 0.002 * (k % 8) as f32 - 0.001 * (k / 8) as f32).collect();
        values[2 * 8 + 5] = 0.0;
        values[4 * 8 + 2] = 0.9;
        let map = InverseDepthMap { values: &mut values, width: 8, height: 6, level: 0 };
        // From outside on one side to outside on the other, and what is no number.
        let places: Vec<[f32; 2]> = (0..400)
            .map(|k| [0.45 * (k % 20) as f32 - 0.7, 0.37 * (k / 20) as f32 - 0.6])
            .chain([[f32::NAN, 1.0], [1.0, f32::INFINITY], [-1e30, 2.0]])
            .collect();
        for level in crate::simd::levels_up_to(Level::new()) {
            for places in places.chunks(8) {
                let sampled = dispatch!(level, simd => sampled_at(simd, &map, places));
                for (place, lane) in places.iter().zip(sampled) {
                    let name = crate::simd::level_name(level);
                    let single = map.sample(place[0], place[1]);
                    assert_eq!(lane.is_some(), single.is_some(), "{name} at {place:?}");
                    let apart = lane.unwrap_or(0.0) - single.unwrap_or(0.0);
                    assert!(apart.abs() < 1e-6, "{name} at {place:?}: {lane:?} and {single:?}");
                }
            }
        }
    }

    #[inline(always)]
    fn sampled_at<S: Simd>(simd: S, map: &InverseDepthMap, places: &[[f32; 2]]) -> [Option<f32>; 8] {
        let axis = |i: usize| f32x8::from_fn(simd, |lane| places.get(lane).map_or(-5.0, |place| place[i]));
        let all = f32x8::splat(simd, 1.0).simd_gt(0.0);
        let (seen, values) = map.sample_lanes(simd, all, axis(0), axis(1));
        core::array::from_fn(|lane| (seen.to_bitmask() >> lane & 1 == 1).then(|| values.as_slice()[lane]))
    }
}
