//! Which frames become keyframes, and which keyframes are given up.

use mba_raster::exposure::blur_length;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::trajectory::ExposureTrajectory;

use mba_adjust::bundle::{BundleAdjustment, MappedFrame};

/// Movement of the picture from the nearest keyframe that makes a new view, as a fraction of the width.
const NEW_VIEW: f64 = 0.01;

/// A frame of a known view is taken if its blur is shorter than that of the keyframe there by this factor.
const SHARPER: f64 = 0.6;

/// Blur in pixels below which nothing is gained by a sharper frame.
const SHARP_PX: f64 = 1.0;

/// Share of the picture that the map does not show yet which makes a frame worth it.
pub(super) const NEW_AREA: f64 = 0.03;

/// A keyframe and how far the picture moves from it to somewhere else, in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Neighbour {
    pub(super) keyframe: usize,
    pub(super) pixels: f64,
}

/// How far the picture moves between two poses, pixels, for a scene at `depth` metres.
pub(crate) fn view_change(a: &RigidTransform, b: &RigidTransform, camera: &PinholeCamera, depth: f64) -> f64 {
    let change = blur_length(&ExposureTrajectory { start: *a, end: *b }, camera, depth);
    // Points behind a camera that has turned away project anywhere.
    let turned = a.rotation.angle_to(&b.rotation) * camera.fx;
    change.max(turned)
}

/// All keyframes by how far their view is from a pose, the nearest first.
pub(super) fn neighbours(
    bundle: &BundleAdjustment,
    world_from_camera: &RigidTransform,
    camera: &PinholeCamera,
) -> Vec<Neighbour> {
    let pixels = |MappedFrame { keyframe, state }: &MappedFrame| {
        view_change(world_from_camera, &state.path.mid(), camera, keyframe.depth)
    };
    let frames = bundle.frames.iter().enumerate();
    let mut all: Vec<Neighbour> =
        frames.map(|(keyframe, frame)| Neighbour { keyframe, pixels: pixels(frame) }).collect();
    all.sort_by(|a, b| a.pixels.total_cmp(&b.pixels).then(b.keyframe.cmp(&a.keyframe)));
    all
}

/// Whether a frame with a blur of `blur_px` should become a keyframe although the map shows all of it: if its view is
/// new, or if it is sharper than the keyframe with the nearest view.
pub(super) fn is_worth_it(
    bundle: &BundleAdjustment,
    nearest: Option<&Neighbour>,
    blur_px: f64,
    width: usize,
) -> bool {
    let Some(nearest) = nearest else { return true };
    let known = bundle.blur_px(nearest.keyframe);
    nearest.pixels > NEW_VIEW * width as f64 || (known > SHARP_PX && blur_px < SHARPER * known)
}

/// The keyframe that is missed the least: the one whose neighbour shows nearly the same, and of such two the more
/// blurred. Never the first, which says where the world is, nor the last.
pub(super) fn most_dispensable(bundle: &BundleAdjustment, camera: &PinholeCamera) -> Option<usize> {
    let last = bundle.frames.len().checked_sub(1)?;
    let loneliness = |k: usize| {
        let near = neighbours(bundle, &bundle.frames[k].state.path.mid(), camera);
        let other = near.iter().find(|near| near.keyframe != k).map_or(f64::INFINITY, |near| near.pixels);
        other / (1.0 + bundle.blur_px(k))
    };
    let candidates = (1..last).map(|k| (loneliness(k), k));
    candidates.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, k)| k)
}
