//! Resampling an image through a map of source positions.
//!
//! # Layout and cost
//!
//! A lane is a pixel, eight at a time. A pixel of up to four channels of 8 bits is read as one word of 32 bits and split by
//! shifts: per vector 32 loads for the four corners, and per channel about 20 operations. Results are those of one pixel
//! after the other, bit for bit.

use fearless_simd::{Level, dispatch, f32x8, i32x8, mask32x8, prelude::*};

use super::undistort::{BufferSizeError, SourcePosition, check_len};
use crate::math::{floor_to_i32, round_half_up_to_i32};

/// Pixels that are gathered at the same time.
const LANES: usize = 8;

/// Bytes of the word that a pixel is read as.
const WORD: usize = 4;

/// Largest image whose linear indices are computed in single precision and 32 bits, on a side and in pixels.
const MAX_SIDE: usize = 1 << 15;

/// Gathers `target` from an interleaved 8-bit image of `width x height` pixels with bilinear interpolation,
/// rounded to the nearest value; zero where the map has no source.
///
/// `source` holds `width * height` pixels, `target` one pixel per entry of `map`. `level` is the instruction set to use; the
/// result is the same with all.
///
/// # Errors
///
/// [`BufferSizeError`] for the first of `source`, `target` with a wrong number of pixels.
pub fn remap_bilinear<const CHANNELS: usize>(
    level: Level,
    source: &[[u8; CHANNELS]],
    width: usize,
    height: usize,
    map: &[SourcePosition],
    target: &mut [[u8; CHANNELS]],
) -> Result<(), BufferSizeError> {
    check_len(source.len(), width * height)?;
    check_len(target.len(), map.len())?;
    let in_vectors = if CHANNELS <= WORD { whole_vectors(width, height, map.len()) } else { 0 };
    let (vectors, rest) = target.split_at_mut(in_vectors);
    let bytes = source.as_flattened();
    dispatch!(level, simd => bilinear_vectors(simd, bytes, [width, height], &map[..in_vectors], vectors));
    for (pixel, position) in rest.iter_mut().zip(&map[in_vectors..]) {
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
/// `level` is the instruction set to use; the result is the same with all.
///
/// # Errors
///
/// [`BufferSizeError`] for the first of `source`, `target` with a wrong number of pixels.
pub fn remap_nearest(
    level: Level,
    source: &[u16],
    width: usize,
    height: usize,
    map: &[SourcePosition],
    target: &mut [u16],
) -> Result<(), BufferSizeError> {
    check_len(source.len(), width * height)?;
    check_len(target.len(), map.len())?;
    let (vectors, rest) = target.split_at_mut(whole_vectors(width, height, map.len()));
    let (in_vectors, in_rest) = map.split_at(vectors.len());
    dispatch!(level, simd => nearest_vectors(simd, source, [width, height], in_vectors, vectors));
    for (value, position) in rest.iter_mut().zip(in_rest) {
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

/// Pixels of `count` that are gathered in whole vectors: none of an image that is empty or too large.
fn whole_vectors(width: usize, height: usize, count: usize) -> usize {
    let fits = (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height);
    if fits { count / LANES * LANES } else { 0 }
}

/// Positions of eight pixels, and which of them have a source; those without are at the first pixel.
#[inline(always)]
fn positions<S: Simd>(
    simd: S,
    map: &[SourcePosition],
    [width, height]: [usize; 2],
) -> (mask32x8<S>, [f32x8<S>; 2]) {
    let (mut u, mut v) = ([0.0; LANES], [0.0; LANES]);
    for ((u, v), position) in u.iter_mut().zip(&mut v).zip(map) {
        [*u, *v] = *position;
    }
    let (u, v) = (f32x8::from_slice(simd, &u), f32x8::from_slice(simd, &v));
    // As `has_source`.
    let has =
        u.simd_ge(0.0) & v.simd_ge(0.0) & (u + 1.0).simd_le(width as f32) & (v + 1.0).simd_le(height as f32);
    let zero = f32x8::splat(simd, 0.0);
    (has, [has.select(u, zero), has.select(v, zero)])
}

#[inline(always)]
fn bilinear_vectors<S: Simd, const CHANNELS: usize>(
    simd: S,
    bytes: &[u8],
    size: [usize; 2],
    map: &[SourcePosition],
    target: &mut [[u8; CHANNELS]],
) {
    let (width, none) = (i32x8::splat(simd, size[0] as i32), i32x8::splat(simd, 0));
    let last_column = i32x8::splat(simd, size[0] as i32 - 1);
    let last_row = i32x8::splat(simd, size[1] as i32 - 1);
    for (pixels, map) in target.chunks_exact_mut(LANES).zip(map.chunks_exact(LANES)) {
        let (has, [u, v]) = positions(simd, map, size);
        let (column, row) = (u.to_int::<i32x8<S>>(), v.to_int::<i32x8<S>>());
        let (fu, fv) = (u - column.to_float::<f32x8<S>>(), v - row.to_float::<f32x8<S>>());
        // The last row and column belong to the cell before.
        let (right, below) = ((column + 1).min(last_column), (row + 1).min(last_row) * width);
        let above = row * width;
        // Not an array and its map: what is not inlined here is not compiled for the instruction set.
        let top_left = words::<S, CHANNELS>(simd, bytes, &(above + column));
        let top_right = words::<S, CHANNELS>(simd, bytes, &(above + right));
        let bottom_left = words::<S, CHANNELS>(simd, bytes, &(below + column));
        let bottom_right = words::<S, CHANNELS>(simd, bytes, &(below + right));
        for channel in 0..CHANNELS {
            let shift = (8 * channel) as u32;
            let (a, b) = (byte(simd, top_left, shift), byte(simd, top_right, shift));
            let (c, d) = (byte(simd, bottom_left, shift), byte(simd, bottom_right, shift));
            let upper = a + fu * (b - a);
            let lower = c + fu * (d - c);
            let light = (upper + fv * (lower - upper) + 0.5).to_int::<i32x8<S>>();
            let light = has.select(light, none);
            for (pixel, &light) in pixels.iter_mut().zip(light.as_slice()) {
                pixel[channel] = light as u8;
            }
        }
    }
}

/// The byte of every word that begins at bit `shift`.
#[inline(always)]
fn byte<S: Simd>(simd: S, words: i32x8<S>, shift: u32) -> f32x8<S> {
    ((words >> shift) & i32x8::splat(simd, 255)).to_float()
}

/// The bytes of the pixels at `index` and those after them, lowest first.
#[inline(always)]
fn words<S: Simd, const CHANNELS: usize>(simd: S, bytes: &[u8], index: &i32x8<S>) -> i32x8<S> {
    let mut words = [0; LANES];
    for (word, &index) in words.iter_mut().zip(index.as_slice()) {
        let first = index as u32 as usize * CHANNELS;
        *word = match bytes.get(first..first + WORD) {
            Some(&[a, b, c, d]) => i32::from_le_bytes([a, b, c, d]),
            // The last pixels of the image are not followed by enough.
            _ => last_word(bytes, first),
        };
    }
    i32x8::from_slice(simd, &words)
}

#[cold]
fn last_word(bytes: &[u8], first: usize) -> i32 {
    i32::from_le_bytes(core::array::from_fn(|k| bytes.get(first + k).copied().unwrap_or(0)))
}

#[inline(always)]
fn nearest_vectors<S: Simd>(
    simd: S,
    source: &[u16],
    size: [usize; 2],
    map: &[SourcePosition],
    target: &mut [u16],
) {
    let width = i32x8::splat(simd, size[0] as i32);
    for (values, map) in target.chunks_exact_mut(LANES).zip(map.chunks_exact(LANES)) {
        let (has, [u, v]) = positions(simd, map, size);
        let index = (v + 0.5).to_int::<i32x8<S>>() * width + (u + 0.5).to_int::<i32x8<S>>();
        let (has, index) = (has.to_bitmask(), index.as_slice());
        for (lane, value) in values.iter_mut().enumerate() {
            let stored = source[index[lane] as u32 as usize];
            *value = if has >> lane & 1 == 1 { stored } else { 0 };
        }
    }
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

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::super::undistort::NO_SOURCE;
    use super::*;
    use crate::simd::{level_name, levels_up_to};

    #[test]
    fn bilinear_is_exact_on_a_ramp_and_black_without_source() {
        let source: [[u8; 2]; 12] = core::array::from_fn(|i| [(10 * (i % 4)) as u8, (20 * (i / 4)) as u8]);
        let map = [[0.26, 1.5], [3.0, 2.0], [2.74, 0.0], [3.01, 1.0], [f32::NAN, 1.0], NO_SOURCE];
        let mut target = [[9; 2]; 6];
        remap_bilinear(Level::new(), &source, 4, 3, &map, &mut target).unwrap();
        assert_eq!(target, [[3, 30], [30, 40], [27, 0], [0, 0], [0, 0], [0, 0]]);
    }

    #[test]
    fn depth_takes_the_nearest_pixel_and_never_a_mixture() {
        let source = [1000, 5000, 0, 7000];
        let map = [[0.49, 0.0], [0.5, 0.0], [0.3, 0.9], [1.0, 1.0], [-0.1, 0.0]];
        let mut target = [1; 5];
        remap_nearest(Level::new(), &source, 2, 2, &map, &mut target).unwrap();
        assert_eq!(target, [1000, 5000, 0, 7000, 0]);
    }

    /// Positions inside, on the last row and column, outside, and what is no number.
    fn positions_around(width: usize, height: usize) -> Vec<SourcePosition> {
        let (last_u, last_v) = ((width - 1) as f32, (height - 1) as f32);
        let mut map: Vec<SourcePosition> =
            (0..500).map(|k| [0.37 * (k * 7 % 50) as f32 - 0.8, 0.41 * (k * 13 % 37) as f32 - 0.6]).collect();
        map.extend([[last_u, last_v], [0.0, last_v], [last_u, 0.0], [last_u + 0.01, 1.0]]);
        map.extend([[f32::NAN, 1.0], [1.0, f32::INFINITY], [-1e30, 2.0], NO_SOURCE, [1e30, 1e30]]);
        map
    }

    fn bilinear_agrees<const CHANNELS: usize>() {
        let (width, height) = (17, 13);
        let source: Vec<[u8; CHANNELS]> =
            (0..width * height).map(|k| core::array::from_fn(|c| (k * 97 + c * 31 + k * k) as u8)).collect();
        let map = positions_around(width, height);
        let one_by_one = |position: &SourcePosition| {
            cell(*position, width, height).map_or([0; CHANNELS], |cell| interpolate(&source, width, &cell))
        };
        let expected: Vec<_> = map.iter().map(one_by_one).collect();
        for level in levels_up_to(Level::new()) {
            let mut target = vec![[7; CHANNELS]; map.len()];
            remap_bilinear(level, &source, width, height, &map, &mut target).unwrap();
            assert_eq!(target, expected, "{} with {CHANNELS} channels", level_name(level));
        }
    }

    #[test]
    fn eight_pixels_are_those_gathered_one_by_one_at_every_instruction_set() {
        bilinear_agrees::<1>();
        bilinear_agrees::<3>();
        bilinear_agrees::<4>();
        bilinear_agrees::<5>();
        let (width, height) = (17, 13);
        let source: Vec<u16> = (0..width * height).map(|k| (k * 4099 + 77) as u16).collect();
        let map = positions_around(width, height);
        let mut expected = vec![0; map.len()];
        for (value, position) in expected.chunks_mut(1).zip(map.chunks(1)) {
            // Fewer than a vector: one by one.
            remap_nearest(Level::new(), &source, width, height, position, value).unwrap();
        }
        assert!(expected.iter().filter(|value| **value != 0).count() > 200);
        for level in levels_up_to(Level::new()) {
            let mut target = vec![7; map.len()];
            remap_nearest(level, &source, width, height, &map, &mut target).unwrap();
            assert_eq!(target, expected, "{}", level_name(level));
        }
    }

    #[test]
    fn wrong_buffers_are_errors() {
        let (level, map) = (Level::new(), [[0.0, 0.0]; 2]);
        assert!(remap_nearest(level, &[1, 2, 3], 2, 2, &map, &mut [0; 2]).is_err());
        assert!(remap_nearest(level, &[1, 2, 3, 4], 2, 2, &map, &mut [0; 3]).is_err());
        assert!(remap_bilinear(level, &[[1]; 4], 2, 2, &map, &mut [[0]; 1]).is_err());
        // An image without pixels has no source for any.
        let mut target = [5; 8];
        remap_nearest(level, &[], 0, 0, &[[0.0, 0.0]; 8], &mut target).unwrap();
        assert_eq!(target, [0; 8]);
    }
}
