//! A keyframe as if all of it had been seen in one moment.
//!
//! Rows that are exposed one after the other shear a moving picture, and depth that is measured at another time than
//! colour lies beside it. A frame's own path says by how much. Without this every later frame would be compared with a
//! sheared reference.

use fearless_simd::{Level, dispatch, f32x8, prelude::*};

use super::resample::{Shifts, resample};
use super::row_views::{RowViews, pixels_of, rays_of};
use crate::geometry::{PinholeCamera, RigidTransform};
use crate::image::LevelImage;
use crate::session::{Walk, are_finite};
use crate::surface::{InverseDepthMap, lanes_of, store_lanes};
use crate::trajectory::{BowedTrajectory, ExposureTrajectory, FrameTiming};
use crate::workspace::{Arena, WorkspaceError, slice_bytes};

/// Rounds of looking where a point was seen when the row of the last guess was exposed. Each leaves the row's motion per
/// row, below a fifth, of the error before.
const ROUNDS: usize = 3;

/// The same from a guess that is right but for parallax.
const SHIFT_ROUNDS: usize = 2;

/// Pixels that are worked on at the same time.
const LANES: usize = 8;

/// Least distance in front of the camera, as a share of the point's depth in the keyframe.
const MIN_Z: f32 = 0.1;

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
            dispatch!(simd, simd => self.rectify_depth(simd, keyframe_from_camera, timing, camera, depth));
        }
        self.rectify_image(simd, keyframe_from_camera, timing, camera, image, depth)
    }

    /// Moves `depth` as if the camera that measured it had been at `keyframe_from_camera` instead of in the keyframe.
    pub fn move_depth(
        &mut self,
        simd: Level,
        keyframe_from_camera: &RigidTransform,
        camera: &PinholeCamera,
        depth: &mut InverseDepthMap,
    ) {
        if !self.depth.is_empty() {
            self.depth.copy_from_slice(depth.values);
            let still = BowedTrajectory::without_bow(ExposureTrajectory::still(*keyframe_from_camera));
            dispatch!(simd, simd => self.rectify_depth(simd, &still, &FrameTiming::GLOBAL, camera, depth));
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
        let longest =
            dispatch!(simd, simd => self.find_shifts(simd, keyframe_from_camera, timing, camera, depth));
        let source = LevelImage { pixels: self.image, width: camera.width, height: camera.height };
        let shifts =
            Shifts { at_nodes: self.shift, width: depth.width, height: depth.height, level: depth.level };
        resample(simd, &source, &shifts, image);
        longest
    }

    /// Depth at the middle of the path: what the map measured along the ray of every pixel.
    ///
    /// Eight pixels at a time; per vector and round eight loads of pairs and about 90 arithmetic operations.
    #[inline(always)]
    fn rectify_depth<S: Simd>(
        &mut self,
        simd: S,
        path: &BowedTrajectory,
        timing: &FrameTiming,
        camera: &PinholeCamera,
        depth: &mut InverseDepthMap,
    ) {
        let (width, height) = (depth.width, depth.height);
        let camera = camera.at_level(depth.level);
        let views = RowViews::new(path, |v| timing.depth_row_time(v, height), height);
        let captured = InverseDepthMap { values: self.depth, width, height, level: depth.level };
        let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
        for v in 0..height {
            let measured_row = &captured.values[v * width..][..width];
            for first in (0..width).step_by(LANES) {
                let u = f32x8::from_fn(simd, |lane| (first + lane) as f32);
                let ray = rays_of(simd, &camera, u, v as f32);
                let mut rho = lanes_of(simd, measured_row, first);
                let mut row = f32x8::splat(simd, v as f32);
                for _ in 0..ROUNDS {
                    let view = views.at(simd, row);
                    let x = view.points(ray, rho);
                    let in_front = rho.simd_gt(0.0) & x[2].simd_gt(MIN_Z);
                    let pixel = pixels_of(simd, &camera, &x, in_front);
                    row = in_front.select(pixel[1], row);
                    let (seen, measured) = captured.sample_lanes(simd, in_front, pixel[0], pixel[1]);
                    // Along the ray, z in the other camera is turned.z / rho + translation.z.
                    let moved = view.turned(2, ray) * measured / (one - view.shift(2) * measured).max(0.1);
                    rho = seen.select(moved, zero);
                    if seen.all_false() {
                        break;
                    }
                }
                store_lanes(rho, &mut depth.values[v * width..][..width], first);
            }
        }
    }

    /// Fills the shifts at the pixels of the depth map, eight at a time; returns the longest.
    #[inline(always)]
    fn find_shifts<S: Simd>(
        &mut self,
        simd: S,
        path: &BowedTrajectory,
        timing: &FrameTiming,
        camera: &PinholeCamera,
        depth: &InverseDepthMap,
    ) -> f32 {
        let views = RowViews::new(path, |v| timing.row_time(v, camera.height), camera.height);
        let fallback = f32x8::splat(simd, depth.mean().unwrap_or(0.0));
        let mut longest_squared = f32x8::splat(simd, 0.0);
        let at = |x: usize| PinholeCamera::pixel_at_level(x as f32, depth.level, 0);
        let width = depth.width;
        for j in 0..depth.height {
            let (above, shifts) =
                self.shift[j.saturating_sub(1) * width..].split_at_mut(width.min(j * width));
            let (v, rounds) = (at(j), if j == 0 { ROUNDS } else { SHIFT_ROUNDS });
            for first in (0..width).step_by(LANES) {
                let u = f32x8::from_fn(simd, |lane| at(first + lane));
                let ray = rays_of(simd, camera, u, v);
                let rho = lanes_of(simd, &depth.values[j * width..][..width], first);
                let rho = rho.simd_gt(0.0).select(rho, fallback);
                // The row in which the pixel above was seen is the first guess.
                let shift = |lane: usize| above.get(first + lane).map_or(0.0, |shift| shift[1]);
                let mut row = f32x8::from_fn(simd, shift) + v;
                let mut du = f32x8::splat(simd, 0.0);
                let mut dv = du;
                for _ in 0..rounds {
                    let x = views.at(simd, row).points(ray, rho);
                    let in_front = x[2].simd_gt(MIN_Z);
                    let pixel = pixels_of(simd, camera, &x, in_front);
                    row = in_front.select(pixel[1], f32x8::splat(simd, v));
                    (du, dv) = (in_front.select(pixel[0], u) - u, row - v);
                }
                let last = (first + LANES).min(width);
                let lanes = du.as_slice().iter().zip(dv.as_slice());
                for (shift, (&du, &dv)) in shifts[first..last].iter_mut().zip(lanes) {
                    *shift = [du, dv];
                }
                longest_squared = longest_squared.max(du * du + dv * dv);
            }
        }
        crate::math::sqrt_f32(longest_squared.as_slice().iter().fold(0.0, |a, &b| a.max(b)))
    }
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use nalgebra::{Vector3, Vector6};

    use super::*;
    use crate::simd::{level_name, levels_up_to};

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 96, height: 72, fx: 90.0, fy: 91.0, cx: 47.0, cy: 36.0 };

    /// A camera whose picture moves by several pixels from the first row to the last.
    fn path() -> BowedTrajectory {
        let motion = Vector6::new(0.04, -0.03, 0.05, 0.02, -0.06, 0.04);
        let linear = ExposureTrajectory::from_mid_and_motion(&RigidTransform::identity(), &motion);
        BowedTrajectory {
            bow: Vector6::new(0.02, 0.01, -0.02, 0.01, 0.02, -0.01),
            ..BowedTrajectory::without_bow(linear)
        }
    }

    const TIMING: FrameTiming =
        FrameTiming { exposure: 0.4, readout: 0.7, bands: 16, depth_time: 0.15, depth_readout: 0.6 };

    /// Inverse depth of the plane `n x = 1` along the ray of pixel `(u, v)` of a camera at `pose`.
    fn plane(pose: &RigidTransform, camera: &PinholeCamera, u: f64, v: f64) -> f64 {
        let n = Vector3::new(0.04, -0.02, 0.5);
        n.dot(&(pose.rotation * camera.ray(u, v))) / (1.0 - n.dot(&pose.translation))
    }

    #[test]
    fn rows_of_different_times_become_those_of_the_middle_at_every_instruction_set() {
        let (path, coarse) = (path(), CAMERA.at_level(1));
        let (width, height) = (coarse.width, coarse.height);
        let pixel = |k: usize| ((k % width) as f64, (k / width) as f64);
        // Depth as its rows were measured, and as it is at the middle of the path.
        let of_rows = |k: usize| {
            let (u, v) = pixel(k);
            plane(&path.at(TIMING.depth_row_time(v, height)), &coarse, u, v) as f32
        };
        let captured: Vec<f32> = (0..width * height).map(of_rows).collect();
        for level in levels_up_to(Level::new()) {
            let name = level_name(level);
            let mut memory = vec![0; RectifyScratch::bytes(CAMERA.width, CAMERA.height, 1, true, true) + 64];
            let mut scratch = RectifyScratch::carve(&mut Arena::new(&mut memory), &CAMERA, 1, true, true)
                .expect("memory for one keyframe");
            let mut values = captured.clone();
            let mut image = vec![0.5; CAMERA.width * CAMERA.height];
            scratch.capture(&image, &values);
            let mut depth = InverseDepthMap { values: &mut values, width, height, level: 1 };
            let longest = scratch.rectify(level, &path, &TIMING, &CAMERA, &mut image, &mut depth);
            let seen = depth.values.iter().filter(|rho| **rho > 0.0).count();
            assert!(seen * 10 > width * height * 8, "{name}: only {seen} pixels have depth");
            for (k, &rho) in depth.values.iter().enumerate().filter(|(_, rho)| **rho > 0.0) {
                let (u, v) = pixel(k);
                let expected = plane(&RigidTransform::identity(), &coarse, u, v);
                let error = (f64::from(rho) - expected).abs();
                assert!(error < 2e-4, "{name} ({u}, {v}): {rho} instead of {expected}");
            }
            // A shift ends where the point is seen when that row is exposed.
            let mut largest = 0.0f64;
            for (k, shift) in scratch.shift.iter().enumerate() {
                let (i, j) = pixel(k);
                let rho = f64::from(depth.values[k]);
                if rho == 0.0 {
                    continue;
                }
                let (u, v) = (2.0 * i + 0.5, 2.0 * j + 0.5);
                let point = CAMERA.ray(u, v) / rho;
                let seen = [u + f64::from(shift[0]), v + f64::from(shift[1])];
                let pose = path.at(TIMING.row_time(seen[1], CAMERA.height));
                let there = CAMERA.project(&pose.inverse().transform_point(&point));
                let error = (there.x - seen[0]).hypot(there.y - seen[1]);
                assert!(error < 0.02, "{name} ({u}, {v}): {seen:?} instead of {there:?}");
                largest = largest.max(f64::from(shift[0]).hypot(f64::from(shift[1])));
            }
            assert!(largest > 2.0, "{name}: nothing moves");
            assert!(f64::from(longest) >= largest, "{name}: {longest} is not the longest, {largest} is");
        }
    }
}
