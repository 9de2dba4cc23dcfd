//! What a finished map leaves in the RUN folder.

use std::fs;

use mba_adjust::bundle::{BundleAdjustment, MappedFrame};
use mba_adjust::deblurring::{DeblurMemory, KeyframeDeblurrer, LONGEST_BLUR, Reblurred};
use mba_io::dataset::{Dataset, RgbdFrame};
use mba_io::trajectory_file::TimedExposure;
use mba_map::map::Scene;
use mba_map::rendering::{Behind, ViewRenderer};
use rayon::prelude::*;

use super::prepare::Frames;
use crate::run::{RunError, RunWriter, for_viewers};
use crate::tracking::{TrackingOptions, tracker_config};

/// Fills a run with the poses that it starts from, and brings its folder up to date: from here on it replaces an
/// earlier one.
pub(super) fn push_tracked(writer: &mut RunWriter, frames: &Frames) -> Result<(), RunError> {
    for (exposure, record) in frames.exposures.iter().zip(&frames.records) {
        writer.push(*exposure, *record)?;
    }
    writer.replace_earlier()?;
    writer.flush()
}

/// Keyframes whose pictures are in memory together.
const TOGETHER: usize = 8;

/// Writes map, exposures, deblurred keyframes and their depth. `refined` has the exposure of every frame as it was fitted to the
/// map, and its logarithmic gain; `exposures` are what the run says.
pub(super) fn write(
    writer: &mut RunWriter,
    dataset: &Dataset,
    bundle: &mut BundleAdjustment,
    exposures: &[TimedExposure],
    refined: &[(TimedExposure, f64)],
) -> Result<(), RunError> {
    let mut is_keyframe = vec![false; exposures.len()];
    bundle.frames.iter().for_each(|frame| is_keyframe[frame.keyframe.index] = true);
    for (index, (exposure, (_, log_gain))) in exposures.iter().zip(refined).enumerate() {
        writer.record_mut().refine(index, *exposure, log_gain.exp(), is_keyframe[index]);
    }
    write_map(writer, dataset, bundle)?;
    let config = tracker_config(dataset, &TrackingOptions::default());
    let deblurrer = KeyframeDeblurrer::new(&config, dataset.simd());
    let count = bundle.frames.len();
    for first in (0..count).step_by(TOGETHER) {
        let keyframes = first..count.min(first + TOGETHER);
        // The map renders one picture after the other, on all threads; deblurring then takes one per thread.
        let explained: Vec<_> = keyframes.map(|k| (k, explained(bundle, k))).collect();
        let pictures = Pictures { dataset, bundle: &*bundle, refined, deblurrer: &deblurrer };
        let shared = &*writer;
        let written: Vec<Result<(), RunError>> = explained
            .into_par_iter()
            .map_init(
                || (pictures.renderer(), deblurrer.memory()),
                |memory, (k, explained)| pictures.write(shared, k, &explained, memory),
            )
            .collect();
        for outcome in written {
            outcome?;
            writer.count_deblurred();
        }
    }
    Ok(())
}

/// Writes the map; Gaussians with colours for viewers, too.
fn write_map(writer: &RunWriter, dataset: &Dataset, bundle: &BundleAdjustment) -> Result<(), RunError> {
    let Scene::Gaussians(map) = Scene::from(&bundle.map) else {
        return writer.write_map(&bundle.map);
    };
    let calibration = dataset.calibration();
    let response = calibration.response.inverse();
    let viewing = for_viewers(
        dataset.simd(),
        map,
        calibration.camera,
        &response,
        writer.record().upright(),
        (writer.record().exposures(), writer.record().frames()),
    );
    writer.write_map_for_viewers(map, &viewing)
}

/// What the picture of keyframe `k` is compared with to find detail.
enum Explained {
    /// Its blur is too long for any.
    Nothing,
    /// The map's picture, blurred as the map renders it, or along the flow.
    Picture(Option<Reblurred>),
}

fn explained(bundle: &mut BundleAdjustment, k: usize) -> Explained {
    if bundle.blur_px(k) < f64::from(LONGEST_BLUR) {
        Explained::Picture(bundle.explained(k))
    } else {
        Explained::Nothing
    }
}

/// What the pictures of keyframes are made of.
struct Pictures<'a> {
    dataset: &'a Dataset,
    bundle: &'a BundleAdjustment,
    refined: &'a [(TimedExposure, f64)],
    deblurrer: &'a KeyframeDeblurrer,
}

impl<'a> Pictures<'a> {
    fn renderer(&self) -> ViewRenderer<'a> {
        let calibration = self.dataset.calibration();
        let response = calibration.response.inverse();
        let (simd, map) = (self.dataset.simd(), &self.bundle.map);
        ViewRenderer::new(simd, map, calibration.camera, &response, calibration.depth_scale)
            .through(self.bundle.sensor().falloff.clone())
    }

    /// Writes the map's depth of keyframe `k`, and its picture with the detail that only the captured one has.
    fn write(
        &self,
        writer: &RunWriter,
        k: usize,
        explained: &Explained,
        (renderer, memory): &mut (ViewRenderer<'_>, DeblurMemory),
    ) -> Result<(), RunError> {
        let MappedFrame { keyframe, state } = &self.bundle.frames[k];
        let colour = &keyframe.observation.level(0).colour;
        let behind = Behind::Captured { colour, gain: state.log_gain.exp() as f32 };
        let view = renderer.render(&state.path.mid(), behind);
        writer.write_depth(keyframe.index, view.size, &view.depth)?;
        let Explained::Picture(reblurred) = explained else {
            return writer.write_deblurred(keyframe.index, view.size, view.rgb);
        };
        let captured = RgbdFrame {
            timestamp: self.dataset.timestamp(keyframe.index),
            depth_timestamp: self.dataset.depth_timestamp(keyframe.index),
            exposure_seconds: self.dataset.exposure_seconds(keyframe.index),
            ..keyframe.observation.level(0).frame(keyframe.index, self.dataset.calibration().depth_scale)
        };
        let (exposure, _) = &self.refined[keyframe.index];
        let shown = view.rgb.clone();
        // Observations have the size of the camera, and the memory is for it; else the map's picture stays.
        let rgb = self
            .deblurrer
            .with_detail(&captured, exposure, shown, reblurred.as_ref(), memory)
            .unwrap_or(view.rgb);
        writer.write_deblurred(keyframe.index, view.size, rgb)
    }
}

/// Most memory that the process had at a time, bytes; 0 where the system does not tell.
#[must_use]
pub fn peak_memory_bytes() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kibibytes = line.and_then(|line| line.trim().trim_end_matches(" kB").trim().parse::<u64>().ok());
    kibibytes.map_or(0, |kibibytes| kibibytes * 1024)
}
