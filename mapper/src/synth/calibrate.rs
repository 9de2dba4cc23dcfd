//! How much the hand must shake for the blur that was asked for.

use mba_tracker::geometry::PinholeCamera;

use super::SynthError;
use super::blur::streak;
use super::config::{CameraMotion, SynthConfig};
use super::render::depth_at;
use super::scene::Scene;
use super::sequence::{FIRST_TIMESTAMP, timestamp};
use super::trajectory::{HandheldPath, Sweep};

/// Most frames that are looked at.
const FRAMES: usize = 100;

/// Pixels that are looked at in each frame.
const COLUMNS: usize = 8;
const ROWS: usize = 6;

/// Largest share of the blur that the sweep may cause; the rest is shake.
const SWEEP_SHARE: f64 = 0.5;

/// Largest shake, rad/s.
const MAX_SHAKE: f64 = 10.0;

/// The path with reach and shake set as the settings ask.
pub(super) fn path_for(
    config: &SynthConfig,
    camera: &PinholeCamera,
    scene: &Scene,
    sweep: Sweep,
) -> Result<HandheldPath, SynthError> {
    let duration = (config.frames.max(2) - 1) as f64 / config.frame_rate;
    let mut path = HandheldPath::new(sweep, FIRST_TIMESTAMP, duration, config.seed);
    match config.motion {
        CameraMotion::Still => path.reach = 0.0,
        CameraMotion::Shake(rate) => path.shake = rate,
        CameraMotion::MeanBlur(requested) => {
            let blur = |path: &HandheldPath| mean_blur(config, camera, scene, path);
            let from_sweep = blur(&path);
            if from_sweep > SWEEP_SHARE * requested {
                path.reach *= SWEEP_SHARE * requested / from_sweep;
            }
            path.shake = shake_for(requested, &path, blur).ok_or(SynthError::BlurOutOfReach {
                requested,
                exposure_seconds: config.exposure_seconds,
                needed: requested / (camera.fx * config.exposure_seconds),
            })?;
        }
    }
    Ok(path)
}

/// The shake at which `blur` takes the requested value, by the secant rule inside a bracket: blur grows almost
/// linearly with shake. `None` if it is beyond [`MAX_SHAKE`].
fn shake_for(requested: f64, path: &HandheldPath, blur: impl Fn(&HandheldPath) -> f64) -> Option<f64> {
    if requested == 0.0 {
        return Some(0.0);
    }
    let excess = |shake: f64| blur(&path.with_shake(shake)) - requested;
    let (mut low, mut high) = ((0.0, excess(0.0)), (0.1, excess(0.1)));
    while high.1 < 0.0 {
        if high.0 >= MAX_SHAKE {
            return None;
        }
        let next = (high.0 * 2.0).min(MAX_SHAKE);
        (low, high) = (high, (next, excess(next)));
    }
    for _ in 0..12 {
        let shake = low.0 - low.1 * (high.0 - low.0) / (high.1 - low.1);
        let middle = (shake, excess(shake));
        if middle.1.abs() < 1e-3 * requested {
            return Some(shake);
        }
        if middle.1 < 0.0 { low = middle } else { high = middle }
    }
    Some(0.5 * (low.0 + high.0))
}

/// Mean blur over a sparse grid of pixels and frames.
fn mean_blur(config: &SynthConfig, camera: &PinholeCamera, scene: &Scene, path: &HandheldPath) -> f64 {
    let step = config.frames.div_ceil(FRAMES);
    let (mut sum, mut count) = (0.0, 0_u32);
    for frame in (0..config.frames).step_by(step) {
        let t = timestamp(config, frame);
        let half = 0.5 * config.exposure_seconds;
        let mid = path.world_from_camera(t);
        let ends = [t - half, t + half].map(|t| path.world_from_camera(t).inverse());
        for cell in 0..ROWS * COLUMNS {
            let share = |k: usize, n: usize| (k as f64 + 0.5) / n as f64;
            let u = share(cell % COLUMNS, COLUMNS) * camera.width as f64 - 0.5;
            let v = share(cell / COLUMNS, ROWS) * camera.height as f64 - 0.5;
            let length = depth_at(scene, camera, &mid, (u, v))
                .and_then(|z| streak(camera, &mid, &ends, (u, v), z))
                .map(|streak| streak.chord);
            if let Some(length) = length {
                sum += length;
                count += 1;
            }
        }
    }
    sum / f64::from(count.max(1))
}
