//! Scalar transfer of a patch: predicted intensities and their derivatives.

use crate::math::floor_to_i32;
use crate::transfer::pattern::{PATCH_PIXELS, PATTERN_DU, PATTERN_DV};
use crate::transfer::problem::{LevelImage, PatchRows, PatchSite, PatchValues, TransferProblem};
use crate::transfer::virtual_view::VirtualView;

/// Smallest distance from a virtual camera to the keypoint's plane, metres: nearer or behind, the transfer is
/// mirrored or meaningless.
pub const MIN_PLANE_DISTANCE: f32 = 0.02;

/// Smallest z of a viewing ray in the reference frame: below, the ray does not meet the plane in front.
pub const MIN_RAY_Z: f32 = 0.05;

/// Bilinear value and its exact gradient at `(u, v)`, or `None` outside `[0, W-1] x [0, H-1]`.
///
/// The gradient is that of the interpolant itself, so it is consistent with the cost and needs no gradient images.
#[must_use]
pub fn sample(image: &LevelImage, u: f32, v: f32) -> Option<(f32, f32, f32)> {
    let (w, h) = (image.width, image.height);
    let inside = u >= 0.0 && v >= 0.0 && u <= (w - 1) as f32 && v <= (h - 1) as f32;
    if !inside {
        return None;
    }
    // The last column and row belong to the cell before them.
    let i = (floor_to_i32(u) as usize).min(w - 2);
    let j = (floor_to_i32(v) as usize).min(h - 2);
    let (fu, fv) = (u - i as f32, v - j as f32);
    let top = &image.pixels[j * w + i..][..2];
    let bottom = &image.pixels[(j + 1) * w + i..][..2];
    let (du_top, du_bottom) = (top[1] - top[0], bottom[1] - bottom[0]);
    // Along both rows, then between them; the gradient is that of the same surface.
    let t0 = top[0] + fu * du_top;
    let t1 = bottom[0] + fu * du_bottom;
    Some((t0 + fv * (t1 - t0), du_top + fv * (du_bottom - du_top), t1 - t0))
}

/// A pixel of a virtual view transferred into the reference image.
#[derive(Clone, Copy, Debug)]
pub struct Transferred {
    /// Column in the reference image.
    pub u: f32,
    /// Row in the reference image.
    pub v: f32,
    /// `r_x/r_z` of the viewing ray in the reference frame.
    pub a: f32,
    /// `r_y/r_z` of the viewing ray in the reference frame.
    pub b: f32,
}

/// What a patch and a virtual view share for all pixels of the patch.
struct PatchView {
    ray: [f32; 3],
    inverse_depth: f32,
    plane_distance: f32,
    slope: [f32; 2],
    shift: [f32; 2],
}

impl PatchView {
    fn new(problem: &TransferProblem, view: &VirtualView, site: &PatchSite) -> Self {
        let x = (f32::from(site.u) - problem.centre[0]) / problem.focal[0];
        let y = (f32::from(site.v) - problem.centre[1]) / problem.focal[1];
        // Ray through the keypoint, and the distance of its plane from the centre of the view.
        let rho = site.inverse_depth;
        let plane_distance = 1.0 / rho - view.position[2];
        Self {
            ray: core::array::from_fn(|i| {
                view.rotation[i][0] * x + view.rotation[i][1] * y + view.rotation[i][2]
            }),
            inverse_depth: rho,
            plane_distance,
            slope: [problem.focal[0] * rho * plane_distance, problem.focal[1] * rho * plane_distance],
            shift: [
                problem.centre[0] + problem.focal[0] * rho * view.position[0],
                problem.centre[1] + problem.focal[1] * rho * view.position[1],
            ],
        }
    }

    fn transfer(&self, view: &VirtualView, pixel: usize) -> Option<Transferred> {
        let r: [f32; 3] = core::array::from_fn(|i| self.ray[i] + view.pattern_offset[i][pixel]);
        if !(r[2] > MIN_RAY_Z && self.plane_distance > MIN_PLANE_DISTANCE && self.inverse_depth > 0.0) {
            return None;
        }
        // Perspective division, then u = c + f rho (p + w a).
        let z = 1.0 / r[2];
        let (a, b) = (r[0] * z, r[1] * z);
        Some(Transferred { u: self.slope[0] * a + self.shift[0], v: self.slope[1] * b + self.shift[1], a, b })
    }
}

/// Whether pattern pixel `k` of the patch lies in the current image.
fn observed(problem: &TransferProblem, site: &PatchSite, k: usize) -> bool {
    let u = i32::from(site.u) + PATTERN_DU[k];
    let v = i32::from(site.v) + PATTERN_DV[k];
    u >= 0 && v >= 0 && u < problem.current.width as i32 && v < problem.current.height as i32
}

/// Predicted intensities of a patch: the mean over all virtual views.
pub fn patch_values(problem: &TransferProblem, site: &PatchSite, out: &mut PatchValues) {
    let scale = 1.0 / problem.views.len() as f32;
    *out = PatchValues::default();
    for k in 0..PATCH_PIXELS {
        // A pixel counts only where every view of the exposure sees it.
        let mut sum = 0.0;
        let mut all_valid = observed(problem, site, k);
        for view in problem.views {
            let patch_view = PatchView::new(problem, view, site);
            let sampled = patch_view.transfer(view, k).and_then(|t| sample(&problem.reference, t.u, t.v));
            match sampled {
                Some((value, _, _)) => sum += value,
                None => all_valid = false,
            }
        }
        if all_valid && (sum * scale).is_finite() {
            out.mean[k] = sum * scale;
            out.valid[k] = 1.0;
        }
    }
}

/// Predicted intensities of a patch and their derivatives by the poses at shutter opening and closing.
///
/// Rows are for left rotations; [`crate::trajectory::left_from_right`] converts accumulated normal equations.
pub fn patch_rows(problem: &TransferProblem, site: &PatchSite, out: &mut PatchRows) {
    let scale = 1.0 / problem.views.len() as f32;
    *out = PatchRows::default();
    for k in 0..PATCH_PIXELS {
        let mut sum = 0.0;
        let mut row = [0.0f32; 12];
        let mut all_valid = observed(problem, site, k);
        for view in problem.views {
            let patch_view = PatchView::new(problem, view, site);
            let sampled = patch_view
                .transfer(view, k)
                .and_then(|t| sample(&problem.reference, t.u, t.v).map(|s| (t, s)));
            let Some((t, (value, gu, gv))) = sampled else {
                all_valid = false;
                continue;
            };
            sum += value;
            // The chain: sampled light by the pose of its view, that pose by both ends of the path.
            let (translation, rotation) = pose_row(&patch_view, &t, gu, gv);
            accumulate_ends(view, &translation, &rotation, &mut row);
        }
        if all_valid && (sum * scale).is_finite() && row.iter().all(|entry| entry.is_finite()) {
            out.values.mean[k] = sum * scale;
            out.values.valid[k] = 1.0;
            // The mean over the views, as for the light itself.
            for (column, value) in out.pose.iter_mut().zip(row) {
                column[k] = value * scale;
            }
        }
    }
}

/// Derivative of a sampled intensity by the pose of its virtual view: (translation, left rotation).
fn pose_row(patch_view: &PatchView, t: &Transferred, gu: f32, gv: f32) -> ([f32; 3], [f32; 3]) {
    let big_a = gu * patch_view.slope[0];
    let big_c = gv * patch_view.slope[1];
    // With A = g_u m_u, C = g_v m_v and e = a A + b C, as at the vectorised twin.
    let e = t.a * big_a + t.b * big_c;
    let per_distance = 1.0 / patch_view.plane_distance;
    (
        [big_a * per_distance, big_c * per_distance, -e * per_distance],
        [-(t.b * e + big_c), t.a * e + big_a, t.a * big_c - t.b * big_a],
    )
}

/// Distributes the row of one virtual view to the poses at both ends of the exposure.
fn accumulate_ends(view: &VirtualView, translation: &[f32; 3], rotation: &[f32; 3], row: &mut [f32; 12]) {
    for i in 0..3 {
        row[i] += (1.0 - view.time) * translation[i];
        row[6 + i] += view.time * translation[i];
    }
    // phi_s = (I - B_L) phi_start + B_L phi_end.
    for j in 0..3 {
        let to_end: f32 = (0..3).map(|i| rotation[i] * view.blend_left[i][j]).sum();
        row[9 + j] += to_end;
        row[3 + j] += rotation[j] - to_end;
    }
}
