//! What is observed in a keyframe, at full and at reduced resolutions.

use std::sync::Arc;

use mba_io::dataset::RgbdFrame;
use mba_tracker::geometry::PinholeCamera;
use mba_tracker::image::PixelRectangle;
use mba_tracker::photometric::InverseResponse;
use rayon::prelude::*;

use super::forward_response::ForwardResponse;
use crate::exposure::{RowTimes, RowTiming};

/// A captured frame at one resolution.
#[derive(Clone, Debug, PartialEq)]
pub struct Observation {
    /// Camera of this resolution.
    pub camera: PinholeCamera,
    /// Red, green and blue as stored, one plane each, row by row.
    pub colour: [Vec<u8>; 3],
    /// Depth in metres, row by row; 0 where missing.
    pub depth: Vec<f32>,
    /// Pixels that stem from the sensor; what is outside is not compared.
    pub region: PixelRectangle,
    /// When rows of colour and of depth were exposed, on the path of the frame.
    pub times: RowTimes,
    /// Share of light that the lens lets through to each pixel, row by row; none where it is the same for all.
    pub falloff: Option<Arc<[f32]>>,
}

impl Observation {
    /// Colours as stored: red, green and blue of each pixel, row by row.
    #[must_use]
    pub fn rgb(&self) -> Vec<u8> {
        let [red, green, blue] = &self.colour;
        red.iter().zip(green).zip(blue).flat_map(|((red, green), blue)| [*red, *green, *blue]).collect()
    }

    /// The frame that was captured, with `depth_scale` raw units per metre of depth; it has no times.
    #[must_use]
    pub fn frame(&self, index: usize, depth_scale: f64) -> RgbdFrame {
        // Casts saturate, and raw depths have come from 16 bits.
        let raw = |depth: &f32| (f64::from(*depth) * depth_scale).round() as u16;
        RgbdFrame {
            index,
            timestamp: 0.0,
            depth_timestamp: 0.0,
            exposure_seconds: 0.0,
            width: self.camera.width,
            height: self.camera.height,
            rgb: self.rgb(),
            depth: self.depth.iter().map(raw).collect(),
        }
    }
}

/// A captured frame at full resolution and at halves of it.
///
/// The path of a frame covers all the time in which anything of it was measured; for a camera that exposes all rows
/// together and measures depth with them, that is the exposure.
#[derive(Clone, Debug, PartialEq)]
pub struct ObservationPyramid {
    levels: Vec<Observation>,
}

/// How frames become observations.
#[derive(Clone, Debug)]
pub struct Sensor {
    /// Camera of the frames.
    pub camera: PinholeCamera,
    /// Linear light of stored values.
    pub inverse_response: InverseResponse,
    /// Raw depth units per metre, positive.
    pub depth_scale: f64,
    /// Pixels of every frame that stem from the sensor.
    pub region: PixelRectangle,
    /// How rows are read.
    pub rows: RowTiming,
    /// Share of light that the lens lets through to each pixel of a frame, row by row; none where it is the same for all.
    pub falloff: Option<Arc<[f32]>>,
}

impl Sensor {
    /// Row times of a frame on its path, and how many times as long as the exposure the path is.
    #[must_use]
    pub fn times(&self, exposure_seconds: f64, depth_offset_seconds: f64) -> (RowTimes, f64) {
        let span = self.rows.span_seconds(exposure_seconds, depth_offset_seconds);
        let times = self.rows.over(span, exposure_seconds, depth_offset_seconds);
        (times, if times.exposure > 0.0 { 1.0 / times.exposure } else { 1.0 })
    }
}

/// Depths of a 2x2 block count as one surface within this factor of the nearest.
const SAME_SURFACE: f32 = 1.03;

impl ObservationPyramid {
    /// The frame at `levels` resolutions, at least one. Colours are averaged as light.
    ///
    /// Returns `None` if the frame's buffers do not have the size of the camera.
    #[must_use]
    pub fn new(sensor: &Sensor, frame: &RgbdFrame, levels: usize) -> Option<Self> {
        let pixels = sensor.camera.width * sensor.camera.height;
        if frame.rgb.len() != 3 * pixels || frame.depth.len() != pixels {
            return None;
        }
        let plane = |channel: usize| frame.rgb.iter().skip(channel).step_by(3).copied().collect();
        let metres = 1.0 / sensor.depth_scale;
        let (times, _) = sensor.times(frame.exposure_seconds, frame.depth_timestamp - frame.timestamp);
        let full = Observation {
            camera: sensor.camera,
            colour: [plane(0), plane(1), plane(2)],
            depth: frame.depth.iter().map(|&raw| (f64::from(raw) * metres) as f32).collect(),
            region: sensor.region,
            times,
            falloff: sensor.falloff.clone(),
        };
        let forward = ForwardResponse::new(&sensor.inverse_response);
        let mut all = vec![full];
        for level in 1..levels {
            let finer = &all[level - 1];
            // A side of 16 pixels has no room for a window of the similarity.
            if finer.camera.width < 32 || finer.camera.height < 32 {
                break;
            }
            all.push(half(sensor, &forward, finer, level));
        }
        Some(Self { levels: all })
    }

    /// The frame at resolution `level`, where 0 is full; the coarsest there is if `level` is coarser.
    #[must_use]
    pub fn level(&self, level: usize) -> &Observation {
        &self.levels[level.min(self.levels.len() - 1)]
    }

    /// Number of resolutions, at least 1.
    #[must_use]
    pub fn len(&self) -> usize {
        self.levels.len()
    }

    /// Whether there is no resolution, which is never so.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        false
    }
}

/// The four pixels of the finer level under each pixel of a coarser one.
fn blocks(finer: &Observation) -> impl IndexedParallelIterator<Item = [usize; 4]> {
    let stride = finer.camera.width;
    let (width, height) = (stride / 2, finer.camera.height / 2);
    (0..width * height).into_par_iter().map(move |pixel| {
        let first = 2 * (pixel / width) * stride + 2 * (pixel % width);
        [first, first + 1, first + stride, first + stride + 1]
    })
}

fn half(sensor: &Sensor, forward: &ForwardResponse, finer: &Observation, level: usize) -> Observation {
    let light = |byte: u8| sensor.inverse_response.linear_light(byte);
    let colour = finer.colour.each_ref().map(|plane| {
        // Means are of light, not of stored values.
        let mean = |block: [usize; 4]| 0.25 * block.iter().map(|&pixel| light(plane[pixel])).sum::<f32>();
        blocks(finer).map(|block| forward.encode(mean(block))).collect()
    });
    let depth = blocks(finer).map(|block| nearest_surface(block.map(|pixel| finer.depth[pixel]))).collect();
    Observation {
        camera: sensor.camera.at_level(level),
        colour,
        depth,
        region: sensor.region.at_level(level),
        times: finer.times,
        falloff: finer.falloff.as_ref().map(|falloff| {
            let mean = |block: [usize; 4]| 0.25 * block.iter().map(|&pixel| falloff[pixel]).sum::<f32>();
            blocks(finer).map(mean).collect::<Vec<f32>>().into()
        }),
    }
}

/// Mean depth of the nearest surface among four depths, 0 where none is known: across an edge there is no mean.
fn nearest_surface(depths: [f32; 4]) -> f32 {
    let known = depths.iter().copied().filter(|&depth| depth > 0.0);
    let nearest = known.clone().fold(f32::INFINITY, f32::min);
    let (sum, count) = known
        .filter(|&depth| depth <= SAME_SURFACE * nearest)
        .fold((0.0, 0.0), |(sum, count), depth| (sum + depth, count + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}
