//! How far the image moves during an exposure.

use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use nalgebra::Vector2;

/// Blur lengths of one frame, over a grid of its pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlurStatistics {
    /// Mean distance between the images of a surface point at shutter opening and closing, pixels.
    pub mean: f64,
    /// 95th percentile of that distance, pixels.
    pub p95: f64,
    /// Mean length of the path in between, pixels.
    pub path_mean: f64,
    /// 95th percentile of the path length, pixels.
    pub path_p95: f64,
}

/// Distance from opening to closing, and length of the path, for one pixel.
#[derive(Clone, Copy)]
pub(super) struct Streak {
    pub(super) chord: f64,
    pub(super) path: f64,
}

/// The streak that the surface at depth `z` in pixel `(u, v)` of the camera at `mid` leaves when the camera takes
/// the poses of `views` one after the other (`camera_from_world` each).
///
/// `None` where the point comes behind a camera.
pub(super) fn streak(
    camera: &PinholeCamera,
    mid: &RigidTransform,
    views: &[RigidTransform],
    (u, v): (f64, f64),
    z: f64,
) -> Option<Streak> {
    let world = mid.transform_point(&(camera.ray(u, v) * z));
    let (mut first, mut previous, mut path) = (None::<Vector2<f64>>, None::<Vector2<f64>>, 0.0);
    for camera_from_world in views {
        let x = camera_from_world.transform_point(&world);
        if x.z < 0.05 {
            return None;
        }
        let pixel = camera.project(&x);
        path += previous.map_or(0.0, |previous| (pixel - previous).norm());
        previous = Some(pixel);
        first = first.or(previous);
    }
    let chord = (previous? - first?).norm();
    Some(Streak { chord, path })
}

impl BlurStatistics {
    /// Means and percentiles; all zero without streaks.
    pub(super) fn of(streaks: &[Streak]) -> Self {
        let (mean, p95) = mean_and_p95(streaks.iter().map(|streak| streak.chord).collect());
        let (path_mean, path_p95) = mean_and_p95(streaks.iter().map(|streak| streak.path).collect());
        Self { mean, p95, path_mean, path_p95 }
    }
}

fn mean_and_p95(mut values: Vec<f64>) -> (f64, f64) {
    if values.is_empty() {
        return (0.0, 0.0);
    }
    values.sort_by(f64::total_cmp);
    let rank = ((values.len() - 1) as f64 * 0.95).round() as usize;
    (values.iter().sum::<f64>() / values.len() as f64, values[rank])
}
