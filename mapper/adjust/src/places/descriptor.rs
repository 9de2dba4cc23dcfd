//! A view as a small blurry image.

use mba_tracker::geometry::PinholeCamera;

/// Columns of a thumbnail; one is about 3 degrees wide.
const COLUMNS: usize = 20;

/// Structure that is kept, as standard deviations of Gaussians in thumbnail pixels: finer structure is blurred away as a
/// moving camera might have done, coarser is left to lamps and windows.
const FINEST: f32 = 0.8;
const COARSEST: f32 = 4.0;

/// An image cannot be described.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PlaceError {
    /// The image does not have three bytes for each pixel of the camera.
    #[error("{got} bytes are not the {expected} of an RGB image of {width} x {height} pixels")]
    Length {
        /// Bytes of the image.
        got: usize,
        /// Bytes it should have.
        expected: usize,
        /// Width of the camera's images in pixels.
        width: usize,
        /// Height of the camera's images in pixels.
        height: usize,
    },
    /// The image is smaller than a thumbnail.
    #[error("an image of {width} x {height} pixels is too small to recognise a place by")]
    TooSmall {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
}

/// What a place looks like from a view: a thumbnail of 20 columns without its fine and its very coarse structure.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaceDescriptor {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Of zero mean and unit norm, or all zero for an image without structure.
    pub(super) values: Vec<f32>,
    /// Focal lengths along x and y, thumbnail pixels.
    pub(super) focal: [f64; 2],
}

impl PlaceDescriptor {
    /// Describes an image of `camera`: bytes R, G, B per pixel, row by row, in any response.
    ///
    /// # Errors
    /// [`PlaceError`] when the image does not have the camera's size or is narrower than a thumbnail.
    pub fn new(rgb: &[u8], camera: &PinholeCamera) -> Result<Self, PlaceError> {
        let (image_width, image_height) = (camera.width, camera.height);
        let expected = image_width.saturating_mul(image_height).saturating_mul(3);
        if rgb.len() != expected {
            return Err(PlaceError::Length {
                got: rgb.len(),
                expected,
                width: image_width,
                height: image_height,
            });
        }
        // The thumbnail has the shape of the image, and blur no place in it.
        let height = (COLUMNS * image_height).div_ceil(image_width.max(1));
        if image_width < COLUMNS || image_height < height || height < COLUMNS / 4 {
            return Err(PlaceError::TooSmall { width: image_width, height: image_height });
        }
        let size = [COLUMNS, height];
        let thumbnail = shrunk(rgb, [image_width, image_height], size);
        // A band of frequencies: differences of two blurs know neither brightness nor pixels.
        let (fine, coarse) = (blurred(&thumbnail, size, FINEST), blurred(&thumbnail, size, COARSEST));
        let values = normalised(fine.iter().zip(&coarse).map(|(fine, coarse)| fine - coarse).collect());
        let scale = |size: usize, image_size: usize| size as f64 / image_size as f64;
        // Focal lengths of the thumbnail, for the turn between two of them.
        let focal = [camera.fx * scale(COLUMNS, image_width), camera.fy * scale(height, image_height)];
        Ok(Self { width: COLUMNS, height, values, focal })
    }
}

/// Mean brightness over each of `size` equal parts of an image.
fn shrunk(rgb: &[u8], image_size: [usize; 2], size: [usize; 2]) -> Vec<f32> {
    let part = |index: usize, axis: usize| {
        index * image_size[axis] / size[axis]..(index + 1) * image_size[axis] / size[axis]
    };
    let mut values = Vec::with_capacity(size[0] * size[1]);
    for row in 0..size[1] {
        for column in 0..size[0] {
            let (rows, columns) = (part(row, 1), part(column, 0));
            let count = (rows.len() * columns.len()).max(1);
            let line = |y: usize| &rgb[3 * (y * image_size[0] + columns.start)..][..3 * columns.len()];
            let sum: u64 = rows.map(|y| line(y).iter().map(|&byte| u64::from(byte)).sum::<u64>()).sum();
            values.push(sum as f32 / (3 * count) as f32);
        }
    }
    values
}

/// Gaussian mean; weights outside the image are left out.
fn blurred(values: &[f32], [width, height]: [usize; 2], sigma: f32) -> Vec<f32> {
    let reach = (3.0 * sigma).ceil() as usize;
    let weight = |distance: usize| (-0.5 * (distance as f32 / sigma).powi(2)).exp();
    let mean_at = |at: usize, count: usize, value: &dyn Fn(usize) -> f32| {
        let (mut sum, mut weights) = (0.0, 0.0);
        for k in at.saturating_sub(reach)..(at + reach + 1).min(count) {
            sum += weight(k.abs_diff(at)) * value(k);
            weights += weight(k.abs_diff(at));
        }
        sum / weights
    };
    let across: Vec<f32> = (0..values.len())
        .map(|pixel| mean_at(pixel % width, width, &|x| values[pixel / width * width + x]))
        .collect();
    (0..values.len())
        .map(|pixel| mean_at(pixel / width, height, &|y| across[y * width + pixel % width]))
        .collect()
}

/// Zero mean, unit norm; zero where there is nothing to see.
fn normalised(mut values: Vec<f32>) -> Vec<f32> {
    // Rounding alone leaves some 1e-5 of a flat image's 255.
    const NOTHING: f32 = 1e-2;
    let mean = values.iter().sum::<f32>() / values.len() as f32;
    values.iter_mut().for_each(|value| *value -= mean);
    let norm = values.iter().map(|value| value * value).sum::<f32>().sqrt();
    let scale = if norm > NOTHING { 1.0 / norm } else { 0.0 };
    values.iter_mut().for_each(|value| *value *= scale);
    values
}
