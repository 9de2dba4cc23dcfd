//! Finding the camera again: coarse copies of recent keyframes and the search among them.

use arrayvec::ArrayVec;
use fearless_simd::Level;

use super::coarse_to_fine::{Aligned, FrameTask};
use super::config::MAX_RECENT_KEYFRAMES;
use super::history::Motion;
use crate::align::{AlignScratch, AlignSettings, Alignment, FrameData, ReferenceData};
use crate::geometry::{PinholeCamera, RigidTransform};
use crate::keyframe::{Keyframe, typical_inverse_depth};
use crate::session::Walk;
use crate::transfer::BrightnessModel;
use crate::work::Work;
use crate::workspace::{Arena, WorkspaceError};

/// A view counts as found when this share of a keyframe's patches is in view and agrees.
const MIN_INLIERS: f32 = 0.35;

/// Largest photometric residual of a view that was found, in nominal standard deviations.
const MAX_RESIDUAL: f32 = 6.0;

/// Largest depth residual of a view that was found, 1/m.
const MAX_DEPTH_RESIDUAL: f32 = 0.012;

/// Coarse copies of the last keyframes, in a ring.
#[derive(Debug)]
pub(super) struct RecentKeyframes<'m> {
    slots: ArrayVec<Keyframe<'m>, MAX_RECENT_KEYFRAMES>,
    filled: usize,
    next: usize,
}

impl<'m> RecentKeyframes<'m> {
    pub(super) fn carve(
        arena: &mut Arena<'m>,
        camera: &PinholeCamera,
        levels: usize,
        surface_level: usize,
        count: usize,
    ) -> Result<Self, WorkspaceError> {
        let coarse = camera.at_level(surface_level);
        let mut slots = ArrayVec::new();
        for _ in 0..count.min(MAX_RECENT_KEYFRAMES) {
            slots.push(Keyframe::carve(arena, &coarse, levels - surface_level, 0)?);
        }
        Ok(Self { slots, filled: 0, next: 0 })
    }

    pub(super) fn clear(&mut self) {
        self.filled = 0;
        self.next = 0;
    }

    /// Keeps the levels of `keyframe` from its depth map's on, in place of the oldest copy.
    pub(super) fn remember(&mut self, keyframe: &Keyframe, surface_level: usize) {
        if let Some(slot) = self.slots.get_mut(self.next) {
            slot.copy_coarse(keyframe, surface_level);
            self.filled = (self.filled + 1).min(self.slots.len());
            self.next = (self.next + 1) % self.slots.len();
        }
    }

    /// Visits the remembered keyframes.
    pub(super) fn walk(&mut self, walk: &mut Walk<'_>) {
        walk.count(&mut self.filled);
        walk.count(&mut self.next);
        let filled = self.filled.min(self.slots.len());
        self.slots[..filled].iter_mut().for_each(|slot| slot.walk(walk));
    }

    /// Whether what was restored can be worked with.
    pub(super) fn is_sound(&self) -> bool {
        // The first slots are filled first.
        let is_in_ring = self.next < self.slots.len().max(1);
        is_in_ring && self.slots.get(..self.filled).is_some_and(|slots| slots.iter().all(Keyframe::is_sound))
    }

    /// Moves the remembered keyframes to another world.
    pub(super) fn move_world(&mut self, new_world_from_world: &RigidTransform) {
        for keyframe in &mut self.slots[..self.filled] {
            keyframe.world_from_keyframe = new_world_from_world.compose(&keyframe.world_from_keyframe);
        }
    }

    /// Looks for `view` from the poses of the remembered keyframes and the last known pose; returns
    /// `world_from_camera` at mid exposure. What that took is added to `work`.
    #[allow(clippy::too_many_arguments, reason = "borrows disjoint parts of the tracker")]
    pub(super) fn find(
        &self,
        simd: Level,
        camera: &PinholeCamera,
        view: FrameData,
        settings: &AlignSettings,
        motion: &Motion,
        timestamp: f64,
        scratch: &mut AlignScratch,
        work: &mut Work,
    ) -> Option<RigidTransform> {
        let mut best: Option<(f32, RigidTransform)> = None;
        for keyframe in &self.slots[..self.filled] {
            let keypoints = keyframe.keypoints();
            let reference = ReferenceData {
                levels: &keyframe.pyramid.levels,
                keypoints: &keypoints,
                depth: &keyframe.depth,
                planes: &keyframe.planes,
            };
            let finest = keyframe.finest_keypoints();
            let local = motion.seen_from(&keyframe.world_from_keyframe.inverse());
            let task = FrameTask {
                alignment: Alignment {
                    simd,
                    camera: *camera,
                    reference,
                    frame: view,
                    expected_brightness: BrightnessModel::default(),
                    settings,
                },
                motion: Motion::still(local.timestamp, local.reference_from_mid),
                timestamp,
                span: 0.0,
                gyro: None,
                turning: None,
                expected_path: None,
                brightness: BrightnessModel::default(),
                blur: false,
                inverse_depth: typical_inverse_depth(finest),
            };
            let guesses = [local.reference_from_mid, RigidTransform::identity()];
            let Aligned { outcome, work: spent } = task.run(&guesses, scratch);
            *work += spent;
            let inliers = outcome.patches as f32 / finest.len().max(1) as f32;
            let fits = outcome.photometric_scale < MAX_RESIDUAL && outcome.depth_scale < MAX_DEPTH_RESIDUAL;
            if fits && inliers > best.map_or(MIN_INLIERS, |(share, _)| share) {
                let mid = outcome.estimate.keyframe_from_camera.mid();
                best = Some((inliers, keyframe.world_from_keyframe.compose(&mid)));
            }
        }
        best.map(|(_, world_from_mid)| world_from_mid)
    }
}
