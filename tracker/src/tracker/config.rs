//! Configuration and memory plan.

use super::frame::Frame;
use crate::align::AlignSettings;
use crate::deblur::DeblurScratch;
use crate::error::ConfigError;
use crate::geometry::PinholeCamera;
use crate::image::{GreyPyramid, MAX_LEVELS, PixelRectangle};
use crate::keyframe::{Keyframe, MAX_KEYPOINTS, RectifyScratch};
use crate::photometric::{InverseResponse, Vignetting};
use crate::trajectory::FrameTiming;
use crate::transfer::{MAX_BANDS, PatchCost, PatchSite};
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
    /// Fall-off of light over the images; some light reaches every pixel. It does not count for views from outside,
    /// [`super::Tracker::set_reference`].
    pub vignetting: Vignetting,
    /// Pyramid levels, 2 to 6.
    pub levels: usize,
    /// Pyramid level of the depth maps.
    pub surface_level: usize,
    /// Part of the images that holds data; undistortion leaves a border without.
    pub region: PixelRectangle,
    /// Where the sharp reference comes from.
    pub reference: ReferenceMode,
    /// Richardson-Lucy iterations on a keyframe.
    pub deblur_iterations: usize,
    /// Keyframes before the current one that a lost tracker looks for, 0 to [`MAX_RECENT_KEYFRAMES`]. Each takes
    /// memory and, on lost frames only, time.
    pub recent_keyframes: usize,
    /// How the images are read out.
    pub readout: Readout,
    /// Settings of the alignment.
    pub align: AlignSettings,
}

/// How the images are read out: whether all pixels are measured at the same time.
///
/// Row `v` of `h` of a colour image is exposed around `timestamp + ((v + 1/2)/h - 1/2) colour`, a row of a depth image
/// measured at `depth_timestamp + ((v + 1/2)/h - 1/2) depth`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readout {
    /// Time from the first row of the colour image to the last, seconds; negative when the last row comes first, 0 for a
    /// global shutter.
    pub colour: f64,
    /// Time from the first row of the depth image to the last, seconds.
    pub depth: f64,
    /// Whether depth images are taken at another time than colour images, see [`super::Frame::depth_timestamp`].
    pub depth_apart: bool,
    /// Bands of rows that share their virtual views, 1 to [`MAX_BANDS`]. Eight leave less than a hundredth of a pixel.
    pub bands: usize,
}

impl Readout {
    /// Everything at the same time.
    pub const GLOBAL: Self = Self { colour: 0.0, depth: 0.0, depth_apart: false, bands: 8 };

    /// Whether the colour image has rows of its own times.
    #[must_use]
    pub const fn colour_rolls(&self) -> bool {
        self.colour != 0.0
    }

    /// Whether depth has another time than the middle of the colour image, anywhere.
    #[must_use]
    pub const fn depth_is_apart(&self) -> bool {
        self.depth_apart || self.depth != 0.0
    }

    /// The timing of a frame and the seconds that its path spans: long enough for every row and the depth image.
    pub(super) fn timing(&self, frame: &Frame) -> (FrameTiming, f64) {
        let apart = if self.depth_apart { frame.depth_timestamp - frame.timestamp } else { 0.0 };
        let of_depth = 2.0 * apart.abs() + self.depth.abs();
        let span = (frame.exposure + self.colour.abs()).max(of_depth);
        if span == frame.exposure && apart == 0.0 && self.depth == 0.0 {
            return (FrameTiming::GLOBAL, span);
        }
        let timing = FrameTiming {
            exposure: frame.exposure / span,
            readout: self.colour / span,
            bands: self.bands,
            depth_time: apart / span,
            depth_readout: self.depth / span,
        };
        (timing, span)
    }
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
            vignetting: Vignetting::NONE,
            levels,
            surface_level,
            region: PixelRectangle { left: 0, top: 0, right: camera.width, bottom: camera.height },
            reference: ReferenceMode::Deblurred,
            deblur_iterations: 4,
            recent_keyframes: MAX_RECENT_KEYFRAMES,
            readout: Readout::GLOBAL,
            align: AlignSettings::default(),
        }
    }

    /// The defaults for devices with less memory than a phone: depth maps of half the resolution at the least, keyframes
    /// as captured, no search among earlier ones. Takes 374 KB for 160x120 and 1.34 MB for 320x240 pixels.
    #[must_use]
    pub fn compact(camera: PinholeCamera, metres_per_unit: f32, response: InverseResponse) -> Self {
        let config = Self::new(camera, metres_per_unit, response);
        Self {
            surface_level: config.surface_level.max(1),
            reference: ReferenceMode::Raw,
            recent_keyframes: 0,
            ..config
        }
    }

    /// The same configuration with accuracy traded for time; [`Effort::Full`] changes nothing.
    #[must_use]
    pub fn with_effort(self, effort: Effort) -> Self {
        let (max_iterations, max_views, view_spacing, deblur_iterations) = match effort {
            Effort::Full => return self,
            Effort::Medium => (5, 16, 2.5, 3),
            Effort::Low => (3, 8, 4.0, 2),
        };
        let align = AlignSettings {
            max_iterations: max_iterations.min(self.align.max_iterations),
            max_views: max_views.min(self.align.max_views),
            view_spacing: self.align.view_spacing.max(view_spacing),
            ..self.align
        };
        Self { deblur_iterations: deblur_iterations.min(self.deblur_iterations), align, ..self }
    }

    /// Checks every setting.
    ///
    /// # Errors
    /// [`ConfigError::Setting`] naming the first setting outside its range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let c = &self.camera;
        let readout = &self.readout;
        let size = 32..=8192usize;
        let coarsest = self.levels.saturating_sub(1).min(16);
        let smallest = (c.width >> coarsest).min(c.height >> coarsest);
        let scale = f64::from(self.metres_per_unit);
        let least_light = self.vignetting.least();
        let checks = [
            ("width", c.width as f64, size.contains(&c.width), "32 to 8192 pixels"),
            ("height", c.height as f64, size.contains(&c.height), "32 to 8192 pixels"),
            ("fx", c.fx, c.fx > 1.0 && c.fx < 1e5, "1 to 100000 pixels"),
            ("fy", c.fy, c.fy > 1.0 && c.fy < 1e5, "1 to 100000 pixels"),
            ("cx", c.cx, c.cx.abs() < 1e5, "a pixel column"),
            ("cy", c.cy, c.cy.abs() < 1e5, "a pixel row"),
            ("region", self.region.right as f64, self.region.right <= c.width, "columns of the image"),
            ("region", self.region.bottom as f64, self.region.bottom <= c.height, "rows of the image"),
            ("metres_per_unit", scale, scale > 0.0 && scale < 1.0, "above 0 and below 1 metre"),
            ("vignetting", least_light, least_light > 0.0, "above 0 everywhere in the image"),
            ("levels", self.levels as f64, (2..=MAX_LEVELS).contains(&self.levels), "2 to 6"),
            ("levels", self.levels as f64, smallest >= 16, "at least 16 pixels on the coarsest level"),
            (
                "surface_level",
                self.surface_level as f64,
                self.surface_level < self.levels,
                "less than the number of levels",
            ),
            ("readout.colour", readout.colour, readout.colour.abs() <= 0.1, "-0.1 to 0.1 seconds"),
            ("readout.depth", readout.depth, readout.depth.abs() <= 0.1, "-0.1 to 0.1 seconds"),
            ("readout.bands", readout.bands as f64, (1..=MAX_BANDS).contains(&readout.bands), "1 to 16"),
            (
                "recent_keyframes",
                self.recent_keyframes as f64,
                self.recent_keyframes <= MAX_RECENT_KEYFRAMES,
                "0 to 4",
            ),
        ];
        match checks.into_iter().find(|check| !check.2) {
            Some((name, value, _, expected)) => Err(ConfigError::Setting { name, value, expected }),
            None => Ok(()),
        }
    }

    /// Bytes of memory that a tracker with this configuration needs.
    #[must_use]
    pub const fn workspace_len(&self) -> usize {
        WorkspacePlan {
            width: self.camera.width,
            height: self.camera.height,
            levels: self.levels,
            surface_level: self.surface_level,
            recent_keyframes: self.recent_keyframes,
            deblur: matches!(self.reference, ReferenceMode::Deblurred),
            rolling: self.readout.colour_rolls(),
            depth_apart: self.readout.depth_is_apart(),
        }
        .bytes()
    }
}

/// How much time a frame may take, see [`TrackerConfig::with_effort`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Effort {
    /// As accurate as can be.
    #[default]
    Full,
    /// At most 5 linearisations per level and 16 virtual views.
    Medium,
    /// At most 3 linearisations per level and 8 virtual views.
    Low,
}

/// Upper bound of the keyframes before the current one that a lost tracker looks for.
pub const MAX_RECENT_KEYFRAMES: usize = 4;

/// Upper bound of the residuals that a robust scale is computed from.
pub(super) const SCALE_SAMPLES: usize = 4096;

/// What the size of a tracker's memory depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WorkspacePlan {
    /// Columns of the images.
    pub width: usize,
    /// Rows of the images.
    pub height: usize,
    /// Pyramid levels.
    pub levels: usize,
    /// Pyramid level of the depth maps, less than `levels`.
    pub surface_level: usize,
    /// Keyframes before the current one that a lost tracker looks for.
    pub recent_keyframes: usize,
    /// Whether keyframes are deblurred.
    pub deblur: bool,
    /// Whether the rows of colour images are exposed one after the other.
    pub rolling: bool,
    /// Whether depth images are taken at another time than colour images, or have rows of different times.
    pub depth_apart: bool,
}

impl WorkspacePlan {
    /// Bytes of memory. Known at compile time, so that the memory can be a static array.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        let Self { width, height, levels, surface_level, .. } = *self;
        let (surface_width, surface_height) = (width >> surface_level, height >> surface_level);
        let current =
            GreyPyramid::bytes(width, height, levels) + slice_bytes::<f32>(surface_width * surface_height);
        let recent = Keyframe::bytes(surface_width, surface_height, levels - surface_level, 0);
        let scratch = slice_bytes::<PatchSite>(MAX_KEYPOINTS)
            + slice_bytes::<PatchCost>(MAX_KEYPOINTS)
            + slice_bytes::<f32>(SCALE_SAMPLES);
        ARENA_ALIGNMENT
            + current
            + Keyframe::bytes(width, height, levels, surface_level)
            + self.recent_keyframes * recent
            + scratch
            + if self.deblur { DeblurScratch::bytes(width, height) } else { 0 }
            + RectifyScratch::bytes(width, height, surface_level, self.rolling, self.depth_apart)
    }
}

/// Bytes of memory that a tracker with the defaults of [`TrackerConfig::new`] needs for images of `width` by `height`
/// pixels, `levels` pyramid levels and depth maps on level `surface_level`.
#[must_use]
pub const fn workspace_len(width: usize, height: usize, levels: usize, surface_level: usize) -> usize {
    let recent_keyframes = MAX_RECENT_KEYFRAMES;
    WorkspacePlan {
        width,
        height,
        levels,
        surface_level,
        recent_keyframes,
        deblur: true,
        rolling: false,
        depth_apart: false,
    }
    .bytes()
}
