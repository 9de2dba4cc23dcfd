//! Structures of the C interface.

use crate::Tracker;

/// Calibration and settings. Fill it with `mba_config_default` or `mba_config_compact`, then change what you need.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct MbaConfig {
    /// Columns of the images, 32 to 8192.
    pub width: u32,
    /// Rows of the images, 32 to 8192.
    pub height: u32,
    /// Focal length along x in pixels.
    pub fx: f64,
    /// Focal length along y in pixels.
    pub fy: f64,
    /// Column of the principal point; the centre of the top-left pixel is (0, 0).
    pub cx: f64,
    /// Row of the principal point.
    pub cy: f64,
    /// Metres per raw unit of the depth images, e.g. 0.001.
    pub metres_per_unit: f32,
    /// Pyramid levels, 2 to 6.
    pub levels: u32,
    /// Pyramid level of the depth maps, less than `levels`.
    pub surface_level: u32,
    /// Earlier keyframes that a lost tracker looks for, 0 to 4.
    pub recent_keyframes: u32,
    /// Bands of rows that share their virtual views, 1 to 16; counts only where the readout is not 0.
    pub row_bands: u32,
    /// 1 when depth images are taken at times of their own, `MbaFrame.depth_timestamp`; 0 when together with the colour
    /// images.
    pub depth_apart: u32,
    /// Seconds from the first row of a colour image to the last, -0.1 to 0.1; 0 for a global shutter.
    pub readout_seconds: f64,
    /// Seconds from the first row of a depth image to the last, -0.1 to 0.1.
    pub depth_readout_seconds: f64,
    /// Light falls off as `1 + a2 r^2 + a4 r^4`, above 0, with `r` = 1 at the centre of a corner pixel; 0 and 0 for a lens
    /// without fall-off.
    pub vignetting_a2: f64,
    /// See `vignetting_a2`.
    pub vignetting_a4: f64,
    /// `MBA_REFERENCE_*`.
    pub reference: i32,
    /// `MBA_EFFORT_*`.
    pub effort: i32,
    /// Linear light of the 256 byte values, finite, not negative, strictly increasing; null for sRGB. Read by
    /// `mba_tracker_init` only.
    pub response: *const f32,
    /// A clock in ticks of your choice, called before and after a frame; null for none.
    pub clock: Option<extern "C" fn() -> u64>,
}

/// An 8-bit image, undistorted, encoded by the camera's response.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct MbaImage {
    /// First byte of the first row.
    pub data: *const u8,
    /// Readable bytes from there.
    pub size_bytes: usize,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Bytes from one row to the next.
    pub stride_bytes: u32,
    /// `MBA_PIXEL_*`.
    pub format: i32,
}

/// A 16-bit depth image registered to the colour image: z along the optical axis in raw units, 0 where unknown.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct MbaDepth {
    /// First value of the first row, aligned to 2 bytes.
    pub data: *const u16,
    /// Readable bytes from there.
    pub size_bytes: usize,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Bytes from one row to the next, even.
    pub stride_bytes: u32,
}

/// One RGB-D frame.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct MbaFrame {
    /// Mid-exposure time in seconds; with rows that are exposed one after the other, of the middle row.
    pub timestamp: f64,
    /// Exposure time in seconds, of every row.
    pub exposure: f64,
    /// Time of the depth image's middle row in seconds; ignored unless the configuration says `depth_apart`.
    pub depth_timestamp: f64,
    /// Colour or grey image.
    pub image: MbaImage,
    /// Depth image.
    pub depth: MbaDepth,
    /// Three values: mean angular velocity since the frame before, camera frame, rad/s; null without a gyroscope.
    pub angular_velocity: *const f64,
}

/// Maps camera coordinates (x right, y down, z forward) into the world: x_world = R x_camera + translation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct MbaPose {
    /// R as a unit quaternion: x, y, z, w.
    pub rotation: [f64; 4],
    /// Metres.
    pub translation: [f64; 3],
}

/// What is known about a frame after tracking.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct MbaResult {
    /// Running number of the frame, from 0.
    pub index: u64,
    /// Running number of the frame that it was aligned with.
    pub reference_index: u64,
    /// Mid-exposure time, seconds.
    pub timestamp: f64,
    /// `MBA_STATUS_*`.
    pub status: i32,
    /// 1 when the frame became the keyframe, else 0.
    pub is_keyframe: i32,
    /// Pose at shutter opening; the world is the first frame's camera at mid exposure.
    pub world_from_camera_start: MbaPose,
    /// Pose at shutter closing.
    pub world_from_camera_end: MbaPose,
    /// Covariance of the pose at mid exposure, row by row: translation in keyframe axes (m), rotation in the camera
    /// (rad). Zero unless `has_covariance`.
    pub covariance: [f64; 36],
    /// 1 when `covariance` holds values, else 0.
    pub has_covariance: i32,
    /// Linearisations on all levels: the work that the frame took.
    pub iterations: u32,
    /// Mean blur length in pixels.
    pub blur: f32,
    /// Share of the keyframe's patches that are in view and agree.
    pub inliers: f32,
    /// Robust photometric residual in standard deviations of the nominal noise.
    pub residual: f32,
    /// Virtual views on the finest level.
    pub virtual_views: u32,
    /// Ticks of the configured clock that the frame took; 0 without a clock.
    pub ticks: u64,
}

/// A tracker in the caller's memory. C knows its name only; the word that tells it from other memory comes first.
#[derive(Debug)]
#[repr(C)]
pub struct MbaTracker {
    pub(super) magic: u64,
    pub(super) clock: Option<extern "C" fn() -> u64>,
    pub(super) tracker: Tracker<'static>,
}

/// First word of memory that holds a tracker.
pub(super) const MAGIC: u64 = u64::from_le_bytes(*b"mba_trk1");
