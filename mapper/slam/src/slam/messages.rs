//! What tracker and mapper say to each other. All queues are bounded.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use mba_io::dataset::RgbdFrame;
use mba_io::trajectory_file::TimedExposure;
use mba_tracker::ReferenceView;
use mba_tracker::error::FrameError as TrackError;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::image::{ColourView, DepthView, PixelFormat};

use super::tracker_state::TrackerState;
use crate::run::FrameRecord;

/// Frames that the tracker is ahead of its instructions in lock step: while the mapper works on one frame, the next is
/// tracked.
pub(super) const AHEAD: usize = 2;

/// Frames that wait for the mapper at the most; the tracker waits for a place when there are more.
const WAITING_FRAMES: usize = 4;

/// From the tracker, one per frame of the data set, in order.
#[derive(Debug)]
pub(super) struct TrackedFrame {
    /// Index in the data set.
    pub(super) index: usize,
    /// Poses in the world that the tracker had then.
    pub(super) exposure: TimedExposure,
    pub(super) record: FrameRecord,
    /// Moves of the world that the tracker had made by then.
    pub(super) moves: usize,
    /// The frame itself, unless it was skipped.
    pub(super) image: Option<RgbdFrame>,
    pub(super) skipped: Option<Skipped>,
    /// Index, exposure and blur in pixels of an earlier frame of which more is known now.
    pub(super) revision: Option<(usize, TimedExposure, f64)>,
    /// How far picture and depth contradict each other, if the frame was tracked.
    pub(super) disagreement: Option<f64>,
    /// What the tracker's thread knows after this frame, in lock step.
    pub(super) knows: Option<TrackerState>,
}

/// Why a frame was not tracked.
#[derive(Debug)]
pub(super) enum Skipped {
    /// The next one was there already.
    Late,
    /// It cannot be read or used.
    Unusable(String),
}

/// To the tracker, one after each frame.
#[derive(Debug, Default)]
pub(super) struct Instruction {
    /// The world has changed: `new_world_from_world`.
    pub(super) world_move: Option<RigidTransform>,
    /// What the next frames are compared with.
    pub(super) reference: Option<SharpView>,
    /// Memory of a [`TrackerState`] that is not needed any more.
    pub(super) spent: Vec<u8>,
}

/// A sharp view of the map.
#[derive(Debug)]
pub(crate) struct SharpView {
    /// Red, green, blue of each pixel as the camera would have stored them, row by row.
    pub(crate) rgb: Vec<u8>,
    /// Depth in the data set's raw units, 0 where it is not known.
    pub(crate) depth: Vec<u16>,
    pub(crate) world_from_camera: RigidTransform,
    /// The tracker is lost and is to start again near this view, from that pose.
    pub(crate) start_from: Option<RigidTransform>,
}

impl SharpView {
    /// The view as the tracker takes it.
    pub(crate) fn reference(&self, camera: &PinholeCamera) -> Result<ReferenceView<'_>, TrackError> {
        let PinholeCamera { width, height, .. } = *camera;
        Ok(ReferenceView {
            colour: ColourView::new(&self.rgb, width, height, 3 * width, PixelFormat::Rgb8)?,
            depth: DepthView::new(&self.depth, width, height, width)?,
            world_from_camera: self.world_from_camera,
        })
    }
}

/// The tracker's ends of the two queues.
pub(super) struct TrackerLink {
    pub(super) frames: SyncSender<TrackedFrame>,
    pub(super) instructions: Receiver<Instruction>,
}

/// The mapper's ends of the two queues.
pub(super) struct MapperLink {
    pub(super) frames: Receiver<TrackedFrame>,
    pub(super) instructions: SyncSender<Instruction>,
}

/// Both queues. The mapper never waits for a place: between two looks of the tracker at its instructions it can have
/// taken the waiting frames and the one that the tracker was handing over.
pub(super) fn link() -> (TrackerLink, MapperLink) {
    let (to_mapper, frames) = sync_channel(WAITING_FRAMES);
    let (to_tracker, instructions) = sync_channel(WAITING_FRAMES + 2);
    (TrackerLink { frames: to_mapper, instructions }, MapperLink { frames, instructions: to_tracker })
}
