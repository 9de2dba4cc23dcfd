//! Configuration and memory plan.

use crate::align::AlignSettings;
use crate::deblur::DeblurScratch;
use crate::error::ConfigError;
use crate::geometry::PinholeCamera;
use crate::image::{GreyPyramid, MAX_LEVELS};
use crate::keyframe::{Keyframe, MAX_KEYPOINTS};
use crate::photometric::InverseResponse;
use crate::transfer::{PatchCost, PatchSite};
use crate::workspace::{ARENA_ALIGNMENT, slice_bytes};

/// Where the sharp reference comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReferenceMode {
    /// The keyframe's image as captured.
    Raw,
    /// The keyframe's image deblurred with its own estimated motion.
    Deblurred,
}

/// Everything that is fixed for the life of a tracker.
#[derive(Clone, Debug)]
pub struct TrackerConfig {
    /// Intrinsics of the undistorted images.
    pub camera: PinholeCamera,
    /// Metres per raw unit of the depth images.
    pub metres_per_unit: f32,
    /// Inverse response of the camera.
    pub response: InverseResponse,
    /// Pyramid levels, 2 to 6.
    pub levels: usize,
    /// Pyramid level of the depth term's maps.
    pub surface_level: usize,
    /// Where the sharp reference comes from.
    pub reference: ReferenceMode,
    /// Settings of the alignment.
    pub align: AlignSettings,
    /// Richardson-Lucy iterations on a keyframe.
    pub deblur_iterations: usize,
    /// debug
    pub debug: Option<fn(usize, &[f32], &[f32])>,
    /// Whether the first guess may be changed by trying several motions on the coarse levels.
    pub hypotheses: bool,
}

impl TrackerConfig {
    /// The defaults for a camera: as many levels as leave at least 30 rows, depth maps of at least 100 columns.
    #[must_use]
    pub fn new(camera: PinholeCamera, metres_per_unit: f32, response: InverseResponse) -> Self {
        let mut levels = 2;
        while levels < 5 && camera.height >> levels >= 30 {
            levels += 1;
        }
        let mut surface_level = 0;
        while surface_level + 1 < levels && camera.width >> (surface_level + 1) >= 100 {
            surface_level += 1;
        }
        Self {
            camera,
            metres_per_unit,
            response,
            levels,
            surface_level,
            reference: ReferenceMode::Deblurred,
            align: AlignSettings::default(),
            deblur_iterations: 5,
            debug: None,
            hypotheses: true,
        }
    }

    /// Checks every setting.
    ///
    /// # Errors
    /// [`ConfigError::Setting`] naming the first setting outside its range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let c = &self.camera;
        let checks = [
            ("width", c.width as f64, (32.0..=8192.0).contains(&(c.width as f64)), "32 to 8192 pixels"),
            ("height", c.height as f64, (32.0..=8192.0).contains(&(c.height as f64)), "32 to 8192 pixels"),
            ("fx", c.fx, c.fx > 1.0 && c.fx < 1e5, "1 to 100000 pixels"),
            ("fy", c.fy, c.fy > 1.0 && c.fy < 1e5, "1 to 100000 pixels"),
            ("cx", c.cx, c.cx.abs() < 1e5, "a pixel column"),
            ("cy", c.cy, c.cy.abs() < 1e5, "a pixel row"),
            (
                "metres_per_unit",
                f64::from(self.metres_per_unit),
                self.metres_per_unit > 0.0 && self.metres_per_unit < 1.0,
                "above 0 and below 1 metre",
            ),
            ("levels", self.levels as f64, (2..=MAX_LEVELS).contains(&self.levels), "2 to 6"),
            (
                "surface_level",
                self.surface_level as f64,
                self.surface_level < self.levels,
                "less than the number of levels",
            ),
        ];
        for (name, value, good, expected) in checks {
            if !good {
                return Err(ConfigError::Setting { name, value, expected });
            }
        }
        if c.width >> (self.levels - 1) < 16 || c.height >> (self.levels - 1) < 16 {
            return Err(ConfigError::Setting {
                name: "levels",
                value: self.levels as f64,
                expected: "at least 16 pixels on the coarsest level",
            });
        }
        Ok(())
    }
}

/// Bytes of memory that a tracker for images of this size needs.
#[must_use]
pub const fn workspace_len(width: usize, height: usize, levels: usize, surface_level: usize) -> usize {
    let mut pyramid = 0;
    let mut level = 0;
    while level < levels {
        pyramid += slice_bytes::<f32>(GreyPyramid::len(width, height, level, level + 1));
        level += 1;
    }
    let surface = (width >> surface_level) * (height >> surface_level);
    let frame = pyramid + slice_bytes::<f32>(surface);
    let scratch = slice_bytes::<PatchSite>(MAX_KEYPOINTS)
        + slice_bytes::<PatchCost>(MAX_KEYPOINTS)
        + slice_bytes::<f32>(SCALE_SAMPLES);
    ARENA_ALIGNMENT
        + frame
        + Keyframe::bytes(width, height, levels, surface_level)
        + scratch
        + DeblurScratch::bytes(width, height)
}

/// Upper bound of the residuals that a robust scale is computed from.
pub(super) const SCALE_SAMPLES: usize = 4096;
