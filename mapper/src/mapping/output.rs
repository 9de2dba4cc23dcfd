//! What a finished map leaves in the RUN folder.

use std::fs;

use rayon::prelude::*;

use super::prepare::Frames;
use crate::bundle::{BundleAdjustment, FrameState, Keyframe};
use crate::dataset::Dataset;
use crate::rendering::{Behind, ViewRenderer};
use crate::run::{RunError, RunWriter};
use crate::trajectory_file::TimedExposure;

/// Fills a run with the poses that it starts from, and brings its folder up to date: from here on it replaces an
/// earlier one.
pub(super) fn push_tracked(writer: &mut RunWriter, frames: &Frames) -> Result<(), RunError> {
    for (exposure, record) in frames.exposures.iter().zip(&frames.records) {
        writer.push(*exposure, *record)?;
    }
    writer.replace_earlier()?;
    writer.flush()
}

/// Writes map, refined exposures, deblurred keyframes and their depth.
pub(super) fn write(
    writer: &mut RunWriter,
    dataset: &Dataset,
    bundle: &BundleAdjustment,
    exposures: &[TimedExposure],
    gains: &[f64],
) -> Result<(), RunError> {
    let mut is_keyframe = vec![false; exposures.len()];
    bundle.keyframes().iter().for_each(|keyframe| is_keyframe[keyframe.index] = true);
    for (index, (exposure, gain)) in exposures.iter().zip(gains).enumerate() {
        writer.refine(index, *exposure, *gain, is_keyframe[index]);
    }
    writer.write_map(&bundle.state.map)?;
    let (camera, response) = (dataset.calibration().camera, dataset.calibration().response.inverse());
    let depth_scale = dataset.calibration().depth_scale;
    let falloff = bundle.sensor().falloff.clone();
    let renderer =
        || ViewRenderer::new(&bundle.state.map, camera, &response, depth_scale).through(falloff.clone());
    let pairs: Vec<_> = bundle.keyframes().iter().zip(&bundle.state.frames).collect();
    let write = |renderer: &mut ViewRenderer<'_>, (keyframe, frame): (&Keyframe, &FrameState)| {
        let colour = &keyframe.observation.level(0).colour;
        let behind = Behind::Captured { colour, gain: frame.log_gain.exp() as f32 };
        let view = renderer.render(&frame.path.mid(), behind);
        writer.write_depth(keyframe.index, view.size, &view.depth)?;
        writer.write_deblurred(keyframe.index, view.size, view.rgb)
    };
    let written: Vec<Result<(), RunError>> = pairs.into_par_iter().map_init(renderer, write).collect();
    for outcome in written {
        outcome?;
        writer.count_deblurred();
    }
    Ok(())
}

/// Most memory that the process had at a time, bytes; 0 where the system does not tell.
pub(super) fn peak_memory_bytes() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kibibytes = line.and_then(|line| line.trim().trim_end_matches(" kB").trim().parse::<u64>().ok());
    kibibytes.map_or(0, |kibibytes| kibibytes * 1024)
}
