//! The path that every pixel of an image travels during the exposure.

use crate::geometry::PinholeCamera;
use crate::surface::SurfacePlanes;
use crate::trajectory::ExposureTrajectory;
use crate::workspace::{Arena, WorkspaceError};

/// Displacement of every pixel from shutter opening to closing, pixels.
#[derive(Debug)]
pub struct BlurFlow<'m> {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Displacement along columns.
    pub du: &'m mut [f32],
    /// Displacement along rows.
    pub dv: &'m mut [f32],
}

impl<'m> BlurFlow<'m> {
    pub(super) fn carve(
        arena: &mut Arena<'m>,
        width: usize,
        height: usize,
    ) -> Result<Self, WorkspaceError> {
        Ok(Self { width, height, du: arena.take(width * height)?, dv: arena.take(width * height)? })
    }

    /// Computes the displacements for the exposure `keyframe_from_camera` of a keyframe, seen from its own mid
    /// pose, with the keyframe's surface planes; pixels without a plane take `fallback_inverse_depth`.
    ///
    /// The path of a pixel is straight to well under a pixel: it is stored by its two ends only.
    pub fn fill(
        &mut self,
        keyframe_from_camera: &ExposureTrajectory,
        camera: &PinholeCamera,
        planes: &SurfacePlanes,
        planes_level: usize,
        fallback_inverse_depth: f32,
    ) {
        let coarse = camera.at_level(planes_level);
        let scale = (1u32 << planes_level) as f32;
        let (start, end) = (EndView::new(&keyframe_from_camera.start), EndView::new(&keyframe_from_camera.end));
        let block = 1usize << planes_level;
        for v in 0..self.height {
            let j = (v / block).min(planes.height - 1);
            for u in (0..self.width).step_by(block) {
                let i = (u / block).min(planes.width - 1);
                let plane = planes.value[j * planes.width + i];
                let rho = if plane > 0.0 { plane } else { fallback_inverse_depth };
                let x = [
                    (i as f32 - coarse.cx as f32) / coarse.fx as f32,
                    (((v as f32 + 0.5) / scale - 0.5) - coarse.cy as f32) / coarse.fy as f32,
                ];
                let (a, b) = (start.project(x, rho), end.project(x, rho));
                let du = (b[0] - a[0]) * camera.fx as f32;
                let dv = (b[1] - a[1]) * camera.fy as f32;
                let last = (u + block).min(self.width);
                self.du[v * self.width..][u..last].fill(du);
                self.dv[v * self.width..][u..last].fill(dv);
            }
        }
    }
}

/// Camera at one end of the exposure.
struct EndView {
    rotation: [[f32; 3]; 3],
    position: [f32; 3],
}

impl EndView {
    fn new(keyframe_from_camera: &crate::geometry::RigidTransform) -> Self {
        let r = keyframe_from_camera.rotation_matrix();
        let p = keyframe_from_camera.translation;
        Self {
            rotation: core::array::from_fn(|i| core::array::from_fn(|j| r[(i, j)] as f32)),
            position: [p.x as f32, p.y as f32, p.z as f32],
        }
    }

    /// Where the mid view sees the point at inverse depth `rho` behind `x` of this view, at unit depth.
    fn project(&self, x: [f32; 2], rho: f32) -> [f32; 2] {
        let y: [f32; 3] = core::array::from_fn(|i| {
            self.rotation[i][0] * x[0] + self.rotation[i][1] * x[1] + self.rotation[i][2] + self.position[i] * rho
        });
        let inverse_z = 1.0 / y[2].max(0.1);
        [y[0] * inverse_z, y[1] * inverse_z]
    }
}
