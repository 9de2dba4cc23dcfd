//! Work, counted instead of timed.

use core::ops::{Add, AddAssign};

use crate::transfer::PATCH_PIXELS;

/// What the time of a frame depends on, in counts that are the same on every machine and in every run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Linearisations of the objective.
    pub linearisations: u64,
    /// Patches that were predicted, with or without derivatives.
    pub patches: u64,
    /// Pixels of virtual views that the patches were predicted from.
    pub view_pixels: u64,
    /// Points of depth maps that were compared with the keyframe's surface.
    pub depth_points: u64,
    /// Samples of blur paths while keyframes were deblurred.
    pub blur_taps: u64,
    /// Pixels of images that were read whole: the frame, and once more for every keyframe made of it.
    pub image_pixels: u64,
}

impl Work {
    /// Patches of which each is predicted once from `views` views.
    pub(crate) const fn of_patches(patches: usize, views: usize) -> Self {
        let view_pixels = (patches * views * PATCH_PIXELS) as u64;
        Self { patches: patches as u64, view_pixels, ..Self::none() }
    }

    /// Points of a depth map of `width` by `height` of which every `stride`-th is compared in both directions.
    pub(crate) const fn of_depth(width: usize, height: usize, stride: usize) -> Self {
        let depth_points = (width.div_ceil(stride) * height.div_ceil(stride)) as u64;
        Self { depth_points, ..Self::none() }
    }

    /// No work.
    pub(crate) const fn none() -> Self {
        Self { linearisations: 0, patches: 0, view_pixels: 0, depth_points: 0, blur_taps: 0, image_pixels: 0 }
    }

    /// All counts times `factor`.
    pub(crate) const fn times(self, factor: u64) -> Self {
        Self {
            linearisations: self.linearisations.saturating_mul(factor),
            patches: self.patches.saturating_mul(factor),
            view_pixels: self.view_pixels.saturating_mul(factor),
            depth_points: self.depth_points.saturating_mul(factor),
            blur_taps: self.blur_taps.saturating_mul(factor),
            image_pixels: self.image_pixels.saturating_mul(factor),
        }
    }

    /// One number that is roughly proportional to time: the counts in units of a pixel of a virtual view, which
    /// takes a nanosecond or two on a desktop processor. The weights were measured there.
    #[must_use]
    pub const fn units(&self) -> u64 {
        self.view_pixels
            .saturating_add(self.patches.saturating_mul(100))
            .saturating_add(self.depth_points.saturating_mul(24))
            .saturating_add(self.blur_taps / 4)
            .saturating_add(self.image_pixels.saturating_mul(4))
    }

    /// Whether no count exceeds that of `bound`.
    #[must_use]
    pub const fn is_within(&self, bound: &Self) -> bool {
        self.linearisations <= bound.linearisations
            && self.patches <= bound.patches
            && self.view_pixels <= bound.view_pixels
            && self.depth_points <= bound.depth_points
            && self.blur_taps <= bound.blur_taps
            && self.image_pixels <= bound.image_pixels
    }
}

impl Add for Work {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            linearisations: self.linearisations.saturating_add(other.linearisations),
            patches: self.patches.saturating_add(other.patches),
            view_pixels: self.view_pixels.saturating_add(other.view_pixels),
            depth_points: self.depth_points.saturating_add(other.depth_points),
            blur_taps: self.blur_taps.saturating_add(other.blur_taps),
            image_pixels: self.image_pixels.saturating_add(other.image_pixels),
        }
    }
}

impl AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}
