//! A static library that tracks frames as a device would: no std, no allocator, all memory from the caller.
//!
//! `.ci/no_std` builds it and looks for allocator symbols in what was linked. It is never run: the tests of the
//! workspace do that with the same code.
#![no_std]

use core::panic::PanicInfo;

use mba_tracker::geometry::PinholeCamera;
use mba_tracker::image::{ColourView, DepthView, PixelFormat};
use mba_tracker::photometric::InverseResponse;
use mba_tracker::{Frame, FrameStatus, SimdLevel, Tracker, TrackerConfig, workspace_len};

const CAMERA: PinholeCamera =
    PinholeCamera { width: 160, height: 120, fx: 140.0, fy: 140.0, cx: 79.5, cy: 59.5 };
const PIXELS: usize = CAMERA.width * CAMERA.height;

/// Known at compile time, so that a device can reserve it in a static array.
const MEMORY: usize = workspace_len(CAMERA.width, CAMERA.height, 3, 0);

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    loop {}
}

/// Tracks one image repeatedly; returns the number of frames that were lost, or -1 for a wrong configuration.
// SAFETY: no other symbol of this name is linked.
#[unsafe(no_mangle)]
pub extern "C" fn mba_probe(
    memory: &mut [u8; MEMORY],
    grey: &[u8; PIXELS],
    depth: &[u16; PIXELS],
    frames: u32,
) -> i32 {
    let config = TrackerConfig::new(CAMERA, 0.001, InverseResponse::srgb());
    let Ok(mut tracker) = Tracker::new(&config, SimdLevel::baseline(), memory) else { return -1 };
    let (Ok(colour), Ok(depth)) = (
        ColourView::new(grey, CAMERA.width, CAMERA.height, CAMERA.width, PixelFormat::Grey8),
        DepthView::new(depth, CAMERA.width, CAMERA.height, CAMERA.width),
    ) else {
        return -1;
    };
    let mut lost = 0;
    for k in 0..frames {
        let timestamp = f64::from(k) / 30.0;
        let frame = Frame {
            timestamp,
            exposure: 0.01,
            depth_timestamp: timestamp,
            colour,
            depth,
            angular_velocity: None,
            gyro: None,
            expected_path: None,
        };
        let tracked = tracker.track(&frame).is_ok_and(|result| result.status != FrameStatus::Lost);
        lost += i32::from(!tracked);
    }
    lost
}
