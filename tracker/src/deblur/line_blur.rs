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

use arrayvec::ArrayVec;
use fearless_simd::{Level, dispatch, f32x8, prelude::*};

use super::flow::{BLOCK_HEIGHT, BLOCK_WIDTH, BlurFlow};
use crate::math::floor_to_i32;
use crate::transfer::MAX_VIRTUAL_VIEWS;

/// One sample of a block's path: whole-pixel shift and the fraction beyond it.
#[derive(Clone, Copy)]
struct Tap {
    du: i32,
    dv: i32,
    fu: f32,
    fv: f32,
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
        let taps = taps(displacement, views);
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
    taps: &[Tap],
    u: usize,
    v: usize,
) -> [f32x8<S>; BLOCK_HEIGHT] {
    let mut sums = [f32x8::splat(simd, 0.0); BLOCK_HEIGHT];
    for tap in taps {
        let first = (v as i32 + tap.dv) as usize * width + (u as i32 + tap.du) as usize;
        let load = |row: usize| {
            let pixels = &image[first + row * width..][..BLOCK_WIDTH + 1];
            let (left, right) =
                (f32x8::from_slice(simd, &pixels[..BLOCK_WIDTH]), f32x8::from_slice(simd, &pixels[1..]));
            (right - left).mul_add(tap.fu, left)
        };
        let mut above = load(0);
        for (row, sum) in sums.iter_mut().enumerate() {
            let below = load(row + 1);
            *sum += (below - above).mul_add(tap.fv, above);
            above = below;
        }
    }
    sums
}

#[inline(always)]
fn taps(displacement: &[f32; 2], views: usize) -> ArrayVec<Tap, MAX_VIRTUAL_VIEWS> {
    let mut taps = ArrayVec::new();
    let scale = 1.0 / views as f32;
    for k in 0..views {
        let s = (k as f32 + 0.5) * scale - 0.5;
        let (x, y) = (s * displacement[0], s * displacement[1]);
        let (du, dv) = (floor_to_i32(x), floor_to_i32(y));
        taps.push(Tap { du, dv, fu: x - du as f32, fv: y - dv as f32 });
    }
    taps
}

/// Whether every load of the block stays in the image. The path is straight: its ends decide.
#[inline(always)]
fn path_is_inside(taps: &[Tap], flow: &BlurFlow, u: usize, v: usize) -> bool {
    let inside = |tap: &Tap| {
        let (left, top) = (u as i32 + tap.du, v as i32 + tap.dv);
        left >= 0
            && top >= 0
            && left + (BLOCK_WIDTH as i32) < flow.width as i32
            && top + (BLOCK_HEIGHT as i32) < flow.height as i32
    };
    let whole = u + BLOCK_WIDTH <= flow.width && v + BLOCK_HEIGHT <= flow.height;
    whole && taps.first().is_some_and(inside) && taps.last().is_some_and(inside)
}

fn blur_border_block(image: &[f32], flow: &BlurFlow, taps: &[Tap], u: usize, v: usize, out: &mut [f32]) {
    let (last_u, last_v) = (flow.width as i32 - 1, flow.height as i32 - 1);
    let at = |column: i32, row: i32| {
        image[row.clamp(0, last_v) as usize * flow.width + column.clamp(0, last_u) as usize]
    };
    let scale = 1.0 / taps.len() as f32;
    for row in v..(v + BLOCK_HEIGHT).min(flow.height) {
        for column in u..(u + BLOCK_WIDTH).min(flow.width) {
            let mut sum = 0.0;
            for tap in taps {
                let (x, y) = (column as i32 + tap.du, row as i32 + tap.dv);
                let above = at(x, y) + tap.fu * (at(x + 1, y) - at(x, y));
                let below = at(x, y + 1) + tap.fu * (at(x + 1, y + 1) - at(x, y + 1));
                sum += above + tap.fv * (below - above);
            }
            out[row * flow.width + column] = sum * scale;
        }
    }
}
