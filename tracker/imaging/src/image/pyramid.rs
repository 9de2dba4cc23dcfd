//! Grey pyramids in linear light.

use arrayvec::ArrayVec;

use super::view::{ColourView, PixelFormat};
use crate::geometry::PinholeCamera;
use crate::photometric::{LuminanceTable, Vignetting};
use crate::workspace::{Arena, WorkspaceError, slice_bytes};

/// Upper bound of pyramid levels.
pub const MAX_LEVELS: usize = 6;

/// One level of an image pyramid: linear intensities in `[0, 1]`, row-major without padding; at least 2x2 and at
/// most 2^24 pixels.
#[derive(Clone, Copy, Debug)]
pub struct LevelImage<'a> {
    /// `width * height` intensities.
    pub pixels: &'a [f32],
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

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
    #[inline]
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

    /// Fills all levels from an encoded image of the size of level 0, with the light that `vignetting` took given back.
    pub fn fill(&mut self, colour: &ColourView, luminance: &LuminanceTable, vignetting: &Vignetting) {
        let Some(finest) = self.levels.first_mut() else { return };
        for (v, row) in finest.pixels.chunks_exact_mut(finest.width).enumerate() {
            linearise_row(colour.row(v), colour.format(), luminance, row);
            if !vignetting.is_none() {
                vignetting.restore_row(row, v, finest.height);
            }
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

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::*;
    use crate::photometric::InverseResponse;

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 48, height: 32, fx: 40.0, fy: 41.0, cx: 23.0, cy: 16.5 };

    #[test]
    fn every_level_keeps_the_mean_and_the_position_of_a_ramp() {
        let mut memory = vec![0; GreyPyramid::bytes(48, 32, 4) + 64];
        let mut pyramid = GreyPyramid::carve(&mut Arena::new(&mut memory), &CAMERA, 4).expect("memory");
        let bytes: Vec<u8> = (0..48 * 32).map(|k| (3 * (k % 48) + 2 * (k / 48)) as u8).collect();
        let view = ColourView::new(&bytes, 48, 32, 48, PixelFormat::Grey8).expect("a view");
        pyramid.fill(&view, &LuminanceTable::new(&InverseResponse::linear()), &Vignetting::NONE);
        for (level, image) in pyramid.levels.iter().enumerate() {
            // A ramp is linear in the image, so its block mean is its value at the block's centre.
            for (k, light) in image.pixels.iter().enumerate() {
                let fine = |x: usize| PinholeCamera::pixel_at_level(x as f32, level, 0);
                let expected = (3.0 * fine(k % image.width) + 2.0 * fine(k / image.width)) / 255.0;
                assert!((light - expected).abs() < 1e-6, "level {level}, pixel {k}: {light} not {expected}");
            }
        }
    }

    #[test]
    fn a_point_keeps_its_ray_on_every_level() {
        for level in 0..4 {
            let coarse = CAMERA.at_level(level);
            let at = |x: f32| f64::from(PinholeCamera::pixel_at_level(x, 0, level));
            let difference = coarse.ray(at(7.0), at(21.0)) - CAMERA.ray(7.0, 21.0);
            assert!(difference.norm() < 1e-7, "level {level}: {difference:?}");
        }
    }

    #[test]
    fn colour_rows_may_be_padded() {
        let mut memory = vec![0; GreyPyramid::bytes(2, 2, 1) + 64];
        let camera = PinholeCamera { width: 2, height: 2, ..CAMERA };
        let mut pyramid = GreyPyramid::carve(&mut Arena::new(&mut memory), &camera, 1).expect("memory");
        let bytes = [255, 255, 255, 0, 0, 0, 9, 9, 0, 255, 0, 255, 0, 0];
        let view = ColourView::new(&bytes, 2, 2, 8, PixelFormat::Rgb8).expect("a view");
        pyramid.fill(&view, &LuminanceTable::new(&InverseResponse::linear()), &Vignetting::NONE);
        for (light, expected) in pyramid.levels[0].pixels.iter().zip([1.0, 0.0, 0.7152, 0.2126]) {
            assert!((light - expected).abs() < 1e-6);
        }
    }
}
