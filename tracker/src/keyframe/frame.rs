//! A keyframe in the caller's memory.

use arrayvec::ArrayVec;

use super::select::{Keypoint, SelectionSettings, select_keypoints};
use crate::geometry::{PinholeCamera, RigidTransform};
use crate::image::{GreyPyramid, MAX_LEVELS};
use crate::surface::{InverseDepthMap, SurfacePlanes};
use crate::trajectory::ExposureTrajectory;
use crate::workspace::{Arena, WorkspaceError, slice_bytes};

/// Upper bound of keypoints per pyramid level.
pub const MAX_KEYPOINTS: usize = 640;

/// Edge of the selection grid's cells in pixels, per level: several hundred keypoints on the fine levels, as many
/// as fit without overlap on the coarse ones.
const CELL: [usize; MAX_LEVELS] = [24, 14, 9, 6, 4, 4];

/// Image, surface and keypoints of the frame that others are aligned with.
#[derive(Debug)]
pub struct Keyframe<'m> {
    /// Reference image; sharp, or as sharp as could be had.
    pub pyramid: GreyPyramid<'m>,
    /// Full-resolution image as captured.
    pub captured: &'m mut [f32],
    /// Inverse depth.
    pub depth: InverseDepthMap<'m>,
    /// Surface planes of `depth`.
    pub planes: SurfacePlanes<'m>,
    keypoints: ArrayVec<&'m mut [Keypoint], MAX_LEVELS>,
    counts: [usize; MAX_LEVELS],
    /// Pose at mid exposure.
    pub world_from_keyframe: RigidTransform,
    /// Exposure of the keyframe seen from its own mid pose, once known.
    pub keyframe_from_camera: Option<ExposureTrajectory>,
    /// Blur of the reference image in pixels.
    pub blur: f32,
    /// Running number of the frame it was made from.
    pub frame_index: usize,
}

impl<'m> Keyframe<'m> {
    /// Bytes of workspace that a keyframe takes.
    #[must_use]
    pub const fn bytes(width: usize, height: usize, levels: usize, surface_level: usize) -> usize {
        let mut sum = 0;
        let mut level = 0;
        while level < levels {
            sum += slice_bytes::<f32>((width >> level) * (height >> level));
            level += 1;
        }
        let surface = (width >> surface_level) * (height >> surface_level);
        sum + slice_bytes::<f32>(width * height)
            + 4 * slice_bytes::<f32>(surface)
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
        for _ in 0..levels.min(MAX_LEVELS) {
            keypoints.push(arena.take(MAX_KEYPOINTS)?);
        }
        Ok(Self {
            pyramid,
            captured: arena.take(camera.width * camera.height)?,
            depth,
            planes,
            keypoints,
            counts: [0; MAX_LEVELS],
            world_from_keyframe: RigidTransform::identity(),
            keyframe_from_camera: None,
            blur: f32::MAX,
            frame_index: 0,
        })
    }

    /// Fits the planes and selects the keypoints for the current image and depth.
    pub fn prepare(&mut self, min_strength: f32, dark_intensity: f32) {
        self.planes.fit(&self.depth);
        self.select(min_strength, dark_intensity);
    }

    /// Selects the keypoints for the current image and planes.
    pub fn select(&mut self, min_strength: f32, dark_intensity: f32) {
        for (level, keypoints) in self.keypoints.iter_mut().enumerate() {
            let settings = SelectionSettings { cell: CELL[level], min_strength, dark_intensity };
            self.counts[level] = select_keypoints(
                &self.pyramid.levels[level].image(),
                level,
                &self.planes,
                self.depth.level,
                &settings,
                keypoints,
            );
        }
    }

    /// Keypoints of every level.
    #[must_use]
    pub fn keypoints(&self) -> ArrayVec<&[Keypoint], MAX_LEVELS> {
        self.keypoints.iter().zip(self.counts).map(|(keypoints, count)| &keypoints[..count]).collect()
    }
}
