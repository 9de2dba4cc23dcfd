//! How far the image moves while the shutter is open, and how strongly to shake for a given figure.

use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;

use super::SynthError;
use super::motion::CameraPath;
use super::scene::Scene;
use super::view::View;

/// Motion of the image over one exposure, in pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlurFigure {
    /// Mean over the image of the distance between a surface point's place at shutter opening and at closing.
    pub mean_px: f64,
    /// 95th percentile of the same.
    pub p95_px: f64,
    /// Longest way of a point from opening over mid exposure to closing.
    pub longest_path_px: f64,
}

/// Poses at shutter opening, mid exposure and closing, `world_from_camera`.
pub(super) type ExposurePoses = [RigidTransform; 3];

/// Pixels on each side of the grid on which displacements are sampled.
const GRID: [usize; 2] = [24, 18];

/// The figure for the scene as seen from the middle pose.
pub(super) fn measure(
    scene: &Scene,
    camera: &PinholeCamera,
    poses: &ExposurePoses,
    grid: [usize; 2],
) -> BlurFigure {
    let [start, mid, end] = poses;
    let view = View::new(camera, mid);
    let everything = scene.everything();
    let (camera_from_world, ends) = (mid, [start.inverse(), end.inverse()]);
    let mut lengths = Vec::with_capacity(grid[0] * grid[1]);
    let mut longest = 0.0_f64;
    for cell in 0..grid[0] * grid[1] {
        let along =
            |index: usize, count: usize, size: usize| (index as f64 + 0.5) / count as f64 * size as f64 - 0.5;
        // The middle of a cell of the grid, on the surface that mid exposure shows there.
        let pixel = Vector2::new(
            along(cell % grid[0], grid[0], camera.width),
            along(cell / grid[0], grid[1], camera.height),
        );
        let depth = f64::from(scene.hit(&view.ray(pixel.x as f32, pixel.y as f32), &everything).distance);
        let point: Vector3<f64> = camera_from_world.transform_point(&(camera.ray(pixel.x, pixel.y) * depth));
        let [at_start, at_end] = ends.map(|end| end.transform_point(&point));
        // Too close to the image plane to have a meaningful place.
        if at_start.z < 0.05 || at_end.z < 0.05 {
            continue;
        }
        let [from, to] = [camera.project(&at_start), camera.project(&at_end)];
        lengths.push((to - from).norm());
        longest = longest.max((pixel - from).norm() + (to - pixel).norm());
    }
    figure(lengths, longest)
}

fn figure(mut lengths: Vec<f64>, longest_path_px: f64) -> BlurFigure {
    if lengths.is_empty() {
        return BlurFigure::default();
    }
    lengths.sort_by(f64::total_cmp);
    let mean_px = lengths.iter().sum::<f64>() / lengths.len() as f64;
    let p95_px = lengths[(lengths.len() - 1) * 95 / 100];
    BlurFigure { mean_px, p95_px, longest_path_px }
}

/// The figure of one exposure.
pub(super) fn of_exposure(scene: &Scene, camera: &PinholeCamera, poses: &ExposurePoses) -> BlurFigure {
    measure(scene, camera, poses, GRID)
}

/// The path scaled so that the mean blur over all exposures, of which `exposures` gives the poses along a path, is
/// `requested` px. `usual_exposure` in seconds is for the message.
pub(super) fn scale_to_blur(
    path: &CameraPath,
    scene: &Scene,
    camera: &PinholeCamera,
    exposures: impl Fn(&CameraPath) -> Vec<ExposurePoses>,
    requested: f64,
    usual_exposure: f64,
) -> Result<CameraPath, SynthError> {
    let mean_blur = |strength: f64| {
        let exposures = exposures(&path.with_strength(strength));
        // The mean over hundreds of frames needs few pixels of each.
        let grid = if exposures.len() > 60 { [8, 6] } else { GRID };
        // Collected in order: the sum must not depend on the threads.
        let of_frame = |poses: &ExposurePoses| measure(scene, camera, poses, grid).mean_px;
        let means: Vec<f64> = exposures.par_iter().map(of_frame).collect();
        means.iter().sum::<f64>() / means.len() as f64
    };
    if requested <= 0.0 {
        return Ok(path.with_strength(0.0));
    }
    let least = mean_blur(0.0);
    if requested < least {
        return Err(SynthError::BlurOfTheWay { requested, least });
    }
    let reachable = mean_blur(path.strongest());
    if reachable < requested {
        let exposure_seconds = usual_exposure;
        return Err(SynthError::BlurOutOfReach { requested, exposure_seconds, reachable });
    }
    let (mut low, mut high) = (0.0, path.strongest());
    while high - low > 1e-4 * high {
        let middle = 0.5 * (low + high);
        if mean_blur(middle) < requested { low = middle } else { high = middle }
    }
    Ok(path.with_strength(high))
}
