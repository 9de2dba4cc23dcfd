//! Mean of an image along the blur path of every pixel.
//!
//! A lane is a pixel; the samples of one pixel are spread along a straight line. Cost: per pixel and view two
//! clamps, four pair loads and eight arithmetic operations.

use fearless_simd::{Level, dispatch, prelude::*};

use super::flow::BlurFlow;
use crate::transfer::{BilinearSampler, LevelImage};

/// Writes to `out` the mean of `image` over `views` points of every pixel's blur path (midpoint rule). Outside the
/// image its border is continued.
///
/// The path is symmetric about the pixel, so the operator is its own adjoint as far as the flow is smooth.
pub fn blur_along(level: Level, image: &[f32], flow: &BlurFlow, views: usize, out: &mut [f32]) {
    let image = LevelImage { pixels: image, width: flow.width, height: flow.height };
    dispatch!(level, simd => blur_rows(simd, &image, flow, views.max(1), out));
}

#[inline(always)]
fn blur_rows<S: Simd>(simd: S, image: &LevelImage, flow: &BlurFlow, views: usize, out: &mut [f32]) {
    let lanes = S::f32s::LEN;
    let Some(sampler) = BilinearSampler::new(simd, image) else { return };
    if flow.width < lanes {
        out.copy_from_slice(image.pixels);
        return;
    }
    let scale = 1.0 / views as f32;
    for v in 0..flow.height {
        let row = v * flow.width..(v + 1) * flow.width;
        let (du, dv, out) = (&flow.du[row.clone()], &flow.dv[row.clone()], &mut out[row]);
        let mut u = 0;
        while u < flow.width {
            // The last vector of a row overlaps the one before.
            let first = u.min(flow.width - lanes);
            let columns = S::f32s::from_fn(simd, |k| (first + k) as f32);
            let path_u = S::f32s::from_slice(simd, &du[first..first + lanes]);
            let path_v = S::f32s::from_slice(simd, &dv[first..first + lanes]);
            let mut sum = S::f32s::splat(simd, 0.0);
            for k in 0..views {
                let s = (k as f32 + 0.5) * scale - 0.5;
                let (at_u, at_v) = sampler.clamp(path_u.mul_add(s, columns), path_v.mul_add(s, v as f32));
                sum += sampler.sample(at_u, at_v).value;
            }
            (sum * scale).store_slice(&mut out[first..first + lanes]);
            u += lanes;
        }
    }
}
