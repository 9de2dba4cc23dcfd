//! Local planes of a keyframe's surface.

use fearless_simd::{Level, dispatch, f32x8, prelude::*};

use super::block_mean::{InverseDepthMap, spread_limit, spread_limits};
use crate::geometry::PinholeCamera;
use crate::workspace::{Arena, WorkspaceError};

/// Half width of the window that a plane is fitted to, in pixels of the map.
const WINDOW_RADIUS: usize = 2;

/// Pixels of a side of the window.
const WINDOW: usize = 2 * WINDOW_RADIUS + 1;

/// Fewest measured pixels of the 5x5 window for a plane.
const MIN_SUPPORT: f32 = 14.0;

/// Least determinant of the second moments of those pixels: less is a line.
const MIN_DETERMINANT: f32 = 1.0;

/// Planes that are fitted at the same time.
const LANES: usize = 8;

/// Plane of inverse depth around every pixel of a map: `rho(u, v) = value + slope_u du + slope_v dv`.
#[derive(Debug)]
pub struct SurfacePlanes<'m> {
    /// Fitted inverse depth at the pixel, 1/m; 0 where there is no plane.
    pub value: &'m mut [f32],
    /// Change of inverse depth per column.
    pub slope_u: &'m mut [f32],
    /// Change of inverse depth per row.
    pub slope_v: &'m mut [f32],
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl<'m> SurfacePlanes<'m> {
    /// Takes the memory for the planes of a map on `level` of `camera`'s images.
    ///
    /// # Errors
    /// [`WorkspaceError`] when the arena is exhausted.
    pub fn carve(
        arena: &mut Arena<'m>,
        camera: &PinholeCamera,
        level: usize,
    ) -> Result<Self, WorkspaceError> {
        let (width, height) = (camera.width >> level, camera.height >> level);
        Ok(Self {
            value: arena.take(width * height)?,
            slope_u: arena.take(width * height)?,
            slope_v: arena.take(width * height)?,
            width,
            height,
        })
    }

    /// Fits the planes of `map`, which has the same size.
    pub fn fit(&mut self, level: Level, map: &InverseDepthMap) {
        dispatch!(level, simd => self.fit_rows(simd, map));
    }

    /// Eight planes at a time where their windows lie inside, one by one along the border.
    #[inline(always)]
    fn fit_rows<S: Simd>(&mut self, simd: S, map: &InverseDepthMap) {
        let (width, height) = (self.width, self.height);
        for v in 0..height {
            let is_inside = v >= WINDOW_RADIUS && v + WINDOW_RADIUS < height;
            let mut u = 0;
            while u < width {
                let index = v * width + u;
                if is_inside && u >= WINDOW_RADIUS && u + LANES + WINDOW_RADIUS <= width {
                    let [value, slope_u, slope_v] = fit_planes(simd, map, index);
                    value.store_slice(&mut self.value[index..index + LANES]);
                    slope_u.store_slice(&mut self.slope_u[index..index + LANES]);
                    slope_v.store_slice(&mut self.slope_v[index..index + LANES]);
                    u += LANES;
                } else {
                    let plane = fit_plane(map, u, v).unwrap_or_default();
                    self.value[index] = plane.value;
                    self.slope_u[index] = plane.slope_u;
                    self.slope_v[index] = plane.slope_v;
                    u += 1;
                }
            }
        }
    }

    /// Copies planes of the same size.
    pub fn copy_from(&mut self, other: &SurfacePlanes) {
        self.value.copy_from_slice(other.value);
        self.slope_u.copy_from_slice(other.slope_u);
        self.slope_v.copy_from_slice(other.slope_v);
    }

    /// Inverse depth of the plane nearest to `(u, v)`, continued to that point; `None` where there is none.
    #[must_use]
    #[inline]
    pub fn inverse_depth(&self, u: f32, v: f32) -> Option<f32> {
        let inside = u >= -0.5 && v >= -0.5 && u < self.width as f32 - 0.5 && v < self.height as f32 - 0.5;
        if !inside {
            return None;
        }
        // The nearest node; slopes are per node.
        let (i, j) = ((u + 0.5) as usize, (v + 0.5) as usize);
        let index = j * self.width + i;
        let rho =
            self.value[index] + self.slope_u[index] * (u - i as f32) + self.slope_v[index] * (v - j as f32);
        (self.value[index] > 0.0 && rho > 0.0).then_some(rho)
    }
}

#[derive(Clone, Copy, Default)]
struct Plane {
    value: f32,
    slope_u: f32,
    slope_v: f32,
}

/// [`fit_plane`] for the eight pixels from `index` on, all of whose windows lie inside; zero where there is no plane.
///
/// A lane is a pixel: 25 loads, and about nine operations for each. The sums are taken in the same order as for one plane.
#[inline(always)]
fn fit_planes<S: Simd>(simd: S, map: &InverseDepthMap, index: usize) -> [f32x8<S>; 3] {
    let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
    let load = |at: usize| f32x8::from_slice(simd, &map.values[at..at + LANES]);
    let centre = load(index);
    let limit = spread_limits(centre);
    let mut s = [zero; 6];
    let mut t = [zero; 3];
    for j in 0..WINDOW {
        for i in 0..WINDOW {
            let rho = load(index + j * map.width + i - WINDOW_RADIUS * (map.width + 1));
            // Relative to the centre, so that nothing cancels in single precision.
            let difference = rho - centre;
            let counts = rho.simd_gt(0.0) & difference.abs().simd_lt(limit);
            let (count, difference) = (counts.select(one, zero), counts.select(difference, zero));
            let (x, y) = (i as f32 - WINDOW_RADIUS as f32, j as f32 - WINDOW_RADIUS as f32);
            for (sum, factor) in s.iter_mut().zip([1.0, x, y, x * x, x * y, y * y]) {
                *sum += count * factor;
            }
            for (sum, factor) in t.iter_mut().zip([1.0, x, y]) {
                *sum += difference * factor;
            }
        }
    }
    let has_support = s[0].simd_ge(MIN_SUPPORT) & centre.simd_gt(0.0);
    let inverse_count = one / s[0].max(1.0);
    // Moments about the mean: the constant is eliminated, and a 2x2 system is left.
    let xx = s[3] - s[1] * s[1] * inverse_count;
    let xy = s[4] - s[1] * s[2] * inverse_count;
    let yy = s[5] - s[2] * s[2] * inverse_count;
    let xt = t[1] - s[1] * t[0] * inverse_count;
    let yt = t[2] - s[2] * t[0] * inverse_count;
    let determinant = xx * yy - xy * xy;
    let holds = has_support & determinant.simd_ge(MIN_DETERMINANT);
    // Lanes without a plane divide by something, too.
    let determinant = determinant.max(MIN_DETERMINANT);
    let slope_u = (yy * xt - xy * yt) / determinant;
    let slope_v = (xx * yt - xy * xt) / determinant;
    let value = (t[0] - slope_u * s[1] - slope_v * s[2]) * inverse_count;
    [value + centre, slope_u, slope_v].map(|figure| holds.select(figure, zero))
}

/// Least-squares plane through the pixels of the window that lie on the surface of the centre pixel.
fn fit_plane(map: &InverseDepthMap, u: usize, v: usize) -> Option<Plane> {
    let centre = map.values[v * map.width + u];
    if centre <= 0.0 {
        return None;
    }
    let limit = spread_limit(centre);
    let mut s = [0.0f32; 6];
    let mut t = [0.0f32; 3];
    for j in v.saturating_sub(WINDOW_RADIUS)..(v + WINDOW_RADIUS + 1).min(map.height) {
        for i in u.saturating_sub(WINDOW_RADIUS)..(u + WINDOW_RADIUS + 1).min(map.width) {
            let rho = map.values[j * map.width + i];
            let difference = rho - centre;
            if rho > 0.0 && difference.abs() < limit {
                let (x, y) = (i as f32 - u as f32, j as f32 - v as f32);
                for (sum, term) in s.iter_mut().zip([1.0, x, y, x * x, x * y, y * y]) {
                    *sum += term;
                }
                for (sum, term) in t.iter_mut().zip([difference, x * difference, y * difference]) {
                    *sum += term;
                }
            }
        }
    }
    solve_plane(&s, &t).map(|plane| Plane { value: plane.value + centre, ..plane })
}

/// Solves the 3x3 normal equations with moments `s` (1, x, y, xx, xy, yy) and right side `t` (1, x, y).
fn solve_plane(s: &[f32; 6], t: &[f32; 3]) -> Option<Plane> {
    if s[0] < MIN_SUPPORT {
        return None;
    }
    let inverse_count = 1.0 / s[0];
    // Moments about the mean, which leave a 2x2 system of the slopes.
    let (xx, xy, yy) = (
        s[3] - s[1] * s[1] * inverse_count,
        s[4] - s[1] * s[2] * inverse_count,
        s[5] - s[2] * s[2] * inverse_count,
    );
    let (xt, yt) = (t[1] - s[1] * t[0] * inverse_count, t[2] - s[2] * t[0] * inverse_count);
    let determinant = xx * yy - xy * xy;
    if determinant < MIN_DETERMINANT {
        return None;
    }
    // Cramer's rule.
    let slope_u = (yy * xt - xy * yt) / determinant;
    let slope_v = (xx * yt - xy * xt) / determinant;
    let value = (t[0] - slope_u * s[1] - slope_v * s[2]) * inverse_count;
    Some(Plane { value, slope_u, slope_v })
}

#[cfg(test)]
mod tests {
    use std::vec;

    use super::*;
    use crate::simd::{level_name, levels_up_to};

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 16, height: 12, fx: 15.0, fy: 15.0, cx: 7.5, cy: 5.5 };

    fn check_fit(rho: impl Fn(usize, usize) -> f32, check: impl Fn(usize, usize, &SurfacePlanes)) {
        let mut memory = vec![0; 4 * (16 * 12 * 4 + 64) + 64];
        let mut arena = Arena::new(&mut memory);
        let map = InverseDepthMap::carve(&mut arena, &CAMERA, 0).expect("memory");
        for (k, value) in map.values.iter_mut().enumerate() {
            *value = rho(k % 16, k / 16);
        }
        let mut planes = SurfacePlanes::carve(&mut arena, &CAMERA, 0).expect("memory");
        planes.fit(Level::new(), &map);
        (0..16 * 12).for_each(|k| check(k % 16, k / 16, &planes));
    }

    #[test]
    fn an_exact_plane_is_recovered_despite_holes() {
        let rho = |u: usize, v: usize| 0.6 + 0.003 * u as f32 - 0.002 * v as f32;
        let holes = |u: usize, v: usize| (3 * u + 5 * v).is_multiple_of(7);
        check_fit(
            |u, v| if holes(u, v) { 0.0 } else { rho(u, v) },
            |u, v, planes| {
                let k = v * 16 + u;
                if holes(u, v) {
                    assert_eq!(planes.value[k], 0.0, "a hole has no plane");
                } else if (2..14).contains(&u) && (2..10).contains(&v) {
                    assert!((planes.value[k] - rho(u, v)).abs() < 1e-6);
                    assert!((planes.slope_u[k] - 0.003).abs() < 1e-6);
                    assert!((planes.slope_v[k] + 0.002).abs() < 1e-6);
                }
            },
        );
    }

    #[test]
    fn planes_on_both_sides_of_a_step_ignore_the_other_side() {
        let rho = |u: usize, _: usize| if u < 8 { 0.4 + 0.004 * u as f32 } else { 0.9 - 0.002 * u as f32 };
        check_fit(rho, |u, v, planes| {
            if (2..10).contains(&v) && (2..14).contains(&u) && planes.value[v * 16 + u] > 0.0 {
                let slope = if u < 8 { 0.004 } else { -0.002 };
                assert!((planes.slope_u[v * 16 + u] - slope).abs() < 1e-6, "slope at column {u}");
                assert!(planes.slope_v[v * 16 + u].abs() < 1e-6);
            }
        });
    }

    #[test]
    fn every_instruction_set_fits_the_same_planes() {
        const SIDE: usize = 40;
        let camera = PinholeCamera { width: SIDE, height: SIDE, ..CAMERA };
        let mut memory = vec![0; 4 * (SIDE * SIDE * 4 + 64) + 64];
        let mut arena = Arena::new(&mut memory);
        let map = InverseDepthMap::carve(&mut arena, &camera, 0).expect("memory");
        for (k, value) in map.values.iter_mut().enumerate() {
            let (u, v) = (k % SIDE, k / SIDE);
            // Steps, slopes, roughness and holes.
            let rough = 0.002 * ((7 * u + 13 * v) % 11) as f32;
            *value = if (3 * u + 5 * v) % 9 < 3 {
                0.0
            } else {
                0.3 + 0.2 * (u / 13) as f32 + 0.004 * v as f32 + rough
            };
        }
        let mut planes = SurfacePlanes::carve(&mut arena, &camera, 0).expect("memory");
        let mut fitted = 0;
        for level in levels_up_to(Level::new()) {
            planes.fit(level, &map);
            for k in 0..SIDE * SIDE {
                let expected = fit_plane(&map, k % SIDE, k / SIDE).unwrap_or_default();
                let found = [planes.value[k], planes.slope_u[k], planes.slope_v[k]];
                let expected = [expected.value, expected.slope_u, expected.slope_v];
                let same = found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-6);
                assert!(same, "{}, pixel {k}: {found:?}, not {expected:?}", level_name(level));
                fitted += usize::from(found[0] > 0.0);
            }
        }
        assert!(fitted > 500, "{fitted} planes");
    }

    #[test]
    fn planes_continue_to_the_next_pixel_border_and_no_farther() {
        check_fit(
            |u, v| 0.5 + 0.01 * u as f32 + 0.001 * v as f32,
            |u, v, planes| {
                if u > 2 && u < 13 && v > 2 && v < 9 {
                    let (x, y) = (u as f32 + 0.4, v as f32 - 0.3);
                    let rho = planes.inverse_depth(x, y).expect("a plane");
                    assert!((rho - (0.5 + 0.01 * x + 0.001 * y)).abs() < 1e-6);
                }
                for (x, y) in [(-0.6, 3.0), (3.0, 11.6), (15.6, 3.0), (f32::NAN, 3.0)] {
                    assert_eq!(planes.inverse_depth(x, y), None);
                }
            },
        );
    }

    #[test]
    fn isolated_measurements_have_no_plane() {
        check_fit(
            |u, v| if u % 2 == 0 && v % 2 == 0 { 0.5 } else { 0.0 },
            |u, v, planes| assert_eq!(planes.value[v * 16 + u], 0.0),
        );
    }
}
