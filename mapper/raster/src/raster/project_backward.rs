//! From gradients by splats to gradients by the parameters of Gaussians and by the pose.

use core::f32::consts::LN_2;

use fearless_simd::{Level, dispatch, f32x8, mask32x8, prelude::*};

use super::backward::SplatSums;
use super::bin::Bins;
use super::lanes::{LANES, LaneMatrix, Lanes, ViewNumbers, dot3, each, load, symmetric};
use super::reduce::{SUMS, reduce};
use crate::gaussians::{COLOUR, LOG_SCALE, MEAN, OPACITY_LOGIT, PARAMETERS, PlanesMut, ROTATION};

/// Gradient by the rows of `camera_from_world`: three of R and t each.
pub(super) type ViewSums = [f32; 12];

/// A range of Gaussians to which gradients are added.
pub(super) struct GradientRange<'a> {
    pub(super) planes: PlanesMut<'a>,
    /// Length of the gradient by the projected centre, per pixel.
    pub(super) screen: &'a mut [f32],
}

impl GradientRange<'_> {
    /// The part before Gaussian `middle` of the range and the rest.
    pub(super) fn split_at(self, middle: usize) -> (Self, Self) {
        let (planes, other_planes) = self.planes.split_at(middle);
        let (screen, other_screen) = self.screen.split_at_mut(planes.len());
        (Self { planes, screen }, Self { planes: other_planes, screen: other_screen })
    }
}

/// What the gradients of a range follow from.
pub(super) struct SplatGradients<'a> {
    pub(super) view: &'a ViewNumbers,
    pub(super) planes: &'a [&'a [f32]; PARAMETERS],
    pub(super) rank_from_gaussian: &'a [u32],
    pub(super) bins: &'a Bins,
    pub(super) sums: &'a [SplatSums],
}

/// Gradient by the splats of eight Gaussians.
struct SplatGradientLanes<S: Simd> {
    centre: [f32x8<S>; 2],
    /// By the covariance on the image: xx, xy (both places together), yy.
    covariance: [f32x8<S>; 3],
    opacity_logit: f32x8<S>,
    colour: [f32x8<S>; 3],
    depth: f32x8<S>,
    /// By the covariance of the offset on the image with camera z.
    with_z: [f32x8<S>; 2],
}

/// Adds the gradients of the Gaussians `first..` to `out`, and returns what they give to the pose.
pub(super) fn project_backward(
    level: Level,
    input: &SplatGradients,
    first: usize,
    out: &mut GradientRange,
) -> ViewSums {
    dispatch!(level, simd => backward_range(simd, input, first, out))
}

#[inline(always)]
fn backward_range<S: Simd>(
    simd: S,
    input: &SplatGradients,
    first: usize,
    out: &mut GradientRange,
) -> ViewSums {
    let mut grad_view = [[f32x8::splat(simd, 0.0); 4]; 3];
    let mut sums = [[0.0; LANES]; SUMS];
    let ranks = input.rank_from_gaussian[first..first + out.planes.len()].chunks(LANES);
    for (step, ranks) in ranks.enumerate() {
        if reduce(ranks, input.bins, input.sums, &mut sums) {
            let at = step * LANES;
            // Projected once more: cheaper than keeping what the forward pass knew.
            let lanes = Lanes::new(simd, input.view, &load(simd, input.planes, first + at));
            let grad_splat = SplatGradientLanes::new(simd, &lanes, &sums);
            let (grad_parameters, grad_rows) = lanes.backward(input.view, &grad_splat);
            let finite = is_finite(simd, &grad_parameters);
            add(out, at, ranks.len(), finite, &grad_parameters, &grad_splat);
            let zero = f32x8::splat(simd, 0.0);
            for (sum, row) in grad_view.as_flattened_mut().iter_mut().zip(grad_rows.as_flattened()) {
                *sum += finite.select(*row, zero);
            }
        }
    }
    let mut totals = [0.0; 12];
    totals.iter_mut().zip(grad_view.as_flattened()).for_each(|(total, sum)| *total = sum.reduce_sum());
    totals
}

/// Gaussians whose numbers overflowed get no gradient.
#[inline(always)]
fn is_finite<S: Simd>(simd: S, grad_parameters: &[f32x8<S>; PARAMETERS]) -> mask32x8<S> {
    grad_parameters.iter().fold(f32x8::splat(simd, 0.0), |sum, &value| sum + value * 0.0).simd_eq(0.0)
}

#[inline(always)]
fn add<S: Simd>(
    out: &mut GradientRange,
    at: usize,
    count: usize,
    finite: mask32x8<S>,
    grad_parameters: &[f32x8<S>; PARAMETERS],
    grad_splat: &SplatGradientLanes<S>,
) {
    let [u, v] = grad_splat.centre;
    let screen = u.mul_add(u, v * v).sqrt();
    let zero = f32x8::splat(u.token(), 0.0);
    let add = |plane: &mut [f32], values: f32x8<S>| {
        let values = finite.select(values, zero);
        let plane = &mut plane[at..at + count];
        if count == LANES {
            (f32x8::from_slice(u.token(), plane) + values).store_slice(plane);
        } else {
            plane.iter_mut().enumerate().for_each(|(lane, sum)| *sum += values[lane]);
        }
    };
    for (plane, &values) in out.planes.planes.iter_mut().zip(grad_parameters) {
        add(plane, values);
    }
    add(out.screen, screen);
}

impl<S: Simd> SplatGradientLanes<S> {
    /// From the sums of [`SplatSums`]. With `w = W d` the offset d in units of standard deviations, the gradient
    /// by the centre is `W^T sum(s w)`, that by the covariance `W^T sum(s w w^T) W / 2`.
    ///
    /// What depth adds: it is `z + t^T d` with the tilt `t = C^-1 c`, c the covariance with camera z. With
    /// `h = C^-1 sum(g d)` the gradient by c is h, that by the covariance `-h t^T`, that by the centre `-t sum(g)`.
    #[inline(always)]
    fn new(simd: S, lanes: &Lanes<S>, sums: &[[f32; LANES]; SUMS]) -> Self {
        let [s, su, sv, suu, suv, svv, red, green, blue, depth, gu, gv] = each(
            #[inline(always)]
            |k| f32x8::from_slice(simd, &sums[k]),
        );
        // The pixels' u and v are in units in which the falloff is a power of two.
        let unit = (2.0 * LN_2).sqrt();
        let [p, q, r] = each(
            #[inline(always)]
            |k| lanes.whitening[k] * unit,
        );
        let up = suu * p;
        let (uq, vq) = (suu * q + suv * r, suv * q + svv * r);
        let [tilt_x, tilt_y] = lanes.tilt;
        // Offsets are u and v over the pixels' unit, and p, q and r have it as a factor.
        let (gu, gv) = (gu * (unit * unit), gv * (unit * unit));
        let gy = gv / r;
        let gx = (gu - q * gy) / p;
        let with_z = symmetric(&lanes.tilt_inverse, &[gx, gy]);
        let [hx, hy] = with_z;
        Self {
            centre: [p * su - tilt_x * depth, q * su + r * sv - tilt_y * depth],
            covariance: [
                p * up * 0.5 - hx * tilt_x,
                p * uq - (hx * tilt_y + hy * tilt_x),
                (q * uq + r * vq) * 0.5 - hy * tilt_y,
            ],
            opacity_logit: s * (lanes.opacity_slope / lanes.opacity),
            colour: [red, green, blue],
            depth,
            with_z,
        }
    }
}

impl<S: Simd> Lanes<S> {
    /// Gradient by the parameters, and by the rows of `camera_from_world`.
    #[inline(always)]
    fn backward(
        &self,
        view: &ViewNumbers,
        grad_splat: &SplatGradientLanes<S>,
    ) -> ([f32x8<S>; PARAMETERS], LaneMatrix<S, 3, 4>) {
        let grad_axes_image = self.grad_axes_image(grad_splat);
        // J = (fx/z, 0, -fx x/z^2; 0, fy/z, -fy y/z^2) with the slope (x/z, y/z), which is bounded beside the image.
        let [across_x, across_y] = each(
            #[inline(always)]
            |i| self.inverse_z * view.focal[i],
        );
        // J^T times the gradient by the axes on the image, and what camera z of the axes gets through the tilt.
        let grad_axes_camera: LaneMatrix<S, 3, 3> = {
            let [v, w] = grad_axes_image;
            let (x, y) = (across_x * self.slope[0], across_y * self.slope[1]);
            [
                each(
                    #[inline(always)]
                    |j| v[j] * across_x,
                ),
                each(
                    #[inline(always)]
                    |j| w[j] * across_y,
                ),
                each(
                    #[inline(always)]
                    |j| self.grad_along(grad_splat, j) - (v[j] * x + w[j] * y),
                ),
            ]
        };
        // The centre moves the splat, its depth and J; the axes turn back into the world.
        let grad_x_camera = self.grad_x_camera(view, grad_splat, &grad_axes_image);
        let grad_axes_world = rotate_back(view, &grad_axes_camera);

        let zero = f32x8::splat(self.opacity.token(), 0.0);
        let mut grad_parameters = [zero; PARAMETERS];
        for j in 0..3 {
            grad_parameters[MEAN + j] = column(&view.rotation, j, &grad_x_camera);
            grad_parameters[LOG_SCALE + j] = (0..3).fold(
                zero,
                #[inline(always)]
                // An axis is exp(log scale) times its direction: its derivative is the axis itself.
                |sum, i| grad_axes_world[i][j].mul_add(self.axes_world[i][j], sum),
            );
            grad_parameters[COLOUR + j] = grad_splat.colour[j];
        }
        let grad_quaternion = self.grad_quaternion(&grad_axes_world);
        grad_parameters[ROTATION..ROTATION + 4].copy_from_slice(&grad_quaternion);
        grad_parameters[OPACITY_LOGIT] = grad_splat.opacity_logit;
        (grad_parameters, self.grad_view(&grad_axes_camera, &grad_x_camera))
    }

    /// By the camera z of axis `j` through the covariance with it.
    #[inline(always)]
    fn grad_along(&self, grad_splat: &SplatGradientLanes<S>, j: usize) -> f32x8<S> {
        let [v, w] = &self.axes_image;
        grad_splat.with_z[0].mul_add(v[j], grad_splat.with_z[1] * w[j])
    }

    /// By the axes on the image: twice the gradient by the covariance, times the axes, and that by the covariance with
    /// camera z, times the camera z of the axes.
    #[inline(always)]
    fn grad_axes_image(&self, grad_splat: &SplatGradientLanes<S>) -> LaneMatrix<S, 2, 3> {
        let [xx, xy, yy] = grad_splat.covariance;
        let (xx, yy) = (xx + xx, yy + yy);
        let [v, w] = &self.axes_image;
        let (along, [hx, hy]) = (&self.axes_camera[2], grad_splat.with_z);
        [
            each(
                #[inline(always)]
                |j| hx.mul_add(along[j], xx.mul_add(v[j], xy * w[j])),
            ),
            each(
                #[inline(always)]
                |j| hy.mul_add(along[j], xy.mul_add(v[j], yy * w[j])),
            ),
        ]
    }

    /// By the centre in the camera frame: it moves the splat, its depth, and the Jacobian that shapes it.
    #[inline(always)]
    fn grad_x_camera(
        &self,
        view: &ViewNumbers,
        grad_splat: &SplatGradientLanes<S>,
        grad_axes_image: &LaneMatrix<S, 2, 3>,
    ) -> [f32x8<S>; 3] {
        let zero = f32x8::splat(self.opacity.token(), 0.0);
        let mut grad_x = [zero, zero, grad_splat.depth];
        for i in 0..2 {
            let per_pixel = self.inverse_z * view.focal[i];
            let grad_centre = grad_splat.centre[i] * per_pixel;
            grad_x[i] = grad_centre;
            grad_x[2] -= grad_centre * (self.x_camera[i] * self.inverse_z);
            // An image axis is (across - slope along) f/z: it shrinks with z and turns with the slope.
            let shrink = dot3(&grad_axes_image[i], &self.axes_image[i]) * self.inverse_z;
            let turn = dot3(&grad_axes_image[i], &self.axes_camera[2]) * per_pixel * self.inverse_z;
            let turn = self.follows[i].select(turn, zero);
            grad_x[2] -= shrink;
            grad_x[i] -= turn;
            grad_x[2] = turn.mul_add(self.slope[i], grad_x[2]);
        }
        grad_x
    }

    /// By the quaternion through its normalisation. With t the gradient by a small turn of the axes in the world,
    /// it is `2 (0, t) q/|q|`: nothing along q, and no symmetric part that would have to cancel.
    #[inline(always)]
    fn grad_quaternion(&self, grad_axes_world: &LaneMatrix<S, 3, 3>) -> [f32x8<S>; 4] {
        let (a, g) = (&self.axes_world, grad_axes_world);
        let turn: [f32x8<S>; 3] = each(
            #[inline(always)]
            |axis| {
                let (i, k) = ((axis + 1) % 3, (axis + 2) % 3);
                let (plus, minus) = (dot3(&a[i], &g[k]), dot3(&a[k], &g[i]));
                (plus - minus) * (self.inverse_norm + self.inverse_norm)
            },
        );
        let [w, x, y, z] = self.quaternion;
        let [tx, ty, tz] = turn;
        [
            -dot3(&turn, &[x, y, z]),
            w * tx + (ty * z - tz * y),
            w * ty + (tz * x - tx * z),
            w * tz + (tx * y - ty * x),
        ]
    }

    /// By the rows of R and t.
    #[inline(always)]
    fn grad_view(
        &self,
        grad_axes_camera: &LaneMatrix<S, 3, 3>,
        grad_x_camera: &[f32x8<S>; 3],
    ) -> LaneMatrix<S, 3, 4> {
        each(
            #[inline(always)]
            |i| {
                let grad_x = grad_x_camera[i];
                let axes = &grad_axes_camera[i];
                let [x, y, z] = each(
                    #[inline(always)]
                    |j| grad_x.mul_add(self.mean[j], dot3(axes, &self.axes_world[j])),
                );
                [x, y, z, grad_x]
            },
        )
    }
}

/// Takes columns in the camera frame to the world.
#[inline(always)]
fn rotate_back<S: Simd>(view: &ViewNumbers, columns: &LaneMatrix<S, 3, 3>) -> LaneMatrix<S, 3, 3> {
    each(
        #[inline(always)]
        |i| {
            each(
                #[inline(always)]
                |j| column(&view.rotation, i, &[columns[0][j], columns[1][j], columns[2][j]]),
            )
        },
    )
}

/// Column `j` of a matrix times a vector.
#[inline(always)]
fn column<S: Simd>(matrix: &[[f32; 3]; 3], j: usize, vector: &[f32x8<S>; 3]) -> f32x8<S> {
    vector[0].mul_add(matrix[0][j], vector[1].mul_add(matrix[1][j], vector[2] * matrix[2][j]))
}
