//! Mean of an image along the blur path of every block.
//!
//! # Layout
//!
//! A vector is one row of a block. All its pixels share the displacement, so a sample of the path is a bilinear
//! mix of unaligned row loads with the same weights in every lane: no gathers. Blocks whose path leaves the image
//! take a scalar way that continues the border.
//!
//! # Cost
//!
//! Per block of 32 pixels and view: ten loads and about thirty arithmetic operations.

use fearless_simd::{Level, dispatch, f32x8, prelude::*};

use super::flow::{BLOCK_HEIGHT, BLOCK_WIDTH, BlurFlow};
use crate::math::floor_to_i32;
use crate::transfer::MAX_VIRTUAL_VIEWS;

/// The samples of a block's path: whole-pixel shifts and the fractions beyond them. All slots are computed whatever
/// the number of views, which keeps the loop free of branches.
struct Taps {
    du: [i32; MAX_VIRTUAL_VIEWS],
    dv: [i32; MAX_VIRTUAL_VIEWS],
    fu: [f32; MAX_VIRTUAL_VIEWS],
    fv: [f32; MAX_VIRTUAL_VIEWS],
    count: usize,
}

impl Taps {
    #[inline(always)]
    fn new(displacement: &[f32; 2], views: usize) -> Self {
        let mut taps = Self {
            du: [0; MAX_VIRTUAL_VIEWS],
            dv: [0; MAX_VIRTUAL_VIEWS],
            fu: [0.0; MAX_VIRTUAL_VIEWS],
            fv: [0.0; MAX_VIRTUAL_VIEWS],
            count: views,
        };
        let scale = 1.0 / views as f32;
        for k in 0..MAX_VIRTUAL_VIEWS {
            let s = (k as f32 + 0.5) * scale - 0.5;
            let (x, y) = (s * displacement[0], s * displacement[1]);
            taps.du[k] = floor_to_i32(x);
            taps.dv[k] = floor_to_i32(y);
            taps.fu[k] = x - taps.du[k] as f32;
            taps.fv[k] = y - taps.dv[k] as f32;
        }
        taps
    }
}

/// Writes to `out` the mean of `image` over `views` points of every block's path (midpoint rule), at most
/// [`MAX_VIRTUAL_VIEWS`]. Outside the image its border is continued.
///
/// `image` and `out` have the size of `flow`. The path is symmetric about the pixel, so the operator is its own
/// adjoint as far as the flow is smooth.
pub fn blur_along(level: Level, image: &[f32], flow: &BlurFlow, views: usize, out: &mut [f32]) {
    let size = flow.width * flow.height;
    if image.len() < size || out.len() < size {
        return;
    }
    dispatch!(level, simd => blur_blocks(simd, image, flow, views.clamp(1, MAX_VIRTUAL_VIEWS), out));
}

#[inline(always)]
fn blur_blocks<S: Simd>(simd: S, image: &[f32], flow: &BlurFlow, views: usize, out: &mut [f32]) {
    let per_row = flow.blocks_per_row();
    for (block, displacement) in flow.displacement.iter().enumerate() {
        let (u, v) = ((block % per_row) * BLOCK_WIDTH, (block / per_row) * BLOCK_HEIGHT);
        let taps = Taps::new(displacement, views);
        if path_is_inside(&taps, flow, u, v) {
            let sums = block_sums(simd, image, flow.width, &taps, u, v);
            for (row, sum) in sums.iter().enumerate() {
                let first = (v + row) * flow.width + u;
                (*sum * (1.0 / views as f32)).store_slice(&mut out[first..first + BLOCK_WIDTH]);
            }
        } else {
            blur_border_block(image, flow, &taps, u, v, out);
        }
    }
}

/// Sums of the taps of one block. Rows are interpolated horizontally first: each serves two rows of the block.
#[inline(always)]
fn block_sums<S: Simd>(
    simd: S,
    image: &[f32],
    width: usize,
    taps: &Taps,
    u: usize,
    v: usize,
) -> [f32x8<S>; BLOCK_HEIGHT] {
    let mut sums = [f32x8::splat(simd, 0.0); BLOCK_HEIGHT];
    for k in 0..taps.count {
        let first = (v as i32 + taps.dv[k]) as usize * width + (u as i32 + taps.du[k]) as usize;
        let load = |row: usize| {
            let pixels = &image[first + row * width..][..BLOCK_WIDTH + 1];
            let (left, right) =
                (f32x8::from_slice(simd, &pixels[..BLOCK_WIDTH]), f32x8::from_slice(simd, &pixels[1..]));
            (right - left).mul_add(taps.fu[k], left)
        };
        let mut above = load(0);
        for (row, sum) in sums.iter_mut().enumerate() {
            let below = load(row + 1);
            *sum += (below - above).mul_add(taps.fv[k], above);
            above = below;
        }
    }
    sums
}

/// Whether every load of the block stays in the image. The path is straight: its ends decide.
#[inline(always)]
fn path_is_inside(taps: &Taps, flow: &BlurFlow, u: usize, v: usize) -> bool {
    let inside = |k: usize| {
        let (left, top) = (u as i32 + taps.du[k], v as i32 + taps.dv[k]);
        left >= 0
            && top >= 0
            && left + (BLOCK_WIDTH as i32) < flow.width as i32
            && top + (BLOCK_HEIGHT as i32) < flow.height as i32
    };
    let whole = u + BLOCK_WIDTH <= flow.width && v + BLOCK_HEIGHT <= flow.height;
    whole && inside(0) && inside(taps.count - 1)
}

fn blur_border_block(image: &[f32], flow: &BlurFlow, taps: &Taps, u: usize, v: usize, out: &mut [f32]) {
    let (last_u, last_v) = (flow.width as i32 - 1, flow.height as i32 - 1);
    let at = |column: i32, row: i32| {
        image[row.clamp(0, last_v) as usize * flow.width + column.clamp(0, last_u) as usize]
    };
    let scale = 1.0 / taps.count as f32;
    for row in v..(v + BLOCK_HEIGHT).min(flow.height) {
        for column in u..(u + BLOCK_WIDTH).min(flow.width) {
            let mut sum = 0.0;
            for k in 0..taps.count {
                let (x, y) = (column as i32 + taps.du[k], row as i32 + taps.dv[k]);
                let above = at(x, y) + taps.fu[k] * (at(x + 1, y) - at(x, y));
                let below = at(x, y + 1) + taps.fu[k] * (at(x + 1, y + 1) - at(x, y + 1));
                sum += above + taps.fv[k] * (below - above);
            }
            out[row * flow.width + column] = sum * scale;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::*;
    use crate::simd::{level_name, levels_up_to};

    /// Neither whole blocks across nor down.
    const WIDTH: usize = 45;
    const HEIGHT: usize = 30;

    fn texture(u: f32, v: f32) -> f32 {
        0.5 + 0.2 * (0.5 * u + 0.3 * v).sin() + 0.2 * (0.7 * v - 0.2 * u).cos()
    }

    fn image() -> Vec<f32> {
        (0..WIDTH * HEIGHT).map(|k| texture((k % WIDTH) as f32, (k / WIDTH) as f32)).collect()
    }

    /// The bilinear value of an image with continued border.
    fn bilinear(image: &[f32], u: f32, v: f32) -> f32 {
        let at = |i: f32, j: f32| {
            let (i, j) = (i.clamp(0.0, WIDTH as f32 - 1.0), j.clamp(0.0, HEIGHT as f32 - 1.0));
            image[j as usize * WIDTH + i as usize]
        };
        let (i, j) = (u.floor(), v.floor());
        let (fu, fv) = (u - i, v - j);
        let top = (1.0 - fu) * at(i, j) + fu * at(i + 1.0, j);
        let bottom = (1.0 - fu) * at(i, j + 1.0) + fu * at(i + 1.0, j + 1.0);
        (1.0 - fv) * top + fv * bottom
    }

    fn blurred(level: Level, image: &[f32], displacement: &mut [[f32; 2]], views: usize) -> Vec<f32> {
        let flow = BlurFlow { width: WIDTH, height: HEIGHT, displacement };
        let mut out = vec![f32::NAN; WIDTH * HEIGHT];
        blur_along(level, image, &flow, views, &mut out);
        out
    }

    fn blocks() -> usize {
        WIDTH.div_ceil(BLOCK_WIDTH) * HEIGHT.div_ceil(BLOCK_HEIGHT)
    }

    #[test]
    fn constant_flow_is_the_mean_of_shifted_images_at_every_level() {
        let image = image();
        for ([du, dv], views) in
            [([6.0, 0.0], 3), ([-4.0, 8.0], 4), ([0.0, 0.0], 3), ([13.7, -5.3], 9), ([100.0, 60.0], 32)]
        {
            for level in levels_up_to(Level::new()) {
                let out = blurred(level, &image, &mut vec![[du, dv]; blocks()], views);
                for (k, &light) in out.iter().enumerate() {
                    let (u, v) = ((k % WIDTH) as f32, (k / WIDTH) as f32);
                    let sum: f32 = (0..views)
                        .map(|i| {
                            let s = (i as f32 + 0.5) / views as f32 - 0.5;
                            bilinear(&image, u + s * du, v + s * dv)
                        })
                        .sum();
                    let expected = sum / views as f32;
                    let name = level_name(level);
                    assert!(
                        (light - expected).abs() < 1e-5,
                        "{name} ({du}, {dv}) at {k}: {light} not {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn operator_is_its_own_adjoint() {
        // Zero near the border: there the continued image makes a difference.
        let window = |k: usize| {
            let inside = (12..WIDTH - 12).contains(&(k % WIDTH)) && (8..HEIGHT - 8).contains(&(k / WIDTH));
            if inside { 1.0 } else { 0.0 }
        };
        let pixels = WIDTH * HEIGHT;
        let x: Vec<f32> =
            (0..pixels).map(|k| window(k) * texture((k % WIDTH) as f32, (k / WIDTH) as f32)).collect();
        let y: Vec<f32> =
            (0..pixels).map(|k| window(k) * texture((k / WIDTH) as f32 * 2.0, (k % WIDTH) as f32)).collect();
        let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
        let per_row = WIDTH.div_ceil(BLOCK_WIDTH);
        // Constant flow, and flow that changes by half a pixel per block as a strong roll would cause.
        for (change, bound) in [(0.0, 1e-6), (0.5, 2e-3)] {
            let mut flow: Vec<[f32; 2]> = (0..blocks())
                .map(|b| [6.0 + change * (b / per_row) as f32, 3.0 - change * (b % per_row) as f32])
                .collect();
            let level = Level::new();
            let ax_y = dot(&blurred(level, &x, &mut flow, 6), &y);
            let x_ay = dot(&x, &blurred(level, &y, &mut flow, 6));
            let relative = (ax_y - x_ay).abs() / ax_y;
            assert!(relative < bound, "change {change}: {ax_y} and {x_ay}, {relative}");
        }
    }

    #[test]
    fn buffers_that_are_too_short_are_left_alone() {
        let flow = BlurFlow { width: WIDTH, height: HEIGHT, displacement: &mut vec![[1.0, 0.0]; blocks()] };
        let mut out = vec![7.0; WIDTH * HEIGHT - 1];
        blur_along(Level::new(), &image(), &flow, 3, &mut out);
        assert!(out.iter().all(|light| *light == 7.0));
    }
}
