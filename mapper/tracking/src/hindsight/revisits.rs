//! Places that the camera came back to: they tie the end of a long way to its beginning.

use mba_adjust::deblurring::{DeblurMemory, KeyframeDeblurrer};
use mba_adjust::places::{PlaceDescriptor, PlaceIndex};
use mba_adjust::pose_graph::PoseGraphEdge;
use mba_io::dataset::{Dataset, RgbdFrame};
use mba_io::trajectory_file::TimedExposure;
use mba_tracker::error::FrameError;
use mba_tracker::geometry::RigidTransform;
use mba_tracker::image::{ColourView, DepthView, PixelFormat};
use mba_tracker::{FrameStatus, ReferenceView, SimdLevel, Tracker, TrackerConfig};

use super::joined;
use crate::tracking::{Measured, tracker_view};
use crate::uncertainty::sigma_of;

/// Keyframes before one that it does not come back to: they are seen all the way.
const RECENT: usize = 12;

/// Similarity from which a keyframe is worth a look, and how many are looked at.
const MIN_SIMILARITY: f32 = 0.7;
const MOST_CANDIDATES: usize = 3;

/// Share of a place's patches that have to agree for it to be recognised.
const MIN_INLIERS: f32 = 0.35;

/// Keyframes that are passed over after one that was recognised: its neighbours would say the same.
const PAUSE: usize = 2;

/// What `keyframes`, indices in the data set in ascending order, measure of places that were seen long before. `exposures` are
/// those of all frames, as far as they are known by now. Any of it may be a mistake.
///
/// Frames that cannot be read are passed over.
pub(super) fn revisits(
    dataset: &Dataset,
    config: &TrackerConfig,
    keyframes: &[usize],
    exposures: &[TimedExposure],
) -> Vec<PoseGraphEdge> {
    let mut aligner = Aligner::new(config, dataset.simd());
    let mut places = PlaceIndex::default();
    let (mut edges, mut pause) = (Vec::new(), 0_usize);
    for (k, &now) in keyframes.iter().enumerate() {
        let Ok(image) = dataset.frame(now) else { continue };
        let Ok(descriptor) = PlaceDescriptor::new(&image.rgb, &config.camera) else { continue };
        if pause > 0 {
            pause -= 1;
        } else if let Some(first_recent) = k.checked_sub(RECENT) {
            let is_old = |id: usize| id < keyframes[first_recent];
            let candidates = places.candidates(&descriptor, MOST_CANDIDATES, MIN_SIMILARITY, is_old);
            let found = candidates.into_iter().find_map(|candidate| {
                let place = dataset.frame(candidate.id).ok()?;
                let view = &exposures[candidate.id];
                // From where the run has it, and from where it looks like the place.
                let guesses = [exposures[now].mid, view.mid.compose(&candidate.stored_from_query)];
                aligner.edge(&image, (&place, view), guesses)
            });
            if found.is_some() {
                pause = PAUSE;
            }
            edges.extend(found);
        }
        places.push(now, descriptor);
    }
    edges
}

/// A tracker that starts anew for every pair of frames.
struct Aligner<'a> {
    config: &'a TrackerConfig,
    simd: SimdLevel,
    memory: Vec<u8>,
    deblurrer: KeyframeDeblurrer,
    deblur_memory: DeblurMemory,
}

impl<'a> Aligner<'a> {
    fn new(config: &'a TrackerConfig, simd: SimdLevel) -> Self {
        let deblurrer = KeyframeDeblurrer::new(config, simd);
        let deblur_memory = deblurrer.memory();
        Self { memory: vec![0; config.workspace_len()], config, simd, deblurrer, deblur_memory }
    }

    /// The motion from a place, a frame with its exposure, to another frame; `None` if they do not fit from any of the guesses
    /// of the other frame's pose.
    fn edge(
        &mut self,
        image: &RgbdFrame,
        (place, exposure): (&RgbdFrame, &TimedExposure),
        guesses: [RigidTransform; 2],
    ) -> Option<PoseGraphEdge> {
        let deblurred = self.deblurrer.deblur(place, exposure, &mut self.deblur_memory);
        let rgb = deblurred.map_or_else(|_| place.rgb.clone(), |deblurred| deblurred.rgb);
        let (width, height) = (place.width, place.height);
        guesses.iter().find_map(|guess| {
            let mut tracker = Tracker::new(self.config, self.simd, &mut self.memory).ok()?;
            let align = || -> Result<_, FrameError> {
                let view = ReferenceView {
                    colour: ColourView::new(&rgb, width, height, 3 * width, PixelFormat::Rgb8)?,
                    depth: DepthView::new(&place.depth, width, height, width)?,
                    world_from_camera: exposure.mid,
                };
                tracker.relocate(&view, guess)?;
                tracker.track(&tracker_view(image)?)
            };
            let result = { align }().ok()?;
            let is_recognised = result.status == FrameStatus::Ok && result.inliers > MIN_INLIERS;
            let measured = Measured { reference: place.index, sigma: sigma_of(&result)? };
            let pose = |frame: usize| if frame == place.index { exposure.mid } else { result.world_from_mid };
            is_recognised.then(|| joined::edge(image.index, &measured, pose, 1.0, true)).flatten()
        })
    }
}
