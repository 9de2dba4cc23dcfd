//! A camera that chooses its exposure time by itself.

use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use rayon::prelude::*;

use super::motion::CameraPath;
use super::scene::Scene;
use super::view::View;
use super::{SynthConfig, timing};

/// Shortest and longest exposure in units of the one that is set: 7 and 18 ms for the usual 16.
pub(super) const RANGE: [f64; 2] = [7.0 / 16.0, 18.0 / 16.0];

/// The exposure that a scene of mean brightness gets, in the same units: the geometric middle of the range.
const USUAL: f64 = 0.701_56;

/// Power of the brightness asked for over that of the picture by which the exposure changes from frame to frame.
/// Below 1, as in cameras, so that a change takes some frames.
const HASTE: f64 = 0.5;

/// Pixels across and down at which brightness is sampled.
const GRID: [usize; 2] = [16, 12];

/// Luminance of linear R, G, B (ITU-R BT.709).
const LUMINANCE: glam::Vec3 = glam::Vec3::new(0.2126, 0.7152, 0.0722);

/// Exposure time of each frame along the path, seconds: the one that is set or, with auto exposure, one that follows
/// the brightness of the picture before, from the longest on. The gain stays, so pictures are brighter or darker for
/// some frames, as those of a camera at a fixed ISO speed.
pub(super) fn exposures(
    config: &SynthConfig,
    scene: &Scene,
    camera: &PinholeCamera,
    path: &CameraPath,
) -> Vec<f64> {
    if !config.sensor.auto_exposure {
        return vec![config.exposure_seconds; config.frames];
    }
    let pose = |index: usize| path.pose(timing::on_path(config, index, timing::timestamp(config, index)));
    // Collected in order: the mean must not depend on the threads.
    let of_scene: Vec<f64> = (0..config.frames)
        .into_par_iter()
        .map(|index| config.gain * brightness(scene, camera, &pose(index)))
        .collect();
    // The mean of all frames is to look as bright as usual; each frame is then brighter or darker than that.
    let wanted = USUAL * of_scene.iter().sum::<f64>() / of_scene.len() as f64;
    let interval = 1.0 / config.frame_rate;
    let [shortest, longest] = RANGE.map(|share| (share * config.exposure_seconds).min(interval));
    // Files hold whole microseconds.
    let rounded = |seconds: f64| ((seconds * 1e6).round() / 1e6).min(interval);
    let mut exposure = rounded(longest);
    let chosen = of_scene.iter().enumerate().map(|(index, of_scene)| {
        let used = exposure;
        let seen = match config.events.flood(index) {
            // What a white picture tells is that it is at least as bright as can be.
            Some(value) => f64::from(value) / 255.0,
            None => of_scene * used / config.exposure_seconds,
        };
        let next = used * (wanted / seen.max(1e-9)).powf(HASTE);
        exposure = rounded(next.clamp(shortest, longest));
        used
    });
    chosen.collect()
}

/// Mean luminance of the scene from a pose, where 1 is full scale.
fn brightness(scene: &Scene, camera: &PinholeCamera, world_from_camera: &RigidTransform) -> f64 {
    let view = View::new(camera, world_from_camera);
    let everything = scene.everything();
    let cells = GRID[0] * GRID[1];
    let at = |cell: usize| {
        let along =
            |index: usize, count: usize, size: usize| (index as f32 + 0.5) / count as f32 * size as f32 - 0.5;
        let ray = view
            .ray(along(cell % GRID[0], GRID[0], camera.width), along(cell / GRID[0], GRID[1], camera.height));
        let light = scene.radiance(&ray, &scene.hit(&ray, &everything), view.pixel_angle);
        f64::from(light.min(glam::Vec3::ONE).dot(LUMINANCE))
    };
    (0..cells).map(at).sum::<f64>() / cells as f64
}
