//! Resampling a distorted image into an ideal pinhole image through a map of source positions.
//!
//! The map is computed once per camera; every frame then only gathers. All memory is the caller's.

use crate::geometry::{Distortion, PinholeCamera};
use crate::math::{floor_to_i32, round_half_up_to_i32};

/// Column and row, in pixels of the captured image, whose light belongs to one ideal pixel; [`NO_SOURCE`] or
/// any other position outside `[0, width - 1] x [0, height - 1]` where the captured image has none.
///
/// Single precision: 1/16384 of a pixel or better for images up to 1024 columns.
pub type SourcePosition = [f32; 2];

/// The source position of an ideal pixel that the captured image does not show.
pub const NO_SOURCE: SourcePosition = [-1.0, -1.0];

/// Steps along the squared radius in the search for the point where the lens model folds back.
const FOLD_SEARCH_STEPS: usize = 256;

/// A buffer does not hold exactly the number of elements that the image size asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BufferSizeError {
    /// Elements that the image size asks for.
    pub expected: usize,
    /// Elements of the buffer.
    pub found: usize,
}

impl core::fmt::Display for BufferSizeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "buffer of {} elements, expected {}", self.found, self.expected)
    }
}

impl core::error::Error for BufferSizeError {}

/// Fills `map` (row-major, one entry per pixel of `ideal`) with the position of each ideal pixel in the image
/// that `captured` took through a lens with `distortion`.
///
/// The two cameras may differ in size and intrinsics: the same map then also rescales. Beyond the radius where
/// the radial polynomial stops growing the model would show the same pixels again, so there is no source there.
///
/// # Errors
///
/// [`BufferSizeError`] if `map` does not hold `ideal.width * ideal.height` entries.
pub fn fill_source_map(
    ideal: &PinholeCamera,
    captured: &PinholeCamera,
    distortion: &Distortion,
    map: &mut [SourcePosition],
) -> Result<(), BufferSizeError> {
    check_len(map.len(), ideal.width * ideal.height)?;
    let r2_limit = monotone_radius_squared(distortion, largest_radius_squared(ideal));
    for (index, source) in map.iter_mut().enumerate() {
        let ray = ideal.ray((index % ideal.width) as f64, (index / ideal.width) as f64);
        if ray.x * ray.x + ray.y * ray.y > r2_limit {
            *source = NO_SOURCE;
            continue;
        }
        let (x, y) = distortion.distort(ray.x, ray.y);
        let u = captured.fx * x + captured.cx;
        let v = captured.fy * y + captured.cy;
        let inside = |p: f64, n: usize| p >= 0.0 && p + 1.0 <= n as f64;
        let seen = inside(u, captured.width) && inside(v, captured.height);
        *source = if seen { [u as f32, v as f32] } else { NO_SOURCE };
    }
    Ok(())
}

/// Gathers `target` from an interleaved 8-bit image of `width x height` pixels with bilinear interpolation,
/// rounded to the nearest value; zero where the map has no source.
///
/// `source` holds `width * height` pixels, `target` one pixel per entry of `map`.
///
/// # Errors
///
/// [`BufferSizeError`] for the first of `source`, `target` with a wrong number of pixels.
pub fn remap_bilinear<const CHANNELS: usize>(
    source: &[[u8; CHANNELS]],
    width: usize,
    height: usize,
    map: &[SourcePosition],
    target: &mut [[u8; CHANNELS]],
) -> Result<(), BufferSizeError> {
    check_len(source.len(), width * height)?;
    check_len(target.len(), map.len())?;
    for (pixel, position) in target.iter_mut().zip(map) {
        *pixel = match cell(*position, width, height) {
            Some(cell) => interpolate(source, width, &cell),
            None => [0; CHANNELS],
        };
    }
    Ok(())
}

/// Gathers `target` from a 16-bit image of `width x height` pixels, taking the nearest source pixel: depths on
/// both sides of an edge must never be mixed. Zero (missing) where the map has no source.
///
/// # Errors
///
/// [`BufferSizeError`] for the first of `source`, `target` with a wrong number of pixels.
pub fn remap_nearest(
    source: &[u16],
    width: usize,
    height: usize,
    map: &[SourcePosition],
    target: &mut [u16],
) -> Result<(), BufferSizeError> {
    check_len(source.len(), width * height)?;
    check_len(target.len(), map.len())?;
    for (value, position) in target.iter_mut().zip(map) {
        *value = if has_source(*position, width, height) {
            let column = round_half_up_to_i32(position[0]) as usize;
            let row = round_half_up_to_i32(position[1]) as usize;
            source[row * width + column]
        } else {
            0
        };
    }
    Ok(())
}

/// A rectangle of whole pixels; the right and bottom ends are not part of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelRectangle {
    /// First column.
    pub left: usize,
    /// First row.
    pub top: usize,
    /// One past the last column.
    pub right: usize,
    /// One past the last row.
    pub bottom: usize,
}

/// A large rectangle of `map` (row-major, `width` columns) in which every pixel has a source: outside it black
/// corners of the undistorted image would be taken for edges.
///
/// Found by cutting, again and again, the side with the largest share of pixels without source. Empty
/// (`left == right` or `top == bottom`) if nothing is left.
#[must_use]
pub fn region_with_source(map: &[SourcePosition], width: usize) -> PixelRectangle {
    let height = map.len().checked_div(width).unwrap_or(0);
    let mut region = PixelRectangle { left: 0, top: 0, right: width, bottom: height };
    let missing = |column: usize, row: usize| usize::from(map[row * width + column][0] < 0.0);
    while region.left < region.right && region.top < region.bottom {
        let PixelRectangle { left, top, right, bottom } = region;
        let row_share =
            |row| (left..right).map(|c| missing(c, row)).sum::<usize>() as f64 / (right - left) as f64;
        let column_share =
            |column| (top..bottom).map(|r| missing(column, r)).sum::<usize>() as f64 / (bottom - top) as f64;
        let shares = [column_share(left), row_share(top), column_share(right - 1), row_share(bottom - 1)];
        let worst = shares.iter().copied().fold(0.0, f64::max);
        if worst == 0.0 {
            break;
        }
        match shares.iter().position(|s| *s == worst) {
            Some(0) => region.left += 1,
            Some(1) => region.top += 1,
            Some(2) => region.right -= 1,
            _ => region.bottom -= 1,
        }
    }
    region
}

/// Top-left pixel and fractions of one bilinear cell; the last row and column belong to the cell before.
struct Cell {
    column: usize,
    row: usize,
    right: usize,
    below: usize,
    fu: f32,
    fv: f32,
}

fn check_len(found: usize, expected: usize) -> Result<(), BufferSizeError> {
    if found == expected { Ok(()) } else { Err(BufferSizeError { expected, found }) }
}

/// Written so that a NaN has no source.
fn has_source([u, v]: SourcePosition, width: usize, height: usize) -> bool {
    u >= 0.0 && v >= 0.0 && u + 1.0 <= width as f32 && v + 1.0 <= height as f32
}

fn cell(position: SourcePosition, width: usize, height: usize) -> Option<Cell> {
    if !has_source(position, width, height) {
        return None;
    }
    let column = floor_to_i32(position[0]) as usize;
    let row = floor_to_i32(position[1]) as usize;
    Some(Cell {
        column,
        row,
        right: (column + 1).min(width - 1),
        below: (row + 1).min(height - 1),
        fu: position[0] - column as f32,
        fv: position[1] - row as f32,
    })
}

fn interpolate<const CHANNELS: usize>(
    source: &[[u8; CHANNELS]],
    width: usize,
    cell: &Cell,
) -> [u8; CHANNELS] {
    let (above, below) = (cell.row * width, cell.below * width);
    let corners = [
        &source[above + cell.column],
        &source[above + cell.right],
        &source[below + cell.column],
        &source[below + cell.right],
    ];
    core::array::from_fn(|channel| {
        let [a, b, c, d] = corners.map(|pixel| f32::from(pixel[channel]));
        let upper = a + cell.fu * (b - a);
        let lower = c + cell.fu * (d - c);
        (upper + cell.fv * (lower - upper) + 0.5) as u8
    })
}

/// Squared radius, at unit depth, of the image corner farthest from the optical axis.
fn largest_radius_squared(camera: &PinholeCamera) -> f64 {
    let (right, bottom) = (camera.width as f64 - 1.0, camera.height as f64 - 1.0);
    [(0.0, 0.0), (right, 0.0), (0.0, bottom), (right, bottom)]
        .into_iter()
        .map(|(u, v)| {
            let ray = camera.ray(u, v);
            ray.x * ray.x + ray.y * ray.y
        })
        .fold(0.0, f64::max)
}

/// The largest squared radius up to `r2_max` below which `r (1 + k1 r^2 + k2 r^4 + k3 r^6)` grows with r.
fn monotone_radius_squared(distortion: &Distortion, r2_max: f64) -> f64 {
    let slope =
        |r2: f64| 1.0 + r2 * (3.0 * distortion.k1 + r2 * (5.0 * distortion.k2 + r2 * 7.0 * distortion.k3));
    let step = r2_max / FOLD_SEARCH_STEPS as f64;
    (1..=FOLD_SEARCH_STEPS)
        .map(|k| k as f64 * step)
        .find(|r2| slope(*r2) <= 0.0)
        .map_or(f64::INFINITY, |r2| r2 - step)
}
