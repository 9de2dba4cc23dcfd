//! Aligning a frame with a sharp view outside of the tracking loop: to recognise a place, or to judge a view.

use mba_adjust::bundle::MappedFrame;
use mba_adjust::deblurring::{DeblurMemory, KeyframeDeblurrer};
use mba_io::dataset::RgbdFrame;
use mba_tracker::error::FrameError as TrackError;
use mba_tracker::geometry::RigidTransform;
use mba_tracker::{FrameStatus, SimdLevel, Tracker, TrackerConfig};

use super::messages::SharpView;
use crate::tracking::tracker_view;

/// Share of the view's patches that have to agree for a frame to be recognised.
const MIN_INLIERS: f32 = 0.35;

/// A tracker of its own, which starts anew for every question.
pub(crate) struct Relocaliser {
    config: TrackerConfig,
    simd: SimdLevel,
    memory: Vec<u8>,
    deblurrer: KeyframeDeblurrer,
    deblur_memory: DeblurMemory,
}

/// Where a frame was seen from, according to one view.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PoseMeasurement {
    /// `world_from_camera` at mid exposure, in the world of the view's pose.
    pub(crate) world_from_camera: RigidTransform,
    /// Robust photometric residual, standard deviations of the nominal noise.
    pub(super) residual: f32,
    /// Share (0 to 1) of the view's patches that agree.
    pub(crate) inliers: f32,
}

impl Relocaliser {
    pub(crate) fn new(config: &TrackerConfig, simd: SimdLevel) -> Self {
        let deblurrer = KeyframeDeblurrer::new(config, simd);
        let deblur_memory = deblurrer.memory();
        let mut config = config.clone();
        // The whole of what is known: a place is recognised from a single view.
        config.align.depth_term = true;
        Self { memory: vec![0; config.workspace_len()], config, simd, deblurrer, deblur_memory }
    }

    /// Aligns a frame with a view, from a guess of the frame's pose; `None` if they do not fit.
    pub(crate) fn align_to(
        &mut self,
        image: &RgbdFrame,
        view: &SharpView,
        world_from_camera: &RigidTransform,
    ) -> Option<PoseMeasurement> {
        let mut tracker = Tracker::new(&self.config, self.simd, &mut self.memory).ok()?;
        let align = || -> Result<_, TrackError> {
            tracker.relocate(&view.reference(&self.config.camera)?, world_from_camera)?;
            tracker.track(&tracker_view(image)?)
        };
        let result = { align }().ok()?;
        (result.status == FrameStatus::Ok && result.inliers > MIN_INLIERS).then_some(PoseMeasurement {
            world_from_camera: result.world_from_mid,
            residual: result.residual,
            inliers: result.inliers,
        })
    }

    /// A keyframe as a sharp view: deblurred with its own motion.
    pub(super) fn keyframe_view(
        &mut self,
        MappedFrame { keyframe, state }: &MappedFrame,
        depth_scale: f64,
    ) -> SharpView {
        // What was captured, without the blur of its refined path; as captured where that is not possible.
        let image = keyframe.observation.level(0).frame(keyframe.index, depth_scale);
        let exposure = state.path.stretched(keyframe.observation.level(0).times.exposure).timed(0.0);
        let deblurred = self.deblurrer.deblur(&image, &exposure, &mut self.deblur_memory);
        let rgb = deblurred.map_or_else(|_| image.rgb.clone(), |deblurred| deblurred.rgb);
        SharpView { rgb, depth: image.depth, world_from_camera: exposure.mid, start_from: None }
    }
}
