//! Motion-blur-aware RGB-D camera tracking for devices: `no_std`, no heap, one core.
//!
//! A camera moves while its shutter is open, so a frame is the average of many sharp *virtual views* along a
//! short trajectory. This crate estimates, for every RGB-D frame, the camera pose at shutter opening and at
//! shutter closing.
//!
//! # Conventions
//!
//! * Camera frame: x right, y down, z forward. The centre of the top-left pixel is `(0, 0)`.
//! * Poses map camera coordinates into a reference (keyframe or world) frame and are named
//!   `reference_from_camera`: `x_reference = R * x_camera + p`, metres and unit quaternions.
//! * Tangent vectors are `(translation, rotation)`: translation added in the reference frame, rotation
//!   multiplied on the right (camera frame), radians.
//! * Intensities are linear light in `[0, 1]`. Depth is z along the optical axis in metres, not distance.
//! * Exposure time is normalised: `s = 0` at shutter opening, `s = 1` at closing.
//!
//! # Layers
//!
//! A module uses only those to its left: [`math`], [`geometry`], [`trajectory`], [`photometric`], [`image`],
//! [`surface`], [`transfer`], [`keyframe`], [`deblur`], [`align`], [`Tracker`]. Those up to [`transfer`] are a crate of
//! their own, `mba-imaging`.
//!
//! # Use
//!
//! ```
//! use mba_tracker::geometry::PinholeCamera;
//! use mba_tracker::image::{ColourView, DepthView, PixelFormat};
//! use mba_tracker::photometric::InverseResponse;
//! use mba_tracker::{Frame, SimdLevel, Tracker, TrackerConfig};
//!
//! let camera = PinholeCamera { width: 160, height: 120, fx: 125.0, fy: 125.0, cx: 79.5, cy: 59.5 };
//! let config = TrackerConfig::new(camera, 1.0 / 5000.0, InverseResponse::srgb());
//! let mut memory = vec![0; config.workspace_len()]; // or a static array: the length is a const fn
//! let mut tracker = Tracker::new(&config, SimdLevel::baseline(), &mut memory)?;
//!
//! # let (grey, depth) = (vec![128u8; 160 * 120], vec![10_000u16; 160 * 120]);
//! let result = tracker.track(&Frame {
//!     timestamp: 0.0,
//!     exposure: 0.016,
//!     depth_timestamp: 0.0,
//!     colour: ColourView::new(&grey, 160, 120, 160, PixelFormat::Grey8)?,
//!     depth: DepthView::new(&depth, 160, 120, 160)?,
//!     angular_velocity: None,
//!     gyro: None,
//!     expected_path: None,
//! })?;
//! println!("{:?}: opened at {:?}", result.status, result.world_from_camera.start);
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```
//!
//! # Memory
//!
//! The caller owns all of it: [`TrackerConfig::workspace_len`] bytes, handed over once. The crate has no allocator
//! to call, so nothing can be allocated later.
//!
//! # Features
//!
//! * `std` (default): `SimdLevel::new()` asks the operating system for the best instruction set. Without it,
//!   `SimdLevel::baseline()` takes what the target was compiled for.
//! * `capi`: the C functions of `include/mba_tracker.h`; module `capi`.
#![no_std]
#![deny(unsafe_code)]

#[cfg(any(test, feature = "std"))]
extern crate std;

pub mod align;
#[cfg(feature = "capi")]
#[allow(unsafe_code, reason = "pointers from C; every block says why it is sound")]
pub mod capi;
pub mod deblur;
pub mod error;
pub mod keyframe;
mod session;
mod tracker;
mod work;

pub use mba_imaging::{geometry, image, math, photometric, simd, surface, trajectory, transfer, workspace};

/// Instruction sets that the kernels can run on; chosen once, at construction.
pub use fearless_simd::Level as SimdLevel;
pub use session::SessionError;
pub use tracker::{
    Doubt, Effort, ExpectedPath, Frame, FrameResult, FrameStatus, GyroReading, MAX_RECENT_KEYFRAMES, Readout,
    ReferenceMode, ReferenceView, Revision, Tracker, TrackerConfig, WorkspacePlan, workspace_len,
};
pub use work::Work;
