//! Grey pyramids in linear light.

use arrayvec::ArrayVec;

use super::view::{ColourView, PixelFormat};
use crate::geometry::PinholeCamera;
use crate::photometric::LuminanceTable;
use crate::transfer::LevelImage;
use crate::workspace::{Arena, WorkspaceError, slice_bytes};

/// Upper bound of pyramid levels.
pub const MAX_LEVELS: usize = 6;

/// One level of a pyramid: linear luminance in `[0, 1]`, row-major without padding.
#[derive(Debug)]
pub struct GreyLevel<'m> {
    /// `width * height` intensities.
    pub pixels: &'m mut [f32],
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl GreyLevel<'_> {
    /// The level as the kernels read it.
    #[must_use]
    pub fn image(&self) -> LevelImage<'_> {
        LevelImage { pixels: self.pixels, width: self.width, height: self.height }
    }
}

/// A pyramid of linear luminance: each level is the mean of 2x2 pixels of the one below, never rounded.
#[derive(Debug)]
pub struct GreyPyramid<'m> {
    /// Levels from full resolution to coarse.
    pub levels: ArrayVec<GreyLevel<'m>, MAX_LEVELS>,
}

impl<'m> GreyPyramid<'m> {
    /// Bytes of workspace of a pyramid.
    #[must_use]
    pub const fn bytes(width: usize, height: usize, levels: usize) -> usize {
        let mut sum = 0;
        let mut level = 0;
        while level < levels {
            sum += slice_bytes::<f32>((width >> level) * (height >> level));
            level += 1;
        }
        sum
    }

    /// Takes the memory of a pyramid from `arena`; all intensities are zero.
    ///
    /// # Errors
    /// [`WorkspaceError`] when the arena is exhausted.
    pub fn carve(
        arena: &mut Arena<'m>,
        camera: &PinholeCamera,
        levels: usize,
    ) -> Result<Self, WorkspaceError> {
        let mut pyramid = Self { levels: ArrayVec::new() };
        for level in 0..levels.min(MAX_LEVELS) {
            let (width, height) = (camera.width >> level, camera.height >> level);
            pyramid.levels.push(GreyLevel { pixels: arena.take(width * height)?, width, height });
        }
        Ok(pyramid)
    }

    /// Fills all levels from an encoded image of the size of level 0.
    pub fn fill(&mut self, colour: &ColourView, luminance: &LuminanceTable) {
        let Some(finest) = self.levels.first_mut() else { return };
        for (v, row) in finest.pixels.chunks_exact_mut(finest.width).enumerate() {
            linearise_row(colour.row(v), colour.format(), luminance, row);
        }
        self.reduce();
    }

    /// Recomputes the coarse levels from level 0.
    pub fn reduce(&mut self) {
        for level in 1..self.levels.len() {
            let (fine, coarse) = self.levels.split_at_mut(level);
            let (fine, coarse) = (&fine[level - 1], &mut coarse[0]);
            for (v, row) in coarse.pixels.chunks_exact_mut(coarse.width).enumerate() {
                let top = &fine.pixels[2 * v * fine.width..][..fine.width];
                let bottom = &fine.pixels[(2 * v + 1) * fine.width..][..fine.width];
                halve_row(top, bottom, row);
            }
        }
    }
}

fn linearise_row(encoded: &[u8], format: PixelFormat, luminance: &LuminanceTable, row: &mut [f32]) {
    match format {
        PixelFormat::Grey8 => {
            for (out, &value) in row.iter_mut().zip(encoded) {
                *out = luminance.grey(value);
            }
        }
        PixelFormat::Rgb8 => {
            for (out, rgb) in row.iter_mut().zip(encoded.chunks_exact(3)) {
                *out = luminance.rgb(rgb[0], rgb[1], rgb[2]);
            }
        }
    }
}

fn halve_row(top: &[f32], bottom: &[f32], row: &mut [f32]) {
    for ((out, t), b) in row.iter_mut().zip(top.chunks_exact(2)).zip(bottom.chunks_exact(2)) {
        *out = 0.25 * ((t[0] + t[1]) + (b[0] + b[1]));
    }
}
