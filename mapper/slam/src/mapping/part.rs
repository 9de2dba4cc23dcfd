//! A part of a run that is mapped by itself.

use std::ops::Range;

use mba_adjust::bundle::{BundleAdjustment, MapKeyframe, MappedFrame};
use mba_raster::exposure::ExposurePath;
use mba_tracker::geometry::RigidTransform;
use nalgebra::{Matrix6, Vector6};
use serde::Serialize;

use super::prepare::Frames;
use crate::run::Summary;

/// Standard deviation of the picture of a keyframe on a finished map, pixels along each coordinate of its path.
const PIXELS: f64 = 0.1;

/// What of a run is mapped.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MapPart {
    /// Keyframes of the map, indices in the data set, ascending.
    pub keyframes: Vec<usize>,
    /// Frames between keyframes that are fitted to the map.
    pub frames: Range<usize>,
}

/// What [`map_part`](super::map_part) found.
#[derive(Clone, Debug)]
pub struct MappedPart {
    /// The summary of its RUN folder.
    pub summary: Summary,
    /// All keyframes that could be read, ascending by index.
    pub keyframes: Vec<MappedKeyframe>,
}

/// A keyframe as a finished map has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MappedKeyframe {
    /// Index in the data set.
    pub index: usize,
    /// Camera-to-world at mid exposure.
    pub world_from_camera: RigidTransform,
    /// Logarithm of the gain on the map's light that gives the frame's.
    pub log_gain: f64,
    /// Inverse covariance of the pose, tangent (translation in metres, rotation in radians) in the camera frame.
    pub information: Matrix6<f64>,
}

/// The keyframes of a finished bundle.
pub(super) fn mapped_keyframes(bundle: &BundleAdjustment, frames: &Frames) -> Vec<MappedKeyframe> {
    let mapped = bundle.frames.iter().map(|MappedFrame { keyframe, state }| MappedKeyframe {
        index: keyframe.index,
        world_from_camera: frames.exposure_of(keyframe.index, state).mid,
        log_gain: state.log_gain,
        information: information(keyframe),
    });
    mapped.collect()
}

/// How well the picture of a keyframe tells where its camera is: by the pixels that a movement is seen as.
fn information(keyframe: &MapKeyframe) -> Matrix6<f64> {
    let in_camera = ExposurePath::still(RigidTransform::identity());
    let units = |k: usize| {
        let tangent = Vector6::from_fn(|row, _| if row == k { 1.0 } else { 0.0 });
        keyframe.metric.units(&in_camera, &tangent)
    };
    let units_from_tangent = Matrix6::from_columns(&[0, 1, 2, 3, 4, 5].map(units));
    units_from_tangent.transpose() * units_from_tangent / (PIXELS * PIXELS)
}
