//! The path that every part of an image travels during the exposure.

use crate::geometry::{PinholeCamera, RigidTransform};
use crate::surface::SurfacePlanes;
use crate::trajectory::ExposureTrajectory;
use crate::workspace::{Arena, WorkspaceError, slice_bytes};

/// Columns of a block that shares one displacement: one vector of the blur kernel.
pub const BLOCK_WIDTH: usize = 8;

/// Rows of a block that shares one displacement.
pub const BLOCK_HEIGHT: usize = 4;

/// Displacement from shutter opening to closing for every block of an image, pixels.
///
/// Within 8x4 pixels the displacement of a real exposure changes by a fraction of a pixel, and a constant one
/// turns the blur into sums of shifted rows, which need no gathers.
#[derive(Debug)]
pub struct BlurFlow<'m> {
    /// Columns of the image.
    pub width: usize,
    /// Rows of the image.
    pub height: usize,
    /// Displacement `(du, dv)` of every block, row-major.
    pub displacement: &'m mut [[f32; 2]],
}

impl<'m> BlurFlow<'m> {
    /// Bytes of workspace for an image of this size.
    #[must_use]
    pub const fn bytes(width: usize, height: usize) -> usize {
        slice_bytes::<[f32; 2]>(width.div_ceil(BLOCK_WIDTH) * height.div_ceil(BLOCK_HEIGHT))
    }

    /// Takes the memory for an image of this size from `arena`; the flow is zero.
    ///
    /// # Errors
    /// [`WorkspaceError`] when the arena is exhausted.
    pub fn carve(arena: &mut Arena<'m>, width: usize, height: usize) -> Result<Self, WorkspaceError> {
        let blocks = width.div_ceil(BLOCK_WIDTH) * height.div_ceil(BLOCK_HEIGHT);
        Ok(Self { width, height, displacement: arena.take(blocks)? })
    }

    /// Blocks per row of blocks.
    #[must_use]
    pub fn blocks_per_row(&self) -> usize {
        self.width.div_ceil(BLOCK_WIDTH)
    }

    /// Computes the displacements for the exposure `keyframe_from_camera` of a keyframe, seen from its own mid
    /// pose, with the keyframe's surface planes on pyramid level `planes_level`; blocks without a plane take
    /// `fallback_inverse_depth`. Returns the longest displacement in pixels.
    pub fn fill(
        &mut self,
        keyframe_from_camera: &ExposureTrajectory,
        camera: &PinholeCamera,
        planes: &SurfacePlanes,
        planes_level: usize,
        fallback_inverse_depth: f32,
    ) -> f32 {
        let ends = [EndView::new(&keyframe_from_camera.start), EndView::new(&keyframe_from_camera.end)];
        let (fx, fy, cx, cy) = (camera.fx as f32, camera.fy as f32, camera.cx as f32, camera.cy as f32);
        let per_row = self.blocks_per_row();
        let mut longest_squared = 0.0f32;
        for (block, displacement) in self.displacement.iter_mut().enumerate() {
            let u = ((block % per_row) * BLOCK_WIDTH) as f32 + 0.5 * (BLOCK_WIDTH - 1) as f32;
            let v = ((block / per_row) * BLOCK_HEIGHT) as f32 + 0.5 * (BLOCK_HEIGHT - 1) as f32;
            let at = |x: f32| PinholeCamera::pixel_at_level(x, 0, planes_level);
            let rho = planes.inverse_depth(at(u), at(v)).unwrap_or(fallback_inverse_depth);
            let x = [(u - cx) / fx, (v - cy) / fy];
            let [a, b] = [ends[0].project(x, rho), ends[1].project(x, rho)];
            *displacement = [(b[0] - a[0]) * fx, (b[1] - a[1]) * fy];
            let squared = displacement[0] * displacement[0] + displacement[1] * displacement[1];
            longest_squared = longest_squared.max(squared);
        }
        crate::math::sqrt_f32(longest_squared)
    }
}

/// Camera at one end of the exposure.
struct EndView {
    rotation: [[f32; 3]; 3],
    position: [f32; 3],
}

impl EndView {
    fn new(keyframe_from_camera: &RigidTransform) -> Self {
        let r = keyframe_from_camera.rotation_matrix();
        let p = keyframe_from_camera.translation;
        Self {
            rotation: core::array::from_fn(|i| core::array::from_fn(|j| r[(i, j)] as f32)),
            position: [p.x as f32, p.y as f32, p.z as f32],
        }
    }

    /// Where the mid view sees what this view sees at `x` (unit depth), at inverse depth `rho`.
    fn project(&self, x: [f32; 2], rho: f32) -> [f32; 2] {
        let y: [f32; 3] = core::array::from_fn(|i| {
            self.rotation[i][0] * x[0]
                + self.rotation[i][1] * x[1]
                + self.rotation[i][2]
                + self.position[i] * rho
        });
        let inverse_z = 1.0 / y[2].max(0.1);
        [y[0] * inverse_z, y[1] * inverse_z]
    }
}
