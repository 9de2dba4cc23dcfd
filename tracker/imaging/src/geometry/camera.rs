//! The pinhole camera and its lens distortion.

use nalgebra::{Vector2, Vector3};

/// Pinhole intrinsics in pixels; the centre of the top-left pixel is `(0, 0)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PinholeCamera {
    /// Image width in pixels.
    pub width: usize,
    /// Image height in pixels.
    pub height: usize,
    /// Focal length along x in pixels.
    pub fx: f64,
    /// Focal length along y in pixels.
    pub fy: f64,
    /// Column of the principal point.
    pub cx: f64,
    /// Row of the principal point.
    pub cy: f64,
}

impl PinholeCamera {
    /// The camera of pyramid level `level`, where each level averages 2x2 pixels of the one below,
    /// which puts the centre of coarse pixel u at fine coordinate 2u + 1/2. Odd rows and columns at the end are dropped.
    #[must_use]
    pub fn at_level(&self, level: usize) -> Self {
        let scale = (1u64 << level) as f64;
        Self {
            width: self.width >> level,
            height: self.height >> level,
            fx: self.fx / scale,
            fy: self.fy / scale,
            cx: (self.cx + 0.5) / scale - 0.5,
            cy: (self.cy + 0.5) / scale - 0.5,
        }
    }

    /// The coordinate on pyramid level `to` of the point whose coordinate on level `from` is `x`.
    #[inline]
    #[must_use]
    pub fn pixel_at_level(x: f32, from: usize, to: usize) -> f32 {
        (x + 0.5) * (1u32 << from) as f32 / (1u32 << to) as f32 - 0.5
    }

    /// The ray through pixel `(u, v)`, scaled to unit z.
    #[must_use]
    #[inline]
    pub fn ray(&self, u: f64, v: f64) -> Vector3<f64> {
        Vector3::new((u - self.cx) / self.fx, (v - self.cy) / self.fy, 1.0)
    }

    /// The pixel of a point in camera coordinates; meaningful for positive z only.
    #[must_use]
    #[inline]
    pub fn project(&self, x_camera: &Vector3<f64>) -> Vector2<f64> {
        Vector2::new(self.fx * x_camera.x / x_camera.z + self.cx, self.fy * x_camera.y / x_camera.z + self.cy)
    }
}

/// Radial-tangential lens distortion as OpenCV defines it, on coordinates at unit depth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distortion {
    /// Radial coefficient of r^2.
    pub k1: f64,
    /// Radial coefficient of r^4.
    pub k2: f64,
    /// First tangential coefficient.
    pub p1: f64,
    /// Second tangential coefficient.
    pub p2: f64,
    /// Radial coefficient of r^6.
    pub k3: f64,
}

impl Distortion {
    /// Where the lens images the ideal point `(x, y)` at unit depth.
    #[must_use]
    #[inline]
    pub fn distort(&self, x: f64, y: f64) -> (f64, f64) {
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3));
        (
            x * radial + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x),
            y * radial + self.p1 * (r2 + 2.0 * y * y) + 2.0 * self.p2 * x * y,
        )
    }

    /// Whether all coefficients are zero.
    #[must_use]
    #[inline]
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}
