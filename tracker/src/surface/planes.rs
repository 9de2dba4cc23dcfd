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
