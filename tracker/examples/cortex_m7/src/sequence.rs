//! The frames and their tracking, the same on every machine.

use core::fmt;

use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::image::{ColourView, DepthView, PixelFormat};
use mba_tracker::photometric::InverseResponse;
use mba_tracker::{Frame, FrameResult, FrameStatus, SimdLevel, Tracker, TrackerConfig, WorkspacePlan};

const CAMERA: PinholeCamera =
    PinholeCamera { width: 160, height: 120, fx: 140.0, fy: 140.0, cx: 79.5, cy: 59.5 };
const PIXELS: usize = CAMERA.width * CAMERA.height;

/// Bytes that the tracker works in: the plan of [`TrackerConfig::compact`] for this camera.
pub const MEMORY: usize = WorkspacePlan {
    width: CAMERA.width,
    height: CAMERA.height,
    levels: 3,
    surface_level: 1,
    recent_keyframes: 0,
    deblur: false,
    rolling: false,
    depth_apart: false,
}
.bytes();

static GREY: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/frames.grey"));
/// Millimetres to the wall.
static DEPTH: [u16; PIXELS] = [2000; PIXELS];

/// One line of output.
pub struct Line<'a>(&'a FrameResult);

impl fmt::Display for Line<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "frame {} {}", self.0.index, self.0.status.name())?;
        write_pose(f, &self.0.world_from_camera.start)?;
        write_pose(f, &self.0.world_from_camera.end)
    }
}

fn write_pose(f: &mut fmt::Formatter<'_>, pose: &RigidTransform) -> fmt::Result {
    let (p, q) = (&pose.translation, &pose.rotation.coords);
    write!(f, " {:.7} {:.7} {:.7} {:.7} {:.7} {:.7} {:.7}", p.x, p.y, p.z, q.x, q.y, q.z, q.w)
}

/// Tracks all frames; `false` if a frame was lost or anything refused.
pub fn track(memory: &mut [u8], mut print: impl FnMut(Line)) -> bool {
    let config = TrackerConfig::compact(CAMERA, 0.001, InverseResponse::linear());
    let Ok(mut tracker) = Tracker::new(&config, SimdLevel::baseline(), memory) else { return false };
    let mut tracked = true;
    for (k, grey) in GREY.chunks_exact(PIXELS).enumerate() {
        let colour = ColourView::new(grey, CAMERA.width, CAMERA.height, CAMERA.width, PixelFormat::Grey8);
        let depth = DepthView::new(&DEPTH, CAMERA.width, CAMERA.height, CAMERA.width);
        let (Ok(colour), Ok(depth)) = (colour, depth) else { return false };
        let timestamp = k as f64 / 30.0;
        let frame = Frame { timestamp, exposure: 0.5 / 30.0, depth_timestamp: timestamp, colour, depth, angular_velocity: None, gyro: None, expected_path: None };
        let Ok(result) = tracker.track(&frame) else { return false };
        tracked &= result.status != FrameStatus::Lost;
        print(Line(&result));
    }
    tracked
}
