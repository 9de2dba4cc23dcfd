//! A keyframe as if all of it had been seen in one moment.
//!
//! Rows that are exposed one after the other shear a moving picture, and depth that is measured at another time than
//! colour lies beside it. A frame's own path says by how much. Without this every later frame would be compared with a
//! sheared reference.

use super::row_views::{RowViews, pixel_of, ray_of};
use crate::geometry::{PinholeCamera, RigidTransform};
use crate::image::LevelImage;
use crate::surface::InverseDepthMap;
use crate::trajectory::{BowedTrajectory, ExposureTrajectory, FrameTiming};
use crate::workspace::{Arena, WorkspaceError, slice_bytes};

/// Rounds of looking where a point was seen when the row of the last guess was exposed. Each leaves the row's motion per
/// row, below a fifth, of the error before.
const ROUNDS: usize = 3;

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

    /// Writes back a keyframe as it was captured.
    pub fn restore(&self, image: &mut [f32], depth: &mut [f32]) {
        if !self.image.is_empty() {
            image.copy_from_slice(self.image);
        }
        if !self.depth.is_empty() {
            depth.copy_from_slice(self.depth);
        }
    }

    /// Writes the remembered keyframe to `image` and `depth` as it would have been seen at the middle of its path
    /// `keyframe_from_camera`, whose middle is the identity. Where depth is missing, the picture moves like a surface at
    /// the mean depth. Returns the largest shift of the picture in pixels.
    pub fn rectify(
        &mut self,
        keyframe_from_camera: &BowedTrajectory,
        timing: &FrameTiming,
        camera: &PinholeCamera,
        image: &mut [f32],
        depth: &mut InverseDepthMap,
    ) -> f32 {
        if !self.depth.is_empty() && (timing.depth_time != 0.0 || timing.depth_readout != 0.0) {
            self.rectify_depth(keyframe_from_camera, timing, camera, depth);
        }
        self.rectify_image(keyframe_from_camera, timing, camera, image, depth)
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
        self.resample(camera, depth, image);
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
        for (index, shift) in self.shift.iter_mut().enumerate() {
            let at = |x: usize| PinholeCamera::pixel_at_level(x as f32, depth.level, 0);
            let (u, v) = (at(index % depth.width), at(index / depth.width));
            let rho = if depth.values[index] > 0.0 { depth.values[index] } else { fallback };
            let ray = ray_of(camera, u, v);
            let mut seen = [u, v];
            for _ in 0..ROUNDS {
                seen = views.project(&ray, rho, camera, seen[1]).unwrap_or([u, v]);
            }
            *shift = [seen[0] - u, seen[1] - v];
            longest_squared = longest_squared.max(shift[0] * shift[0] + shift[1] * shift[1]);
        }
        crate::math::sqrt_f32(longest_squared)
    }

    /// The remembered image at every pixel plus its shift, both interpolated bilinearly; the border is continued.
    fn resample(&self, camera: &PinholeCamera, depth: &InverseDepthMap, image: &mut [f32]) {
        let source = LevelImage { pixels: self.image, width: camera.width, height: camera.height };
        let node = |x: usize, count: usize| {
            let at = PinholeCamera::pixel_at_level(x as f32, 0, depth.level).clamp(0.0, (count - 1) as f32);
            let first = (at as usize).min(count.saturating_sub(2));
            (first, at - first as f32)
        };
        for (v, row) in image.chunks_exact_mut(camera.width).enumerate() {
            let (j, fv) = node(v, depth.height);
            let (above, below) = (&self.shift[j * depth.width..], &self.shift[(j + 1) * depth.width..]);
            for (u, light) in row.iter_mut().enumerate() {
                let (i, fu) = node(u, depth.width);
                let shift: [f32; 2] = core::array::from_fn(|k| {
                    let top = above[i][k] + fu * (above[i + 1][k] - above[i][k]);
                    let bottom = below[i][k] + fu * (below[i + 1][k] - below[i][k]);
                    top + fv * (bottom - top)
                });
                *light = continued(&source, u as f32 + shift[0], v as f32 + shift[1]);
            }
        }
    }
}

/// Bilinear intensity, with the border continued.
fn continued(image: &LevelImage, u: f32, v: f32) -> f32 {
    let (last_u, last_v) = ((image.width - 1) as f32, (image.height - 1) as f32);
    let (u, v) = (u.clamp(0.0, last_u), v.clamp(0.0, last_v));
    let (i, j) = ((u as usize).min(image.width - 2), (v as usize).min(image.height - 2));
    let (fu, fv) = (u - i as f32, v - j as f32);
    let top = &image.pixels[j * image.width + i..][..2];
    let bottom = &image.pixels[(j + 1) * image.width + i..][..2];
    let above = top[0] + fu * (top[1] - top[0]);
    let below = bottom[0] + fu * (bottom[1] - bottom[0]);
    above + fv * (below - above)
}
