//! Everything about one virtual view that all patches share, computed once per evaluation in f64.

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector3};

use super::pattern::{PATCH_PIXELS, PATTERN_DU, PATTERN_DV};
use crate::geometry::PinholeCamera;
use crate::trajectory::{BowedTrajectory, ExposureTrajectory, FrameTiming, PathPoint, SampleRule};

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
    /// Rows of C with `phi_s = (s - 1/2)^2 C d(bow)`, see [`BowedTrajectory::bow_blend_left`].
    pub bow_blend_left: [[f32; 3]; 3],
    /// Velocity per unit of normalised time: translation in the reference frame, left rotation.
    pub velocity: [[f32; 3]; 2],
    /// Normalised time of the view: `[0, 1]` within the exposure of a global shutter.
    pub time: f32,
}

impl VirtualView {
    /// The view at normalised time `s` of `reference_from_camera`, for images of `camera`.
    #[must_use]
    pub fn new(reference_from_camera: &ExposureTrajectory, s: f64, camera: &PinholeCamera) -> Self {
        let pose = reference_from_camera.at(s);
        let rotation = pose.rotation_matrix();
        Self {
            pattern_offset: pattern_offset(&rotation, camera, &Vector3::zeros()),
            rotation: rows(&rotation),
            position: single(&pose.translation),
            blend_left: rows(&reference_from_camera.rotation_blend_left(s)),
            bow_blend_left: [[0.0; 3]; 3],
            velocity: [[0.0; 3]; 2],
            time: s as f32,
        }
    }

    /// The view at `point`, normalised time `s`, of a path with bow whose rows follow each other by `row_step` of normalised time.
    ///
    /// Within a patch that shears the pattern. The part of it that depends on the patch's depth takes that of a surface
    /// at `inverse_depth`: over the four rows of half a patch the difference is a hundredth of a pixel.
    fn of_row(point: &PathPoint, s: f64, camera: &PinholeCamera, row_step: f64, inverse_depth: f64) -> Self {
        let rotation = point.pose.rotation_matrix();
        let velocity = point.velocity_left;
        let (shift, turn) =
            (Vector3::from(velocity.fixed_rows::<3>(0)), Vector3::from(velocity.fixed_rows::<3>(3)));
        // Rows that come later see the keypoint moved on: (omega x R e_z + rho v) dt per row.
        let per_row = (turn.cross(&rotation.column(2)) + shift * inverse_depth) * row_step;
        Self {
            pattern_offset: pattern_offset(&rotation, camera, &per_row),
            rotation: rows(&rotation),
            position: single(&point.pose.translation),
            blend_left: rows(&point.rotation_blend_left),
            bow_blend_left: rows(&point.bow_blend_left),
            velocity: [single(&shift), single(&turn)],
            time: s as f32,
        }
    }
}

/// `R (du/fx, dv/fy, 0) + dv per_row` of every pattern pixel, component by component.
fn pattern_offset(
    rotation: &Matrix3<f64>,
    camera: &PinholeCamera,
    per_row: &Vector3<f64>,
) -> [[f32; PATCH_PIXELS]; 3] {
    let mut pattern_offset = [[0.0; PATCH_PIXELS]; 3];
    for k in 0..PATCH_PIXELS {
        let (du, dv) = (f64::from(PATTERN_DU[k]), f64::from(PATTERN_DV[k]));
        let rotated = rotation * Vector3::new(du / camera.fx, dv / camera.fy, 0.0) + per_row * dv;
        for (component, offsets) in pattern_offset.iter_mut().enumerate() {
            offsets[k] = rotated[component] as f32;
        }
    }
    pattern_offset
}

fn single(v: &Vector3<f64>) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

/// Most bands of rows that a frame is divided into.
pub const MAX_BANDS: usize = 16;

/// A band of rows of the current image that shares its virtual views.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowBand {
    /// First row.
    pub first: usize,
    /// Row after the last.
    pub end: usize,
    /// Rows of the image.
    pub height: usize,
}

impl RowBand {
    /// Band `index` of `count` of an image of `height` rows.
    #[must_use]
    pub fn new(index: usize, count: usize, height: usize) -> Self {
        Self { first: index * height / count, end: (index + 1) * height / count, height }
    }

    /// All rows of an image of `height` rows.
    #[must_use]
    pub fn whole(height: usize) -> Self {
        Self { first: 0, end: height, height }
    }

    /// The row in the middle; may lie between two.
    #[must_use]
    #[inline]
    pub fn centre(&self) -> f64 {
        0.5 * (self.first + self.end) as f64 - 0.5
    }

    /// Replaces `views`, which is large and stays where it is, by the `count` virtual views of the middle row of the band for
    /// a frame that is exposed as `timing` says; at most [`MAX_VIRTUAL_VIEWS`] are made. `inverse_depth` is typical of the
    /// scene, 1/m.
    pub fn fill_views(
        &self,
        path: &BowedTrajectory,
        timing: &FrameTiming,
        count: usize,
        camera: &PinholeCamera,
        inverse_depth: f64,
        views: &mut ArrayVec<VirtualView, MAX_VIRTUAL_VIEWS>,
    ) {
        let count = count.clamp(1, MAX_VIRTUAL_VIEWS);
        // Views lie in the middle of equal parts of the exposure around the row.
        let middle = timing.row_time(self.centre(), self.height);
        let row_step = timing.readout / self.height as f64;
        let time = |k: usize| middle + timing.exposure * (SampleRule::Midpoint.time(k, count) - 0.5);
        views.clear();
        let omega = path.linear.rotation_vector();
        views.extend((0..count).map(|k| {
            let s = time(k);
            VirtualView::of_row(&path.point(s, &omega), s, camera, row_step, inverse_depth)
        }));
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
