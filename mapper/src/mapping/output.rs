//! What a finished map leaves in the RUN folder.

use std::fs;

use rayon::prelude::*;

use super::prepare::Frames;
use crate::bundle::{BundleAdjustment, FrameState, Keyframe};
use crate::dataset::Dataset;
use crate::deblurring::ForwardResponse;
use crate::gaussians::Gaussians;
use crate::raster::{RasterImage, RasterScratch, RasterView, Rasterizer};
use crate::rendering::SOLID_ALPHA;
use crate::run::{RunError, RunWriter};
use crate::trajectory_file::TimedExposure;

/// Fills a run with the poses that it starts from, and brings its folder up to date.
pub(super) fn push_tracked(writer: &mut RunWriter, frames: &Frames) -> Result<(), RunError> {
    for (exposure, record) in frames.exposures.iter().zip(&frames.records) {
        writer.push(*exposure, *record)?;
    }
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
    writer.write_map(&bundle.state.gaussians)?;
    let deblurrer = MapDeblurrer::new(dataset, &bundle.state.gaussians);
    let pairs: Vec<_> = bundle.keyframes().iter().zip(&bundle.state.frames).collect();
    let written: Vec<Result<(), RunError>> = pairs
        .into_par_iter()
        .map_init(Default::default, |memory, (keyframe, frame)| {
            let (rgb, depth) = deblurrer.deblur(memory, keyframe, frame);
            let camera = dataset.calibration().camera;
            let size = [camera.width, camera.height];
            writer.write_depth(keyframe.index, size, &depth)?;
            writer.write_deblurred(keyframe.index, size, rgb)
        })
        .collect();
    for outcome in written {
        outcome?;
        writer.count_deblurred();
    }
    Ok(())
}

/// Shows keyframes as the map has them at mid exposure.
pub(super) struct MapDeblurrer<'a> {
    dataset: &'a Dataset,
    map: &'a Gaussians,
    rasterizer: Rasterizer,
    response: ForwardResponse,
}

impl<'a> MapDeblurrer<'a> {
    pub(super) fn new(dataset: &'a Dataset, map: &'a Gaussians) -> Self {
        let response = ForwardResponse::new(&dataset.calibration().response.inverse());
        Self { dataset, map, rasterizer: Rasterizer::new(mba_tracker::SimdLevel::new()), response }
    }

    /// Colour and raw depth of a keyframe at mid exposure, as bright as it was captured. Where the map is transparent
    /// the captured colours show through; there is no depth there.
    pub(super) fn deblur(
        &self,
        (scratch, image): &mut (RasterScratch, RasterImage),
        keyframe: &Keyframe,
        frame: &FrameState,
    ) -> (Vec<u8>, Vec<u16>) {
        let calibration = self.dataset.calibration();
        let world_from_camera = frame.path.mid();
        let view = RasterView { camera: calibration.camera, world_from_camera, background: [0.0; 3] };
        self.rasterizer.forward(self.map, &view, scratch, image);
        let (inverse, gain) = (calibration.response.inverse(), frame.log_gain.exp() as f32);
        let captured = &keyframe.observation.level(0).colour;
        let mut rgb = Vec::with_capacity(3 * image.alpha.len());
        for (pixel, alpha) in image.alpha.iter().enumerate() {
            for channel in 0..3 {
                let behind = inverse.linear_light(captured[channel][pixel]);
                let light = gain * image.colour[channel][pixel] + (1.0 - alpha) * behind;
                rgb.push(self.response.encode(light));
            }
        }
        let scale = calibration.depth_scale as f32;
        let raw = |(depth, alpha): (&f32, &f32)| {
            let raw = (depth / alpha * scale).round();
            if *alpha > SOLID_ALPHA && raw <= f32::from(u16::MAX) { raw as u16 } else { 0 }
        };
        (rgb, image.depth.iter().zip(&image.alpha).map(raw).collect())
    }
}

/// Most memory that the process had at a time, bytes; 0 where the system does not tell.
pub(super) fn peak_memory_bytes() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kibibytes = line.and_then(|line| line.trim().trim_end_matches(" kB").trim().parse::<u64>().ok());
    kibibytes.map_or(0, |kibibytes| kibibytes * 1024)
}
