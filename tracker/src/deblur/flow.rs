//! The path that every part of an image travels during the exposure.

use crate::geometry::{PinholeCamera, RigidTransform};
use crate::surface::SurfacePlanes;
use crate::trajectory::{BowedTrajectory, FrameTiming};
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

    /// Computes the displacements for the exposures of the rows of a keyframe along its path `keyframe_from_camera`,
    /// seen from its own mid pose, with surface planes on pyramid level `planes_level`; blocks without a plane take
    /// `fallback_inverse_depth`. Each row is where it was captured: its displacement is seen from the middle of its own
    /// exposure. Returns the longest displacement in pixels.
    pub fn fill(
        &mut self,
        keyframe_from_camera: &BowedTrajectory,
        timing: &FrameTiming,
        camera: &PinholeCamera,
        planes: &SurfacePlanes,
        planes_level: usize,
        fallback_inverse_depth: f32,
    ) -> f32 {
        let linear = &keyframe_from_camera.linear;
        let mut ends = [EndView::new(&linear.start), EndView::new(&linear.end)];
        let (fx, fy, cx, cy) = (camera.fx as f32, camera.fy as f32, camera.cx as f32, camera.cy as f32);
        let per_row = self.blocks_per_row();
        let mut longest_squared = 0.0f32;
        for (block, displacement) in self.displacement.iter_mut().enumerate() {
            // The centre of the block, and its depth there.
            let u = ((block % per_row) * BLOCK_WIDTH) as f32 + 0.5 * (BLOCK_WIDTH - 1) as f32;
            let v = ((block / per_row) * BLOCK_HEIGHT) as f32 + 0.5 * (BLOCK_HEIGHT - 1) as f32;
            // All blocks of a row are exposed at the same time.
            if timing.reaches_outside() && block % per_row == 0 {
                let middle = timing.row_time(f64::from(v), self.height);
                let row_from_keyframe = keyframe_from_camera.at(middle).inverse();
                ends = [-0.5, 0.5].map(|end| {
                    let end = keyframe_from_camera.at(middle + end * timing.exposure);
                    EndView::new(&row_from_keyframe.compose(&end))
                });
            }
            let at = |x: f32| PinholeCamera::pixel_at_level(x, 0, planes_level);
            let rho = planes.inverse_depth(at(u), at(v)).unwrap_or(fallback_inverse_depth);
            let x = [(u - cx) / fx, (v - cy) / fy];
            let [a, b] = [ends[0].project(x, rho), ends[1].project(x, rho)];
            // From opening to closing, pixels.
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

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use nalgebra::Vector6;

    use super::*;
    use crate::trajectory::ExposureTrajectory;

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 100, height: 72, fx: 90.0, fy: 95.0, cx: 48.0, cy: 36.0 };
    const INVERSE_DEPTH: f32 = 0.4;

    /// Centre and displacement of a block.
    type Block = ([f64; 2], [f64; 2]);

    /// The flow of `motion`, as centre and displacement per block, and the longest; the left half of the image has
    /// a plane, the rest the fallback of twice its inverse depth.
    fn flow(motion: Vector6<f64>) -> (Vec<Block>, f32) {
        let (width, height) = (50, 36);
        let mut value: Vec<f32> =
            (0..width * height).map(|k| if k % width < 24 { INVERSE_DEPTH } else { 0.0 }).collect();
        let (mut slope_u, mut slope_v) = (vec![0.0; width * height], vec![0.0; width * height]);
        let planes =
            SurfacePlanes { value: &mut value, slope_u: &mut slope_u, slope_v: &mut slope_v, width, height };
        let mut memory = vec![0; BlurFlow::bytes(100, 72) + 64];
        let mut flow = BlurFlow::carve(&mut Arena::new(&mut memory), 100, 72).expect("memory");
        let linear = ExposureTrajectory::from_mid_and_motion(&RigidTransform::identity(), &motion);
        let path = BowedTrajectory::without_bow(linear);
        let longest = flow.fill(&path, &FrameTiming::GLOBAL, &CAMERA, &planes, 1, 2.0 * INVERSE_DEPTH);
        let per_row = flow.blocks_per_row();
        let centre = |b: usize| [(b % per_row * 8) as f64 + 3.5, (b / per_row * 4) as f64 + 1.5];
        let blocks = flow.displacement.iter().enumerate();
        (blocks.map(|(b, d)| (centre(b), d.map(f64::from))).collect(), longest)
    }

    fn check(motion: Vector6<f64>, expected: impl Fn(f64, f64, f64) -> [f64; 2]) {
        let (blocks, longest) = flow(motion);
        let mut largest = 0.0f64;
        for ([u, v], got) in blocks {
            let rho = f64::from(INVERSE_DEPTH) * if u < 48.0 { 1.0 } else { 2.0 };
            let want = expected(u, v, rho);
            let error = (got[0] - want[0]).hypot(got[1] - want[1]);
            assert!(error < 1e-4, "({u}, {v}): {got:?} instead of {want:?}");
            largest = largest.max(want[0].hypot(want[1]));
        }
        assert!((f64::from(longest) - largest).abs() < 1e-4, "longest {longest}, not {largest}");
    }

    #[test]
    fn sideways_motion_shifts_by_its_parallax() {
        check(Vector6::new(0.05, -0.02, 0.0, 0.0, 0.0, 0.0), |_, _, rho| {
            [90.0 * 0.05 * rho, -95.0 * 0.02 * rho]
        });
    }

    #[test]
    fn approach_expands_from_the_principal_point() {
        check(Vector6::new(0.0, 0.0, 0.2, 0.0, 0.0, 0.0), |u, v, rho| {
            // x/(1 + t rho/2) - x/(1 - t rho/2) = -x t rho/(1 - (t rho/2)^2)
            let factor = -0.2 * rho / (1.0 - (0.1 * rho).powi(2));
            [(u - 48.0) * factor, (v - 36.0) * factor]
        });
    }

    #[test]
    fn roll_turns_about_the_principal_point() {
        check(Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.1), |u, v, _| {
            // The chord of the arc: 2 sin(angle/2) along the tangent.
            let chord = 2.0 * 0.05f64.sin();
            [-chord * (v - 36.0) / 95.0 * 90.0, chord * (u - 48.0) / 90.0 * 95.0]
        });
    }

    #[test]
    fn pan_follows_the_tangent_of_the_angle() {
        check(Vector6::new(0.0, 0.0, 0.0, 0.0, 0.06, 0.0), |u, v, _| {
            let angle = ((u - 48.0) / 90.0).atan();
            let column = |turn: f64| 90.0 * (angle + turn).tan();
            let row = |turn: f64| (v - 36.0) * angle.cos() / (angle + turn).cos();
            [column(0.03) - column(-0.03), row(0.03) - row(-0.03)]
        });
    }
}
