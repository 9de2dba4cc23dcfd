//! A keyframe in the caller's memory.

use arrayvec::ArrayVec;
use fearless_simd::Level;

use super::rolling_fusion::fuse_rolling_depth;
use super::select::{Keypoint, SelectionSettings, select_keypoints};
use crate::geometry::{PinholeCamera, RigidTransform};
use crate::image::{GreyLevel, GreyPyramid, MAX_LEVELS, PixelRectangle};
use crate::session::{Walk, are_finite};
use crate::surface::{InverseDepthMap, SurfacePlanes, fuse_depth};
use crate::trajectory::{BowedTrajectory, ExposureTrajectory, FrameTiming};
use crate::workspace::{Arena, WorkspaceError, slice_bytes};

/// Upper bound of keypoints per pyramid level.
pub const MAX_KEYPOINTS: usize = 640;

/// Edge of the selection grid's cells in pixels, per level: several hundred keypoints on the fine levels, as many
/// as fit without overlap on the coarse ones.
const CELL: [usize; MAX_LEVELS] = [24, 14, 9, 6, 4, 4];

/// Keypoints that a level of `width` by `height` pixels can have: one per cell, at most [`MAX_KEYPOINTS`].
#[must_use]
pub fn max_keypoints(width: usize, height: usize, level: usize) -> usize {
    let cell = CELL[level.min(MAX_LEVELS - 1)];
    (width.div_ceil(cell) * height.div_ceil(cell)).min(MAX_KEYPOINTS)
}

/// Image, surface and keypoints of the frame that others are aligned with.
#[derive(Debug)]
pub struct Keyframe<'m> {
    /// Reference image; sharp, or as sharp as could be had.
    pub pyramid: GreyPyramid<'m>,
    /// Inverse depth.
    pub depth: InverseDepthMap<'m>,
    /// Surface planes of `depth`.
    pub planes: SurfacePlanes<'m>,
    /// Measurements behind every value of `depth`.
    weights: &'m mut [f32],
    fusions: usize,
    keypoints: ArrayVec<&'m mut [Keypoint], MAX_LEVELS>,
    counts: [usize; MAX_LEVELS],
    /// `world_from_keyframe` at mid exposure.
    pub world_from_keyframe: RigidTransform,
    /// Path of the keyframe's own frame seen from its mid pose; `None` while it is unknown.
    pub keyframe_from_camera: Option<BowedTrajectory>,
    /// When the parts of its frame were measured along that path.
    pub timing: FrameTiming,
    /// Blur of the image as captured, pixels of its finest level; `f32::MAX` while it is unknown.
    pub blur: f32,
    /// Running number of the frame it was made from.
    pub frame_index: usize,
}

impl<'m> Keyframe<'m> {
    /// Bytes of workspace that a keyframe of `levels` levels takes whose depth map is on `surface_level`.
    #[must_use]
    pub const fn bytes(width: usize, height: usize, levels: usize, surface_level: usize) -> usize {
        let surface = (width >> surface_level) * (height >> surface_level);
        GreyPyramid::bytes(width, height, levels)
            + 5 * slice_bytes::<f32>(surface)
            + levels * slice_bytes::<Keypoint>(MAX_KEYPOINTS)
    }

    /// Takes the memory of a keyframe.
    ///
    /// # Errors
    /// [`WorkspaceError`] when the arena is exhausted.
    pub fn carve(
        arena: &mut Arena<'m>,
        camera: &PinholeCamera,
        levels: usize,
        surface_level: usize,
    ) -> Result<Self, WorkspaceError> {
        let mut keypoints = ArrayVec::new();
        let pyramid = GreyPyramid::carve(arena, camera, levels)?;
        let depth = InverseDepthMap::carve(arena, camera, surface_level)?;
        let planes = SurfacePlanes::carve(arena, camera, surface_level)?;
        let weights = arena.take(depth.values.len())?;
        for _ in 0..levels.min(MAX_LEVELS) {
            keypoints.push(arena.take(MAX_KEYPOINTS)?);
        }
        Ok(Self {
            pyramid,
            depth,
            planes,
            weights,
            fusions: 0,
            keypoints,
            counts: [0; MAX_LEVELS],
            world_from_keyframe: RigidTransform::identity(),
            keyframe_from_camera: None,
            timing: FrameTiming::GLOBAL,
            blur: f32::MAX,
            frame_index: 0,
        })
    }

    /// Selects the keypoints of every level within `region` of the finest, for the current image and planes.
    pub fn select(&mut self, simd: Level, min_strength: f32, dark_intensity: f32, region: PixelRectangle) {
        for (level, keypoints) in self.keypoints.iter_mut().enumerate() {
            let settings = SelectionSettings {
                cell: CELL[level],
                min_strength,
                dark_intensity,
                region: region.at_level(level),
            };
            // Every level has its own keypoints: what is an edge on one is noise or flat on another.
            self.counts[level] = select_keypoints(
                simd,
                &self.pyramid.levels[level].image(),
                level,
                &self.planes,
                self.depth.level,
                &settings,
                keypoints,
            );
        }
    }

    /// Starts anew with the depth map as it is: one measurement per pixel, planes fitted to it.
    pub fn restart_surface(&mut self, level: Level) {
        self.weights.fill(1.0);
        self.fusions = 0;
        self.planes.fit(level, &self.depth);
    }

    /// Fits the planes again after `depth` was moved as a whole; measurements keep their number.
    pub fn refit_surface(&mut self, level: Level) {
        self.planes.fit(level, &self.depth);
    }

    /// Averages in the depth map of a frame that moved along `keyframe_from_camera` and whose depth was measured at the times
    /// of `timing`; `camera` is that of the depth maps. Planes and keypoint depths follow whenever the number of frames
    /// has doubled, from two on.
    pub fn fuse_depth(
        &mut self,
        level: Level,
        current: &InverseDepthMap,
        keyframe_from_camera: &BowedTrajectory,
        timing: &FrameTiming,
        camera: &PinholeCamera,
    ) {
        if timing.depth_readout == 0.0 {
            let keyframe_from_depth = keyframe_from_camera.at(0.5 + timing.depth_time);
            fuse_depth(level, &mut self.depth, self.weights, current, &keyframe_from_depth, camera);
        } else {
            let (depth, weights) = (&mut self.depth, &mut *self.weights);
            fuse_rolling_depth(level, depth, weights, current, keyframe_from_camera, timing, camera);
        }
        self.fusions += 1;
        if self.fusions > 1 && self.fusions.is_power_of_two() {
            self.planes.fit(level, &self.depth);
            for (pyramid_level, keypoints) in self.keypoints.iter_mut().enumerate() {
                let at = |x: f32| PinholeCamera::pixel_at_level(x, pyramid_level, self.depth.level);
                for keypoint in &mut keypoints[..self.counts[pyramid_level]] {
                    if let Some(rho) = self.planes.inverse_depth(at(keypoint.u), at(keypoint.v)) {
                        keypoint.inverse_depth = rho;
                    }
                }
            }
        }
    }

    /// Keypoints of every level.
    #[must_use]
    pub fn keypoints(&self) -> ArrayVec<&[Keypoint], MAX_LEVELS> {
        self.keypoints.iter().zip(self.counts).map(|(keypoints, count)| &keypoints[..count]).collect()
    }

    /// Keypoints of the finest level.
    #[must_use]
    pub fn finest_keypoints(&self) -> &[Keypoint] {
        self.keypoints.first().map_or(&[], |keypoints| &keypoints[..self.counts[0]])
    }

    /// Copies the coarse part of `other`, whose level `skip` has the size of this keyframe's finest level and
    /// carries its depth map.
    pub fn copy_coarse(&mut self, other: &Keyframe, skip: usize) {
        for (to, from) in self.pyramid.levels.iter_mut().zip(other.pyramid.levels.iter().skip(skip)) {
            to.pixels.copy_from_slice(from.pixels);
        }
        self.depth.values.copy_from_slice(other.depth.values);
        self.planes.copy_from(&other.planes);
        for (level, to) in self.keypoints.iter_mut().enumerate() {
            let count = other.counts[level + skip];
            to[..count].copy_from_slice(&other.keypoints[level + skip][..count]);
            self.counts[level] = count;
        }
        self.world_from_keyframe = other.world_from_keyframe;
        self.keyframe_from_camera = other.keyframe_from_camera;
        self.timing = other.timing;
        self.blur = other.blur / (1u32 << skip) as f32;
        self.frame_index = other.frame_index;
    }

    /// Visits all of the keyframe.
    pub(crate) fn walk(&mut self, walk: &mut Walk<'_>) {
        self.counts.iter_mut().for_each(|count| walk.count(count));
        self.pyramid.levels.iter_mut().for_each(|level| walk.values(level.pixels));
        walk.values(self.depth.values);
        let SurfacePlanes { value, slope_u, slope_v, width: _, height: _ } = &mut self.planes;
        [value, slope_u, slope_v].into_iter().for_each(|figures| walk.values(figures));
        walk.values(self.weights);
        for (keypoints, count) in self.keypoints.iter_mut().zip(self.counts) {
            let count = count.min(keypoints.len());
            walk.values(&mut keypoints[..count]);
        }
        walk.count(&mut self.fusions);
        walk.pose(&mut self.world_from_keyframe);
        let still = ExposureTrajectory::still(RigidTransform::identity());
        walk.option(&mut self.keyframe_from_camera, BowedTrajectory::without_bow(still), Walk::path);
        walk.timing(&mut self.timing);
        walk.value(&mut self.blur);
        walk.count(&mut self.frame_index);
    }

    /// Leaves a keyframe that shows nothing, as when it was made.
    pub(crate) fn forget(&mut self) {
        self.counts = [0; MAX_LEVELS];
        self.fusions = 0;
        self.pyramid.levels.iter_mut().for_each(|level| level.pixels.fill(0.0));
        let SurfacePlanes { value, slope_u, slope_v, width: _, height: _ } = &mut self.planes;
        let maps = [&mut *self.depth.values, value, slope_u, slope_v, self.weights];
        maps.into_iter().for_each(|values| values.fill(0.0));
        self.world_from_keyframe = RigidTransform::identity();
        self.keyframe_from_camera = None;
        self.timing = FrameTiming::GLOBAL;
        self.blur = f32::MAX;
        self.frame_index = 0;
    }

    /// Whether a keyframe that was restored can be worked with.
    pub(crate) fn is_sound(&self) -> bool {
        let level_is_sound = |(level, (keypoints, count)): (&GreyLevel<'_>, (&&mut [Keypoint], usize))| {
            let is_inside = |keypoint: &Keypoint| {
                let Keypoint { u, v, inverse_depth, strength } = *keypoint;
                (0.0..level.width as f32).contains(&u)
                    && (0.0..level.height as f32).contains(&v)
                    && are_finite(&[inverse_depth, strength])
            };
            are_finite(level.pixels)
                && keypoints.get(..count).is_some_and(|keypoints| keypoints.iter().all(is_inside))
        };
        let paths_are_sound = self
            .keyframe_from_camera
            .is_none_or(|path| path.linear.start.is_valid() && path.linear.end.is_valid());
        let planes = &self.planes;
        self.pyramid.levels.iter().zip(self.keypoints.iter().zip(self.counts)).all(level_is_sound)
            && self.depth.values.iter().all(|rho| rho.is_finite() && *rho >= 0.0)
            && [&*planes.value, planes.slope_u, planes.slope_v, self.weights].into_iter().all(are_finite)
            && self.world_from_keyframe.is_valid()
            && paths_are_sound
            && self.fusions < usize::MAX / 2
    }
}
