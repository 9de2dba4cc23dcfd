//! Everything about one virtual view that all patches share, computed once per evaluation in f64.

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector3};

use super::pattern::{PATCH_PIXELS, PATTERN_DU, PATTERN_DV};
use crate::geometry::PinholeCamera;
use crate::trajectory::{ExposureTrajectory, SampleRule};

/// Upper bound of the virtual views of one exposure.
pub const MAX_VIRTUAL_VIEWS: usize = 32;

/// One sharp virtual view of an exposure, in the precision of the kernels.
///
/// Aligned and with the arrays first, so that no vector of them straddles two cache lines.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub struct VirtualView {
    /// `R (du/fx, dv/fy, 0)` of every pattern pixel: one array per component.
    pub pattern_offset: [[f32; PATCH_PIXELS]; 3],
    /// Rows of R in `reference_from_camera`.
    pub rotation: [[f32; 3]; 3],
    /// Camera centre in the reference frame, metres.
    pub position: [f32; 3],
    /// Rows of `B_L` with `phi_s = (I - B_L) phi_start + B_L phi_end`.
    pub blend_left: [[f32; 3]; 3],
    /// Normalised time of the view in the exposure, `[0, 1]`.
    pub time: f32,
}

impl VirtualView {
    /// The view at normalised time `s` of `reference_from_camera`, for images of `camera`.
    #[must_use]
    pub fn new(reference_from_camera: &ExposureTrajectory, s: f64, camera: &PinholeCamera) -> Self {
        let pose = reference_from_camera.at(s);
        let rotation = pose.rotation_matrix();
        let mut pattern_offset = [[0.0; PATCH_PIXELS]; 3];
        for k in 0..PATCH_PIXELS {
            let ray_offset =
                Vector3::new(f64::from(PATTERN_DU[k]) / camera.fx, f64::from(PATTERN_DV[k]) / camera.fy, 0.0);
            let rotated = rotation * ray_offset;
            for (component, offsets) in pattern_offset.iter_mut().enumerate() {
                offsets[k] = rotated[component] as f32;
            }
        }
        Self {
            rotation: rows(&rotation),
            position: [pose.translation.x as f32, pose.translation.y as f32, pose.translation.z as f32],
            blend_left: rows(&reference_from_camera.rotation_blend_left(s)),
            time: s as f32,
            pattern_offset,
        }
    }
}

/// The `count` virtual views of an exposure; at most [`MAX_VIRTUAL_VIEWS`] are made.
#[must_use]
pub fn virtual_views(
    reference_from_camera: &ExposureTrajectory,
    count: usize,
    rule: SampleRule,
    camera: &PinholeCamera,
) -> ArrayVec<VirtualView, MAX_VIRTUAL_VIEWS> {
    let count = count.clamp(1, MAX_VIRTUAL_VIEWS);
    (0..count).map(|k| VirtualView::new(reference_from_camera, rule.time(k, count), camera)).collect()
}

fn rows(m: &Matrix3<f64>) -> [[f32; 3]; 3] {
    core::array::from_fn(|i| core::array::from_fn(|j| m[(i, j)] as f32))
}
