//! Local planes of a keyframe's surface.

use super::block_mean::{InverseDepthMap, spread_limit};
use crate::geometry::PinholeCamera;
use crate::workspace::{Arena, WorkspaceError};

/// Half width of the window that a plane is fitted to, in pixels of the map.
const WINDOW_RADIUS: usize = 2;

/// Fewest measured pixels of the 5x5 window for a plane.
const MIN_SUPPORT: f32 = 14.0;

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
    pub fn fit(&mut self, map: &InverseDepthMap) {
        for v in 0..self.height {
            for u in 0..self.width {
                let plane = fit_plane(map, u, v).unwrap_or_default();
                let index = v * self.width + u;
                self.value[index] = plane.value;
                self.slope_u[index] = plane.slope_u;
                self.slope_v[index] = plane.slope_v;
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
    pub fn inverse_depth(&self, u: f32, v: f32) -> Option<f32> {
        let inside = u >= -0.5 && v >= -0.5 && u < self.width as f32 - 0.5 && v < self.height as f32 - 0.5;
        if !inside {
            return None;
        }
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
    let (xx, xy, yy) = (
        s[3] - s[1] * s[1] * inverse_count,
        s[4] - s[1] * s[2] * inverse_count,
        s[5] - s[2] * s[2] * inverse_count,
    );
    let (xt, yt) = (t[1] - s[1] * t[0] * inverse_count, t[2] - s[2] * t[0] * inverse_count);
    let determinant = xx * yy - xy * xy;
    if determinant < 1.0 {
        return None;
    }
    let slope_u = (yy * xt - xy * yt) / determinant;
    let slope_v = (xx * yt - xy * xt) / determinant;
    let value = (t[0] - slope_u * s[1] - slope_v * s[2]) * inverse_count;
    Some(Plane { value, slope_u, slope_v })
}

#[cfg(test)]
mod tests {
    use std::vec;

    use super::*;

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
        planes.fit(&map);
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
