//! RUN folders with a given map, poses without motion during the exposure, and no data set behind them.

use std::path::Path;

use mba_mapper::gaussians::{Gaussians, write_ply};
use mba_mapper::map::MAP_FILE;
use mba_mapper::run::{FrameRecord, FrameStatus, RunCamera, RunSettings, RunWriter};
use mba_mapper::trajectory_file::{TimedExposure, TimedPose};

/// Writes a run into the folder `run`; frames have pose, status and whether they are keyframes.
///
/// # Panics
/// When it cannot be written.
pub fn write(
    run: &Path,
    camera: Option<RunCamera>,
    frames: &[(TimedPose, FrameStatus, bool)],
    map: &Gaussians,
) {
    let (program, dataset, options) = ("mba test".into(), "data".into(), Default::default());
    let settings = RunSettings { program, dataset, frame_rate: 10.0, camera, options };
    let mut writer = RunWriter::create_in(run, settings).expect("a run");
    for (TimedPose { timestamp, world_from_camera }, status, keyframe) in frames {
        let [start, mid, end] = [*world_from_camera; 3];
        let record = FrameRecord {
            keyframe: u8::from(*keyframe),
            ..FrameRecord::without_figures(*timestamp, *status)
        };
        writer.push(TimedExposure { timestamp: *timestamp, start, mid, end }, record).expect("a frame");
    }
    writer.finish(|_| ()).expect("a finished run");
    write_ply(&run.join(MAP_FILE), map).expect("a map");
}
