//! Points of a depth map that are compared with a keyframe's surface, eight at a time.
//!
//! # Layout and cost
//!
//! A lane is a point; the points of a row lie `stride` pixels apart. Per eight points eight gathers (the point, the four
//! pixels of the surface around it, its plane) and about 60 arithmetic operations. Lanes without a point go along with
//! harmless numbers and are masked at the end.

use fearless_simd::{f32x8, i32x8, mask32x8, prelude::*};
use nalgebra::{Matrix3, Vector3};

use super::depth_problem::DepthProblem;
use crate::geometry::RigidTransform;

/// Points of a block.
pub(super) const LANES: usize = 8;

/// `0, 1, 2...`
const ORDINALS: [f32; LANES] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// Least distance in front of the keyframe, metres.
const MIN_Z: f32 = 0.05;

/// Eight points. Where no point was compared everything is 0.
pub(super) struct DepthSamples<S: Simd> {
    /// Lanes with a point within the gate.
    pub(super) compared: mask32x8<S>,
    /// Number of points beyond the gate.
    pub(super) gated: usize,
    /// Inverse depth of the moved point minus that of the keyframe's surface, 1/m.
    pub(super) residual: f32x8<S>,
    /// Derivative of the residual by the moved point.
    pub(super) normal: [f32x8<S>; 3],
    /// The point relative to the camera centre, in keyframe axes, metres.
    pub(super) arm: [f32x8<S>; 3],
}

/// What all points at one pose share.
pub(super) struct DepthSampler<'a> {
    problem: &'a DepthProblem<'a>,
    rotation: Matrix3<f32>,
    position: Vector3<f32>,
    focal: [f32; 2],
    centre: [f32; 2],
}

impl<'a> DepthSampler<'a> {
    pub(super) fn new(problem: &'a DepthProblem<'a>, keyframe_from_camera: &RigidTransform) -> Self {
        Self {
            problem,
            rotation: keyframe_from_camera.rotation_matrix().map(|x| x as f32),
            position: keyframe_from_camera.translation.map(|x| x as f32),
            focal: [problem.camera.fx as f32, problem.camera.fy as f32],
            centre: [problem.camera.cx as f32, problem.camera.cy as f32],
        }
    }

    /// Visits all points in blocks; blocks without any measured depth are left out.
    #[inline(always)]
    pub(super) fn for_each_block<S: Simd>(&self, simd: S, mut visit: impl FnMut(&DepthSamples<S>)) {
        let (map, stride) = (self.problem.current, self.problem.stride);
        let band = self.problem.band;
        for v in (band.first.next_multiple_of(stride)..band.end.min(map.height)).step_by(stride) {
            let row = &map.values[v * map.width..][..map.width];
            for first in (0..map.width).step_by(LANES * stride) {
                let at = |lane: usize| first + lane * stride;
                let rho = match (stride, row.get(first..first + LANES * stride)) {
                    (2, Some(run)) => {
                        let (low, high) = (&run[..LANES], &run[LANES..2 * LANES]);
                        f32x8::from_slice(simd, low).unzip_low(f32x8::from_slice(simd, high))
                    }
                    (_, Some(run)) => {
                        let mut strided = [0.0; LANES];
                        for (value, cell) in strided.iter_mut().zip(run.chunks_exact(stride)) {
                            *value = cell[0];
                        }
                        f32x8::from_slice(simd, &strided)
                    }
                    _ => f32x8::from_fn(simd, |lane| row.get(at(lane)).copied().unwrap_or(0.0)),
                };
                let measured = rho.simd_gt(0.0);
                if measured.any_true() {
                    let u = f32x8::from_slice(simd, &ORDINALS) * stride as f32 + first as f32;
                    visit(&self.compare(simd, u, v as f32, rho, measured));
                }
            }
        }
    }

    /// Compares the points at columns `u` of row `v` whose inverse depth is `rho`.
    #[inline(always)]
    fn compare<S: Simd>(
        &self,
        simd: S,
        u: f32x8<S>,
        v: f32,
        rho: f32x8<S>,
        measured: mask32x8<S>,
    ) -> DepthSamples<S> {
        let splat = |value: f32| f32x8::splat(simd, value);
        let (one, zero) = (splat(1.0), splat(0.0));
        let [fx, fy] = self.focal;
        // The measured point in the keyframe: R (x, y, 1)/rho + p.
        let y = (v - self.centre[1]) * (1.0 / fy);
        let row_ray = self.rotation.column(1) * y + self.rotation.column(2);
        let x = (u - self.centre[0]) * (1.0 / fx);
        let distance = one / measured.select(rho, one);
        let arm: [f32x8<S>; 3] =
            core::array::from_fn(|i| (x * self.rotation[(i, 0)] + row_ray[i]) * distance);
        let point: [f32x8<S>; 3] = core::array::from_fn(|i| arm[i] + self.position[i]);
        let in_front = measured & point[2].simd_ge(MIN_Z);
        // Its pixel there; lanes behind the keyframe divide by one.
        let inverse_z = one / in_front.select(point[2], one);
        let (a, b) = (point[0] * inverse_z, point[1] * inverse_z);
        let (ku, kv) = (a * fx + self.centre[0], b * fy + self.centre[1]);
        let (seen, surface, plane) = self.surface(simd, in_front, ku, kv);
        // Inverse depth of the point less that of the surface; the gate keeps other surfaces out.
        let residual = inverse_z - surface;
        let near = residual.abs().simd_lt(self.problem.gate);
        let compared = seen & near & plane[0].simd_gt(0.0);
        // Derivative by the point: along the image the surface rises, along z the point moves away.
        let (su, sv) = (plane[1] * fx * inverse_z, plane[2] * fy * inverse_z);
        let along = su * a + sv * b - inverse_z * inverse_z;
        let gated = (seen & !near).to_bitmask().count_ones() as usize;
        let kept = |value: f32x8<S>| compared.select(value, zero);
        DepthSamples {
            compared,
            gated,
            residual: kept(residual),
            normal: [kept(zero - su), kept(zero - sv), kept(along)],
            arm: arm.map(kept),
        }
    }

    /// The keyframe's surface at `(ku, kv)`: lanes that see one, its inverse depth (as
    /// [`crate::surface::InverseDepthMap::sample`]), and value and slopes of the plane at the nearest pixel.
    #[inline(always)]
    fn surface<S: Simd>(
        &self,
        simd: S,
        lanes: mask32x8<S>,
        ku: f32x8<S>,
        kv: f32x8<S>,
    ) -> (mask32x8<S>, f32x8<S>, [f32x8<S>; 3]) {
        let (map, planes) = (self.problem.keyframe, self.problem.planes);
        let (seen, surface) = map.sample_lanes(simd, lanes, ku, kv);
        let zero = f32x8::splat(simd, 0.0);
        // The nearest pixel; lanes that see nothing look at the first.
        let (nearest_u, nearest_v) = (seen.select(ku, zero) + 0.5, seen.select(kv, zero) + 0.5);
        let width = i32x8::splat(simd, map.width as i32);
        let index = nearest_v.to_int::<i32x8<S>>() * width + nearest_u.to_int::<i32x8<S>>();
        // Equal lengths, so that one bounds check serves all three.
        let value = &*planes.value;
        let (slope_u, slope_v) = (&planes.slope_u[..value.len()], &planes.slope_v[..value.len()]);
        let mut plane = [[0.0; LANES]; 3];
        for (lane, &index) in index.as_slice().iter().enumerate() {
            let at = index as u32 as usize;
            (plane[0][lane], plane[1][lane], plane[2][lane]) = (value[at], slope_u[at], slope_v[at]);
        }
        let value = f32x8::from_slice(simd, &plane[0]);
        let slope_u = f32x8::from_slice(simd, &plane[1]);
        (seen, surface, [value, slope_u, f32x8::from_slice(simd, &plane[2])])
    }
}
