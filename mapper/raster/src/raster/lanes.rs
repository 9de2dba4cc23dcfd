//! Eight Gaussians at a time: from their parameters to the image plane, with all intermediate values.
//!
//! Projection and its backward pass share these steps: nothing is stored between the two.

use fearless_simd::{f32x8, mask32x8, prelude::*};

use super::constants::{FAR_PLANE, LOW_PASS, MAX_COLOUR, MIN_ALPHA, NEAR_PLANE, TILT_LOW_PASS};
use super::exp::exp;
use super::tile::TileGrid;
use super::view::RasterView;
use crate::gaussians::{COLOUR, LOG_SCALE, MEAN, OPACITY_LOGIT, PARAMETERS, ROTATION};

/// Gaussians per step.
pub(super) const LANES: usize = 8;

/// Squared lengths of quaternions below this are no orientation.
const MIN_SQUARED_NORM: f32 = 1e-20;

/// The view in the numbers of the kernels.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ViewNumbers {
    /// `camera_from_world`.
    pub(super) rotation: [[f32; 3]; 3],
    pub(super) translation: [f32; 3],
    pub(super) focal: [f32; 2],
    pub(super) centre: [f32; 2],
    /// Limits of `x/z` and `y/z` in the Jacobian.
    pub(super) limits: [[f32; 2]; 2],
    /// First and last column and row of pixel centres that are drawn.
    pub(super) first: [f32; 2],
    pub(super) last: [f32; 2],
}

impl ViewNumbers {
    pub(super) fn new(view: &RasterView) -> Self {
        let camera_from_world = view.world_from_camera.inverse();
        let rotation = camera_from_world.rotation_matrix();
        let camera = &view.camera;
        Self {
            rotation: [0, 1, 2].map(|i| [0, 1, 2].map(|j| rotation[(i, j)] as f32)),
            translation: camera_from_world.translation.map(|x| x as f32).into(),
            focal: [camera.fx as f32, camera.fy as f32],
            centre: [camera.cx as f32, camera.cy as f32],
            limits: view.jacobian_limits().map(|limits| limits.map(|limit| limit as f32)),
            first: [0.0; 2],
            last: [camera.width as f32 - 1.0, camera.height as f32 - 1.0],
        }
    }

    /// The same for the rows of a grid only.
    pub(super) fn within(self, grid: &TileGrid) -> Self {
        let [[left, _], [right, _]] = [self.first, self.last];
        Self { first: [left, grid.top() as f32], last: [right, grid.height as f32 - 1.0], ..self }
    }
}

/// A matrix of which every element is a vector over Gaussians; rows first.
pub(super) type LaneMatrix<S, const R: usize, const C: usize> = [[f32x8<S>; C]; R];

/// Eight Gaussians on their way to the image plane.
pub(super) struct Lanes<S: Simd> {
    pub(super) mean: [f32x8<S>; 3],
    pub(super) colour: [f32x8<S>; 3],
    pub(super) opacity: f32x8<S>,
    /// `o (1 - o)` without cancellation.
    pub(super) opacity_slope: f32x8<S>,
    /// Unit quaternion w x y z and the inverse of the stored one's length.
    pub(super) quaternion: [f32x8<S>; 4],
    pub(super) inverse_norm: f32x8<S>,
    /// Axes of the Gaussian as columns, in the world, in the camera frame and on the image.
    pub(super) axes_world: LaneMatrix<S, 3, 3>,
    pub(super) axes_camera: LaneMatrix<S, 3, 3>,
    pub(super) axes_image: LaneMatrix<S, 2, 3>,
    pub(super) x_camera: [f32x8<S>; 3],
    pub(super) inverse_z: f32x8<S>,
    /// `x/z` and `y/z` as the Jacobian sees them, and where they follow the centre.
    pub(super) slope: [f32x8<S>; 2],
    pub(super) follows: [mask32x8<S>; 2],
    /// Covariance on the image (xx, xy, yy) and its determinant.
    pub(super) covariance: [f32x8<S>; 3],
    pub(super) determinant: f32x8<S>,
    /// Inverse (xx, xy, yy) of the covariance with the low-pass of the tilt.
    pub(super) tilt_inverse: [f32x8<S>; 3],
    /// Metres of camera z per pixel to the right and down at which the depth changes.
    pub(super) tilt: [f32x8<S>; 2],
    /// Elements uu, uv and vv of the upper triangular W with `W^T W` the inverse of the covariance.
    pub(super) whitening: [f32x8<S>; 3],
    /// Projected centre in pixels.
    pub(super) centre: [f32x8<S>; 2],
    /// Whether everything above makes sense and the Gaussian is in front of the camera.
    pub(super) drawn: mask32x8<S>,
}

/// What `f` makes of every index. Unlike the library's functions it is always inlined: a call out of line is not
/// compiled for the instruction set of its caller.
#[inline(always)]
pub(super) fn each<T: Copy, const N: usize>(f: impl Fn(usize) -> T) -> [T; N] {
    let mut out = [f(0); N];
    for (k, element) in out.iter_mut().enumerate().skip(1) {
        *element = f(k);
    }
    out
}

/// The Gaussians `first..` of every plane, zeros after the last.
#[inline(always)]
pub(super) fn load<S: Simd>(simd: S, planes: &[&[f32]; PARAMETERS], first: usize) -> [f32x8<S>; PARAMETERS] {
    each(
        #[inline(always)]
        |plane| match planes[plane].get(first..first + LANES) {
            Some(whole) => f32x8::from_slice(simd, whole),
            None => {
                let rest = planes[plane].get(first..).unwrap_or_default();
                let mut padded = [0.0; LANES];
                padded[..rest.len()].copy_from_slice(rest);
                f32x8::from_slice(simd, &padded)
            }
        },
    )
}

impl<S: Simd> Lanes<S> {
    #[inline(always)]
    pub(super) fn new(simd: S, view: &ViewNumbers, parameters: &[f32x8<S>; PARAMETERS]) -> Self {
        let p = parameters;
        let one = f32x8::splat(simd, 1.0);
        let mean = [p[MEAN], p[MEAN + 1], p[MEAN + 2]];
        let colour = [p[COLOUR], p[COLOUR + 1], p[COLOUR + 2]];
        let scale = [exp(p[LOG_SCALE]), exp(p[LOG_SCALE + 1]), exp(p[LOG_SCALE + 2])];
        let odds = exp(-p[OPACITY_LOGIT]);
        let opacity = one / (odds + 1.0);

        let stored = [p[ROTATION], p[ROTATION + 1], p[ROTATION + 2], p[ROTATION + 3]];
        let squared_norm = dot4(&stored, &stored);
        let inverse_norm = one / squared_norm.sqrt();
        let quaternion = each(
            #[inline(always)]
            |k| stored[k] * inverse_norm,
        );
        let orientation = orientation(&quaternion);
        let axes_world = each(
            #[inline(always)]
            |i| {
                let [x, y, z] = orientation[i];
                [x * scale[0], y * scale[1], z * scale[2]]
            },
        );
        let axes_camera: LaneMatrix<S, 3, 3> = each(
            #[inline(always)]
            |i| combine_rows(&view.rotation[i], &axes_world),
        );

        let x_camera = transform(view, &mean);
        let inverse_z = one / x_camera[2];
        let exact = [x_camera[0] * inverse_z, x_camera[1] * inverse_z];
        let slope = each(
            #[inline(always)]
            |i| exact[i].max(view.limits[i][0]).min(view.limits[i][1]),
        );
        let axes_image = each(
            #[inline(always)]
            |i| image_axes(view.focal[i], inverse_z, slope[i], &axes_camera[i], &axes_camera[2]),
        );
        let (covariance, determinant) = covariance(&axes_image, LOW_PASS);
        let (tilt_inverse, tilt) = tilt(&axes_image, &axes_camera[2]);
        let inverse = one / (determinant * covariance[2]).sqrt();
        let whitening = [covariance[2] * inverse, -covariance[1] * inverse, one / covariance[2].sqrt()];
        let centre = each(
            #[inline(always)]
            |i| exact[i].mul_add(view.focal[i], view.centre[i]),
        );

        // A sum of numbers is finite only if all are: infinities and NaN fail every comparison below.
        let (mut input, mut output) = (one, determinant * 0.0);
        for &value in p {
            input += value * 0.0;
        }
        for value in [whitening[0], whitening[1], whitening[2], centre[0], centre[1], tilt[0], tilt[1]] {
            output += value * 0.0;
        }
        let sane = (input + output).simd_eq(1.0);
        let depth = x_camera[2].simd_gt(NEAR_PLANE as f32) & x_camera[2].simd_lt(FAR_PLANE as f32);
        let brightest = colour[0].abs().max(colour[1].abs()).max(colour[2].abs());
        let visible = depth & brightest.simd_lt(MAX_COLOUR as f32) & opacity.simd_ge(MIN_ALPHA as f32);
        Self {
            mean,
            colour,
            opacity,
            opacity_slope: odds * opacity * opacity,
            quaternion,
            inverse_norm,
            axes_world,
            axes_camera,
            axes_image,
            x_camera,
            inverse_z,
            slope,
            follows: [slope[0].simd_eq(exact[0]), slope[1].simd_eq(exact[1])],
            covariance,
            determinant,
            tilt_inverse,
            tilt,
            whitening,
            centre,
            drawn: sane & visible & squared_norm.simd_gt(MIN_SQUARED_NORM),
        }
    }
}

/// A point of the world in the camera frame.
#[inline(always)]
fn transform<S: Simd>(view: &ViewNumbers, mean: &[f32x8<S>; 3]) -> [f32x8<S>; 3] {
    each(
        #[inline(always)]
        |i| {
            let [a, b, c] = view.rotation[i];
            mean[0].mul_add(a, mean[1].mul_add(b, mean[2].mul_add(c, view.translation[i])))
        },
    )
}

/// The row `weights` times a matrix.
#[inline(always)]
fn combine_rows<S: Simd>(weights: &[f32; 3], matrix: &LaneMatrix<S, 3, 3>) -> [f32x8<S>; 3] {
    each(
        #[inline(always)]
        |j| matrix[0][j].mul_add(weights[0], matrix[1][j].mul_add(weights[1], matrix[2][j] * weights[2])),
    )
}

/// One row of the Jacobian, `(f/z, -f slope/z)`, times the axes.
#[inline(always)]
fn image_axes<S: Simd>(
    focal: f32,
    inverse_z: f32x8<S>,
    slope: f32x8<S>,
    across: &[f32x8<S>; 3],
    along: &[f32x8<S>; 3],
) -> [f32x8<S>; 3] {
    each(
        #[inline(always)]
        |j| (across[j] - slope * along[j]) * (inverse_z * focal),
    )
}

/// Covariance with a low-pass, and its determinant. With the axes as vectors v and w, the determinant is
/// `|v x w|^2 + k (|v|^2 + |w|^2) + k^2`, which does not cancel for needles.
#[inline(always)]
fn covariance<S: Simd>(axes: &LaneMatrix<S, 2, 3>, low_pass: f64) -> ([f32x8<S>; 3], f32x8<S>) {
    let low_pass = low_pass as f32;
    let [v, w] = axes;
    let (vv, vw, ww) = (dot3(v, v), dot3(v, w), dot3(w, w));
    let cross = [v[1] * w[2] - v[2] * w[1], v[2] * w[0] - v[0] * w[2], v[0] * w[1] - v[1] * w[0]];
    let determinant = (vv + ww) * low_pass + low_pass * low_pass + dot3(&cross, &cross);
    ([vv + low_pass, vw, ww + low_pass], determinant)
}

/// Inverse of the covariance with the low-pass of the tilt, and the tilt: that inverse times the covariance of the offset
/// on the image with camera z. Along the straight ray of the affine projection, the density peaks at the mean of z that
/// is given the offset.
#[inline(always)]
fn tilt<S: Simd>(axes: &LaneMatrix<S, 2, 3>, along: &[f32x8<S>; 3]) -> ([f32x8<S>; 3], [f32x8<S>; 2]) {
    let ([xx, xy, yy], determinant) = covariance(axes, TILT_LOW_PASS);
    let inverse = [yy / determinant, -xy / determinant, xx / determinant];
    let with_z = [dot3(&axes[0], along), dot3(&axes[1], along)];
    (inverse, symmetric(&inverse, &with_z))
}

/// A symmetric matrix (xx, xy, yy) times a vector.
#[inline(always)]
pub(super) fn symmetric<S: Simd>(matrix: &[f32x8<S>; 3], vector: &[f32x8<S>; 2]) -> [f32x8<S>; 2] {
    let ([xx, xy, yy], [x, y]) = (*matrix, *vector);
    [xx.mul_add(x, xy * y), xy.mul_add(x, yy * y)]
}

#[inline(always)]
fn orientation<S: Simd>(quaternion: &[f32x8<S>; 4]) -> LaneMatrix<S, 3, 3> {
    let [w, x, y, z] = *quaternion;
    let (x2, y2, z2) = (x + x, y + y, z + z);
    let (xx, yy, zz) = (x * x2, y * y2, z * z2);
    let (xy, xz, yz) = (x * y2, x * z2, y * z2);
    let (wx, wy, wz) = (w * x2, w * y2, w * z2);
    let one = f32x8::splat(w.token(), 1.0);
    [
        [one - (yy + zz), xy - wz, xz + wy],
        [xy + wz, one - (xx + zz), yz - wx],
        [xz - wy, yz + wx, one - (xx + yy)],
    ]
}

#[inline(always)]
pub(super) fn dot3<S: Simd>(a: &[f32x8<S>; 3], b: &[f32x8<S>; 3]) -> f32x8<S> {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

#[inline(always)]
fn dot4<S: Simd>(a: &[f32x8<S>; 4], b: &[f32x8<S>; 4]) -> f32x8<S> {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2].mul_add(b[2], a[3] * b[3])))
}
