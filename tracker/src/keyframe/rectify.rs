//! A keyframe as if all of it had been seen in one moment.
//!
//! Rows that are exposed one after the other shear a moving picture, and depth that is measured at another time than
//! colour lies beside it. A frame's own path says by how much. Without this every later frame would be compared with a
//! sheared reference.

use fearless_simd::Level;

use super::resample::{Shifts, resample};
use super::row_views::{RowViews, pixel_of, ray_of};
use crate::geometry::{PinholeCamera, RigidTransform};
use crate::image::LevelImage;
use crate::session::{Walk, are_finite};
use crate::surface::InverseDepthMap;
use crate::trajectory::{BowedTrajectory, ExposureTrajectory, FrameTiming};
use crate::workspace::{Arena, WorkspaceError, slice_bytes};

/// Rounds of looking where a point was seen when the row of the last guess was exposed. Each leaves the row's motion per
/// row, below a fifth, of the error before.
const ROUNDS: usize = 3;

/// The same from a guess that is right but for parallax.
const SHIFT_ROUNDS: usize = 2;

/// Memory for the keyframe as it was captured.
#[derive(Debug)]
pub struct RectifyScratch<'m> {
    image: &'m mut [f32],
    depth: &'m mut [f32],
    /// From a pixel of the rectified picture to where it was captured, for every pixel of the depth map; full-resolution
    /// pixels.
    shift: &'m mut [[f32; 2]],
}

impl<'m> RectifyScratch<'m> {
    /// Bytes of workspace for images of this size; `colour` and `depth` say whether colour has rows of its own times and
    /// whether depth has another time than the middle of the colour image.
    #[must_use]
    pub const fn bytes(
        width: usize,
        height: usize,
        surface_level: usize,
        colour: bool,
        depth: bool,
    ) -> usize {
        let (pixels, nodes) = (width * height, (width >> surface_level) * (height >> surface_level));
        let of_colour = if colour { slice_bytes::<f32>(pixels) + slice_bytes::<[f32; 2]>(nodes) } else { 0 };
        of_colour + if colour || depth { slice_bytes::<f32>(nodes) } else { 0 }
    }

    /// Takes the memory from `arena`; see [`Self::bytes`].
    ///
    /// # Errors
    /// [`WorkspaceError`] when the arena is exhausted.
    pub fn carve(
        arena: &mut Arena<'m>,
        camera: &PinholeCamera,
        surface_level: usize,
        colour: bool,
        depth: bool,
    ) -> Result<Self, WorkspaceError> {
        let nodes = (camera.width >> surface_level) * (camera.height >> surface_level);
        Ok(Self {
            image: arena.take(if colour { camera.width * camera.height } else { 0 })?,
            depth: arena.take(if colour || depth { nodes } else { 0 })?,
            shift: arena.take(if colour { nodes } else { 0 })?,
        })
    }

    /// Remembers a keyframe as it was captured.
    pub fn capture(&mut self, image: &[f32], depth: &[f32]) {
        if !self.image.is_empty() {
            self.image.copy_from_slice(image);
        }
        if !self.depth.is_empty() {
            self.depth.copy_from_slice(depth);
        }
    }

    /// The picture that is given one time; empty if the memory is not for rows with times of their own.
    pub fn image(&mut self) -> &mut [f32] {
        self.image
    }

    /// Writes back the picture and the depth that are given one time.
    pub fn restore(&self, image: &mut [f32], depth: &mut [f32]) {
        if !self.image.is_empty() {
            image.copy_from_slice(self.image);
        }
        if !self.depth.is_empty() {
            depth.copy_from_slice(self.depth);
        }
    }

    /// Forgets the keyframe as it was captured.
    pub(crate) fn forget(&mut self) {
        self.image.fill(0.0);
        self.depth.fill(0.0);
    }

    /// Visits the keyframe as it was captured; shifts serve within a call.
    pub(crate) fn walk(&mut self, walk: &mut Walk<'_>) {
        walk.values(self.image);
        walk.values(self.depth);
    }

    /// Whether what was restored can be worked with.
    pub(crate) fn is_sound(&self) -> bool {
        are_finite(self.image) && are_finite(self.depth)
    }

    /// Writes the remembered keyframe to `image` and `depth` as it would have been seen at the middle of its path
    /// `keyframe_from_camera`, whose middle is the identity. Where depth is missing, the picture moves like a surface at
    /// the mean depth. Returns the largest shift of the picture in pixels.
    pub fn rectify(
        &mut self,
        simd: Level,
        keyframe_from_camera: &BowedTrajectory,
        timing: &FrameTiming,
        camera: &PinholeCamera,
        image: &mut [f32],
        depth: &mut InverseDepthMap,
    ) -> f32 {
        if !self.depth.is_empty() && (timing.depth_time != 0.0 || timing.depth_readout != 0.0) {
            self.rectify_depth(keyframe_from_camera, timing, camera, depth);
        }
        self.rectify_image(simd, keyframe_from_camera, timing, camera, image, depth)
    }

    /// Moves `depth` as if the camera that measured it had been at `keyframe_from_camera` instead of in the keyframe.
    pub fn move_depth(
        &mut self,
        keyframe_from_camera: &RigidTransform,
        camera: &PinholeCamera,
        depth: &mut InverseDepthMap,
    ) {
        if !self.depth.is_empty() {
            self.depth.copy_from_slice(depth.values);
            let still = BowedTrajectory::without_bow(ExposureTrajectory::still(*keyframe_from_camera));
            self.rectify_depth(&still, &FrameTiming::GLOBAL, camera, depth);
        }
    }

    /// Gives the remembered picture another path of the keyframe, see [`Self::rectify`]; depth stays.
    pub fn rectify_image(
        &mut self,
        simd: Level,
        keyframe_from_camera: &BowedTrajectory,
        timing: &FrameTiming,
        camera: &PinholeCamera,
        image: &mut [f32],
        depth: &InverseDepthMap,
    ) -> f32 {
        if self.image.is_empty() || !timing.is_rolling() {
            return 0.0;
        }
        let longest = self.find_shifts(keyframe_from_camera, timing, camera, depth);
        let source = LevelImage { pixels: self.image, width: camera.width, height: camera.height };
        let shifts =
            Shifts { at_nodes: self.shift, width: depth.width, height: depth.height, level: depth.level };
        resample(simd, &source, &shifts, image);
        longest
    }

    /// Depth at the middle of the path: what the map measured along the ray of every pixel.
    fn rectify_depth(
        &mut self,
        path: &BowedTrajectory,
        timing: &FrameTiming,
        camera: &PinholeCamera,
        depth: &mut InverseDepthMap,
    ) {
        let (width, height) = (depth.width, depth.height);
        let camera = camera.at_level(depth.level);
        let views = RowViews::new(path, |v| timing.depth_row_time(v, height), height);
        let captured = InverseDepthMap { values: self.depth, width, height, level: depth.level };
        for v in 0..height {
            for u in 0..width {
                let ray = ray_of(&camera, u as f32, v as f32);
                let index = v * width + u;
                let mut rho = captured.values[index];
                let mut row = v as f32;
                for _ in 0..ROUNDS {
                    let view = views.at(row);
                    let x = view.rotation * ray + view.translation * rho;
                    if !(rho > 0.0 && x.z > 0.1) {
                        rho = 0.0;
                        break;
                    }
                    let pixel = pixel_of(&camera, &x);
                    row = pixel[1];
                    let turned = view.rotation * ray;
                    // Along the ray, z in the other camera is turned.z / rho + translation.z.
                    rho = captured.sample(pixel[0], pixel[1]).map_or(0.0, |measured| {
                        turned.z * measured / (1.0 - view.translation.z * measured).max(0.1)
                    });
                }
                depth.values[index] = rho;
            }
        }
    }

    /// Fills the shifts at the pixels of the depth map; returns the longest.
    fn find_shifts(
        &mut self,
        path: &BowedTrajectory,
        timing: &FrameTiming,
        camera: &PinholeCamera,
        depth: &InverseDepthMap,
    ) -> f32 {
        let views = RowViews::new(path, |v| timing.row_time(v, camera.height), camera.height);
        let fallback = depth.mean().unwrap_or(0.0);
        let mut longest_squared = 0.0f32;
        // The row in which the pixel beside was seen is the first guess.
        let mut beside = 0.0;
        for (index, shift) in self.shift.iter_mut().enumerate() {
            let at = |x: usize| PinholeCamera::pixel_at_level(x as f32, depth.level, 0);
            let (u, v) = (at(index % depth.width), at(index / depth.width));
            let rho = if depth.values[index] > 0.0 { depth.values[index] } else { fallback };
            let ray = ray_of(camera, u, v);
            let mut row = v + beside;
            let mut seen = [u, v];
            for _ in 0..SHIFT_ROUNDS {
                seen = views.project(&ray, rho, camera, row).unwrap_or([u, v]);
                row = seen[1];
            }
            *shift = [seen[0] - u, seen[1] - v];
            beside = shift[1];
            longest_squared = longest_squared.max(shift[0] * shift[0] + shift[1] * shift[1]);
        }
        crate::math::sqrt_f32(longest_squared)
    }
}
