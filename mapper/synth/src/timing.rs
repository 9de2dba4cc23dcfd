//! When and where along the camera's path each frame and each row is taken.

use super::SynthConfig;
use super::blur::ExposurePoses;
use super::motion::CameraPath;

/// Mid exposure of the first frame, seconds.
pub(super) const FIRST_TIMESTAMP: f64 = 0.1;

/// Mid exposure of the middle of frame `index`, seconds, rounded to what the files store, so that file and truth
/// agree.
pub(super) fn timestamp(config: &SynthConfig, index: usize) -> f64 {
    whole_microseconds(FIRST_TIMESTAMP + index as f64 / config.frame_rate)
}

/// When the depth of frame `index` is measured, seconds, rounded as well.
pub(super) fn depth_timestamp(config: &SynthConfig, index: usize) -> f64 {
    whole_microseconds(timestamp(config, index) + config.sensor.depth_delay_seconds)
}

/// How much later than the middle of the image a row is exposed, seconds.
pub(super) fn row_delay(config: &SynthConfig, row: usize) -> f64 {
    row_share(config, row) * config.sensor.readout_seconds
}

/// How much later than the middle of the depth map a row of it is measured, seconds.
pub(super) fn depth_row_delay(config: &SynthConfig, row: usize) -> f64 {
    row_share(config, row) * config.sensor.depth_readout_seconds
}

/// Place of the middle of a row within the image's height, from -1/2 to 1/2.
fn row_share(config: &SynthConfig, row: usize) -> f64 {
    (row as f64 + 0.5) / config.height as f64 - 0.5
}

/// Poses at opening, middle and closing of the shutter that is open for `exposure` seconds around `delay` after the
/// timestamp of frame `index`.
pub(super) fn exposure_poses(
    config: &SynthConfig,
    path: &CameraPath,
    index: usize,
    exposure: f64,
    delay: f64,
) -> ExposurePoses {
    let mid = timestamp(config, index) + delay;
    let half = 0.5 * exposure;
    [mid - half, mid, mid + half].map(|time| path.pose(on_path(config, index, time)))
}

/// The time on the camera's path at `time` of frame `index`: earlier by the jump from its frame on, so that this
/// frame sees what the first one has seen.
pub(super) fn on_path(config: &SynthConfig, index: usize, time: f64) -> f64 {
    match config.events.jump {
        Some(jump) if index >= jump => time - jump as f64 / config.frame_rate,
        _ => time,
    }
}

/// As [`on_path`] for a time of no frame; the jump lies half way between two.
pub(super) fn on_path_at(config: &SynthConfig, time: f64) -> f64 {
    let has_jumped = |jump: &usize| time >= timestamp(config, *jump) - 0.5 / config.frame_rate;
    let index = config.events.jump.filter(has_jumped).unwrap_or(0);
    on_path(config, index, time)
}

fn whole_microseconds(time: f64) -> f64 {
    (time * 1e6).round() / 1e6
}
