//! Mean of an image along the blur path of every block.
//!
//! # Layout
//!
//! A vector is one row of a block. All its pixels share the displacement, so a sample of the path is a bilinear
//! mix of unaligned row loads with the same weights in every lane: no gathers. Blocks whose path leaves the image
//! load through a row buffer that continues the border.
//!
//! # Cost
//!
//! Per block of 32 pixels and view: ten loads and about thirty arithmetic operations.

use fearless_simd::{Level, dispatch, f32x8, i32x8, prelude::*};

use super::flow::{BLOCK_HEIGHT, BLOCK_WIDTH, BlurFlow};
use crate::transfer::MAX_VIRTUAL_VIEWS;

/// The samples of a block's path: whole-pixel shifts and the fractions beyond them.
struct Taps {
    du: [i32; MAX_VIRTUAL_VIEWS],
    dv: [i32; MAX_VIRTUAL_VIEWS],
    fu: [f32; MAX_VIRTUAL_VIEWS],
    fv: [f32; MAX_VIRTUAL_VIEWS],
    count: usize,
}

/// `0, 1, 2...`
const ORDINALS: [f32; MAX_VIRTUAL_VIEWS] = {
    let mut ordinals = [0.0; MAX_VIRTUAL_VIEWS];
    let mut k = 0;
    while k < MAX_VIRTUAL_VIEWS {
        ordinals[k] = k as f32;
        k += 1;
    }
    ordinals
};

impl Taps {
    #[inline(always)]
    fn none() -> Self {
        Self {
            du: [0; MAX_VIRTUAL_VIEWS],
            dv: [0; MAX_VIRTUAL_VIEWS],
            fu: [0.0; MAX_VIRTUAL_VIEWS],
            fv: [0.0; MAX_VIRTUAL_VIEWS],
            count: 0,
        }
    }

    /// Takes `count` samples along `displacement`, eight at a time; those past the last are never used.
    #[inline(always)]
    fn fill<S: Simd>(&mut self, simd: S, displacement: &[f32; 2], count: usize) {
        self.count = count;
        let scale = 1.0 / count as f32;
        for k in (0..count.min(MAX_VIRTUAL_VIEWS)).step_by(8) {
            let s = (f32x8::from_slice(simd, &ORDINALS[k..k + 8]) + 0.5) * scale - 0.5;
            let (x, y) = (s * displacement[0], s * displacement[1]);
            let (left, top) = (x.floor(), y.floor());
            left.to_int::<i32x8<S>>().store_slice(&mut self.du[k..k + 8]);
            top.to_int::<i32x8<S>>().store_slice(&mut self.dv[k..k + 8]);
            (x - left).store_slice(&mut self.fu[k..k + 8]);
            (y - top).store_slice(&mut self.fv[k..k + 8]);
        }
    }
}

/// Writes to `out` the mean of `image` over `views` points of every block's path (midpoint rule), at most
/// [`MAX_VIRTUAL_VIEWS`]. Outside the image its border is continued.
///
/// `image` and `out` have the size of `flow`. The path is symmetric about the pixel, so the operator is its own
/// adjoint as far as the flow is smooth.
///
/// # Panics
/// If `image` or `out` has another length than the images that the flow is for.
pub fn blur_along(level: Level, image: &[f32], flow: &BlurFlow, views: usize, out: &mut [f32]) {
    let size = flow.width * flow.height;
    assert_eq!(image.len(), size, "pixels of the image, for a flow of {} x {}", flow.width, flow.height);
    assert_eq!(
        out.len(),
        size,
        "pixels of the blurred image, for a flow of {} x {}",
        flow.width,
        flow.height
    );
    dispatch!(level, simd => blur_blocks(simd, image, flow, views.clamp(1, MAX_VIRTUAL_VIEWS), out));
}

#[inline(always)]
fn blur_blocks<S: Simd>(simd: S, image: &[f32], flow: &BlurFlow, views: usize, out: &mut [f32]) {
    let per_row = flow.blocks_per_row();
    let mut taps = Taps::none();
    let mut blocks = flow.displacement.chunks_exact(per_row.max(1));
    for v in (0..flow.height).step_by(BLOCK_HEIGHT) {
        let Some(displacements) = blocks.next() else { return };
        let out = &mut out[v * flow.width..];
        for (u, displacement) in (0..flow.width).step_by(BLOCK_WIDTH).zip(displacements) {
            taps.fill(simd, displacement, views);
            // Blocks whose paths stay inside need no check of their edges, and are whole.
            if path_is_inside(&taps, flow, u, v) {
                let sums = sums_inside(simd, image, flow.width, &taps, u, v);
                let mut rows = &mut out[u..];
                for (row, sum) in sums.iter().enumerate() {
                    (*sum * (1.0 / views as f32)).store_slice(&mut rows[..BLOCK_WIDTH]);
                    if row + 1 < BLOCK_HEIGHT {
                        rows = &mut rows[flow.width..];
                    }
                }
                continue;
            }
            let sums = sums_at_border(simd, image, flow, &taps, u, v);
            for (row, sum) in (0..flow.height - v).zip(&sums) {
                let mean = *sum * (1.0 / views as f32);
                // The last block of a row may be narrower.
                let columns = BLOCK_WIDTH.min(flow.width - u);
                out[row * flow.width + u..][..columns].copy_from_slice(&mean.as_slice()[..columns]);
            }
        }
    }
}

/// Sums of the taps of one block of which no load leaves the image. Rows are interpolated horizontally first: each serves two
/// rows of the block.
#[inline(always)]
fn sums_inside<S: Simd>(
    simd: S,
    image: &[f32],
    width: usize,
    taps: &Taps,
    u: usize,
    v: usize,
) -> [f32x8<S>; BLOCK_HEIGHT] {
    let mut sums = [f32x8::splat(simd, 0.0); BLOCK_HEIGHT];
    let origin = (v * width + u) as i32;
    let count = taps.count.min(MAX_VIRTUAL_VIEWS);
    let (du, dv, fu, fv) = (&taps.du[..count], &taps.dv[..count], &taps.fu[..count], &taps.fv[..count]);
    for k in 0..count {
        let first = (origin + dv[k] * width as i32 + du[k]) as u32 as usize;
        let mut rows = &image[first..];
        let mut above = mixed(simd, &rows[..=BLOCK_WIDTH], fu[k]);
        for sum in &mut sums {
            rows = &rows[width..];
            let below = mixed(simd, &rows[..=BLOCK_WIDTH], fu[k]);
            *sum += (below - above).mul_add(fv[k], above);
            above = below;
        }
    }
    sums
}

/// Sums of the taps of one block whose loads may leave the image.
#[inline(always)]
fn sums_at_border<S: Simd>(
    simd: S,
    image: &[f32],
    flow: &BlurFlow,
    taps: &Taps,
    u: usize,
    v: usize,
) -> [f32x8<S>; BLOCK_HEIGHT] {
    let mut sums = [f32x8::splat(simd, 0.0); BLOCK_HEIGHT];
    for k in 0..taps.count {
        let (left, top) = (u as i32 + taps.du[k], v as i32 + taps.dv[k]);
        let mut above = mixed_row(simd, image, flow, left, top, taps.fu[k]);
        for (row, sum) in (top + 1..).zip(&mut sums) {
            let below = mixed_row(simd, image, flow, left, row, taps.fu[k]);
            *sum += (below - above).mul_add(taps.fv[k], above);
            above = below;
        }
    }
    sums
}

/// Eight pixels from `(left, top)` on, mixed with `fraction` of their right neighbours; the border is continued.
#[inline(always)]
fn mixed_row<S: Simd>(
    simd: S,
    image: &[f32],
    flow: &BlurFlow,
    left: i32,
    top: i32,
    fraction: f32,
) -> f32x8<S> {
    let row = &image[top.clamp(0, flow.height as i32 - 1) as usize * flow.width..][..flow.width];
    if left >= 0 && left as usize + BLOCK_WIDTH < flow.width {
        return mixed(simd, &row[left as usize..][..BLOCK_WIDTH + 1], fraction);
    }
    let mut pixels = [0.0; BLOCK_WIDTH + 1];
    for (column, pixel) in (left..).zip(&mut pixels) {
        *pixel = row[column.clamp(0, flow.width as i32 - 1) as usize];
    }
    mixed(simd, &pixels, fraction)
}

#[inline(always)]
fn mixed<S: Simd>(simd: S, pixels: &[f32], fraction: f32) -> f32x8<S> {
    let left = f32x8::from_slice(simd, &pixels[..BLOCK_WIDTH]);
    let right = f32x8::from_slice(simd, &pixels[1..=BLOCK_WIDTH]);
    (right - left).mul_add(fraction, left)
}

/// Whether every load of the block stays in the image. The path is straight: its ends decide.
#[inline(always)]
fn path_is_inside(taps: &Taps, flow: &BlurFlow, u: usize, v: usize) -> bool {
    let inside = |k: usize| tap_is_inside(flow, u as i32 + taps.du[k], v as i32 + taps.dv[k]);
    let whole = u + BLOCK_WIDTH <= flow.width && v + BLOCK_HEIGHT <= flow.height;
    whole && inside(0) && inside(taps.count - 1)
}

/// Whether every load of a tap whose first pixel is `(left, top)` stays in the image.
#[inline(always)]
fn tap_is_inside(flow: &BlurFlow, left: i32, top: i32) -> bool {
    left >= 0
        && top >= 0
        && left + (BLOCK_WIDTH as i32) < flow.width as i32
        && top + (BLOCK_HEIGHT as i32) < flow.height as i32
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

    fn blurred_into(pixels: usize, out: usize) {
        let flow = BlurFlow { width: WIDTH, height: HEIGHT, displacement: &mut vec![[1.0, 0.0]; blocks()] };
        blur_along(Level::new(), &image()[..pixels], &flow, 3, &mut vec![0.0; out]);
    }

    #[test]
    #[should_panic(expected = "pixels of the image, for a flow of")]
    fn an_image_that_is_too_short_is_refused() {
        blurred_into(WIDTH * HEIGHT - 1, WIDTH * HEIGHT);
    }

    #[test]
    #[should_panic(expected = "pixels of the blurred image, for a flow of")]
    fn a_place_that_is_too_short_is_refused() {
        blurred_into(WIDTH * HEIGHT, WIDTH * HEIGHT - 1);
    }
}
