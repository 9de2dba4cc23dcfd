//! Projection of Gaussians to splats.

use core::f32::consts::LOG2_E;

use fearless_simd::{Level, dispatch, f32x8, mask32x8, prelude::*};

use super::constants::MIN_ALPHA;
use super::lanes::{LANES, Lanes, ViewNumbers, each, load};
use crate::gaussians::PARAMETERS;

/// Depth key of a Gaussian that is not drawn.
pub(super) const NOT_DRAWN: u32 = u32::MAX;

/// Added to the exponent at which a splat counts as gone, so that rounding never clips a visible pixel.
const EXPONENT_MARGIN: f32 = 0.005;

/// What the pixels of a tile read of a splat.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub(super) struct Splat {
    /// Projected centre, pixels.
    pub(super) centre: [f32; 2],
    /// du/dx, du/dy and dv/dy of coordinates in which the splat falls off as `2^-(u^2 + v^2)`. A sum of squares
    /// keeps digits that the quadratic form of a needle would cancel.
    pub(super) whitening: [f32; 3],
    pub(super) opacity: f32,
    pub(super) colour: [f32; 3],
    /// Camera z of the centre, metres.
    pub(super) depth: f32,
    /// Its slope along u and v.
    pub(super) tilt: [f32; 2],
}

/// The ellipse within which a splat is visible, relative to its centre, pixels.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub(super) struct Extent {
    /// Half the width and height of its bounding box.
    pub(super) radius: [f32; 2],
    /// Half its height on the vertical line through the centre.
    pub(super) half_height: f32,
    /// The chord on the vertical line at dx has its middle at `dx * lean`.
    pub(super) lean: f32,
    /// dx of the point with the largest dy; the smallest is opposite.
    pub(super) top: f32,
}

/// A projected Gaussian.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Projected {
    pub(super) splat: Splat,
    pub(super) extent: Extent,
    /// Ascending with camera z; [`NOT_DRAWN`] if there is nothing to see.
    pub(super) depth_key: u32,
}

/// Projects the Gaussians `first..first + out.len()` of `planes`.
pub(super) fn project(
    level: Level,
    view: &ViewNumbers,
    planes: &[&[f32]; PARAMETERS],
    first: usize,
    out: &mut [Projected],
) {
    dispatch!(level, simd => project_lanes(simd, view, planes, first, out));
}

#[inline(always)]
fn project_lanes<S: Simd>(
    simd: S,
    view: &ViewNumbers,
    planes: &[&[f32]; PARAMETERS],
    first: usize,
    out: &mut [Projected],
) {
    for (step, out) in out.chunks_mut(LANES).enumerate() {
        let lanes = Lanes::new(simd, view, &load(simd, planes, first + step * LANES));
        if lanes.drawn.all_false() {
            out.iter_mut().for_each(|projected| projected.depth_key = NOT_DRAWN);
        } else {
            store(simd, view, &lanes, out);
        }
    }
}

#[inline(always)]
fn store<S: Simd>(simd: S, view: &ViewNumbers, lanes: &Lanes<S>, out: &mut [Projected]) {
    let extent = extent(simd, lanes);
    let drawn = lanes.drawn & overlaps_image(view, lanes, &extent);
    let drawn = drawn.to_bitmask();
    let (c, w, rgb) = (&lanes.centre, &lanes.whitening, &lanes.colour);
    // The exponent is a power of two: exp(-d^T d / 2) = 2^(-|s d|^2).
    let scale = (0.5 * LOG2_E).sqrt();
    // From slopes along the axes of the image to those along u and v.
    let along_u = lanes.tilt[0] / w[0];
    let along_v = (lanes.tilt[1] - w[1] * along_u) / w[2];
    let splat = [
        c[0],
        c[1],
        w[0] * scale,
        w[1] * scale,
        w[2] * scale,
        lanes.opacity,
        rgb[0],
        rgb[1],
        rgb[2],
        lanes.x_camera[2],
        along_u / scale,
        along_v / scale,
    ];
    for (lane, out) in out.iter_mut().enumerate() {
        let s: [f32; 12] = each(
            #[inline(always)]
            |k| splat[k][lane],
        );
        let e: [f32; 5] = each(
            #[inline(always)]
            |k| extent[k][lane],
        );
        *out = Projected {
            splat: Splat {
                centre: [s[0], s[1]],
                whitening: [s[2], s[3], s[4]],
                opacity: s[5],
                colour: [s[6], s[7], s[8]],
                depth: s[9],
                tilt: [s[10], s[11]],
            },
            extent: Extent { radius: [e[0], e[1]], half_height: e[2], lean: e[3], top: e[4] },
            depth_key: if drawn >> lane & 1 == 1 { s[9].to_bits() } else { NOT_DRAWN },
        };
    }
}

/// The numbers of [`Extent`] in their order.
#[inline(always)]
fn extent<S: Simd>(simd: S, lanes: &Lanes<S>) -> [f32x8<S>; 5] {
    let [xx, xy, yy] = lanes.covariance;
    let faintest = MIN_ALPHA as f32;
    // Squared distance from the centre to the border of visibility, in standard deviations.
    let reach = f32x8::from_fn(simd, |lane| 2.0 * ((lanes.opacity[lane] / faintest).ln() + EXPONENT_MARGIN));
    [
        (reach * xx).sqrt(),
        (reach * yy).sqrt(),
        (reach * (lanes.determinant / xx)).sqrt(),
        xy / xx,
        xy * (reach / yy).sqrt(),
    ]
}

/// Whether the bounding box reaches a pixel centre.
#[inline(always)]
fn overlaps_image<S: Simd>(view: &ViewNumbers, lanes: &Lanes<S>, extent: &[f32x8<S>; 5]) -> mask32x8<S> {
    let along: [mask32x8<S>; 2] = each(
        #[inline(always)]
        |i| {
            let (low, high) = (lanes.centre[i] - extent[i], lanes.centre[i] + extent[i]);
            high.simd_ge(view.first[i]) & low.simd_le(view.last[i])
        },
    );
    along[0] & along[1]
}
